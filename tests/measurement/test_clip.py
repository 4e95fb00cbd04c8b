"""From clips to angles: right, as sure as it says, and silent about no frame that it could not measure."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.command_csv import read_command
from anglecam.io.rig import Rig, RigMark, RigPivot, read_rig
from anglecam.measurement.bounds import worst_case, worst_case_both_ends
from anglecam.measurement.clip import measure_clip
from anglecam.measurement.mark_pass import detect_mark
from anglecam.measurement.sigma import Scatter, Sigma, angle_sigma, place_errors, scatter_of
from anglecam.video.open_film import open_film
from support import broken
from support.drawn import Look, Recording, draw_frames, draw_session, write_clip
from support.films import NOD, REST, nod, rig_of

SWING = nod(45)
"""As far as `NOD` in both directions."""


@pytest.fixture(params=["colour declared", pytest.param("nothing declared", marks=pytest.mark.sweep)])
def rig_for(request):
    """Return a function that declares a look's rig, with the mark's colour or, in the sweep, without it."""
    mouth = {} if request.param == "colour declared" else {"mouth": "auto"}
    return lambda look, **more: rig_of(look, **(mouth | more))


def _film(folder: Path, look: Look, angle=SWING, edit=None) -> Path:
    path = folder / "clip.avi"
    frames = list(draw_frames(look, angle, np.arange(len(angle)) / 30, seed=11))
    if edit is not None:
        edit(frames, look.mouth(angle))
    write_clip(path, iter(frames))
    return path


def _errors(series, angle) -> tuple[np.ndarray, np.ndarray]:
    ok = series.ok
    return np.degrees(series.angle)[ok] - angle[ok], np.degrees(series.sigma)[ok]


SESSIONS = {
    "ring, mug": (Look(), "auto", 8.0, 0.03, (0.5, 1.3)),
    "left, dark skin, red pendulum": (
        Look(facing="left", lever_px=210.0, skin="dark", marker="ring_white", distractor="pendulum"),
        "auto",
        8.0,
        0.03,
        (0.5, 1.3),
    ),
    "disc, book near": (
        Look(marker="disc_dark", background="gradient", red_object="book", red_place="near"),
        "declared",
        8.0,
        0.03,
        (0.5, 1.3),
    ),
    # Without a marker the pivot's uncertainty rules, one draw of it for the clip: only an upper limit can be asked.
    "no marker, no hint, red lamp": (
        Look(lever_px=150.0, marker="none", red_place="near", distractor="led"),
        "auto",
        None,
        0.06,
        (0.0, 1.5),
    ),
}


@pytest.fixture(scope="module")
def drawn(request, tmp_path_factory):
    """Draw and measure one of `SESSIONS`."""
    folder = tmp_path_factory.mktemp("drawn")
    look, mouth, hint, limit, ratio = SESSIONS[request.param]
    seconds = 3.0 if request.param == "ring, mug" else 4.0
    clips = [Recording("stairs", "stairs", duration_s=seconds, amplitude_deg=14.0)]
    truth = draw_session(folder, look=look, recordings=clips, mouth=mouth, hint_error_px=hint, seed=4)["stairs"]
    command = read_command(folder / "stairs.command.csv")
    return look, limit, ratio, measure_clip(open_film(truth.clip), read_rig(folder / "rig.yaml"), command), truth


IN_SWEEP = tuple(name for name in SESSIONS if name != "ring, mug")
"""Without a marker and a hint things are measured in `tests/measurement/test_any_mark.py`."""


SWEPT = [pytest.param(name, marks=[pytest.mark.sweep] if name in IN_SWEEP else ()) for name in SESSIONS]
"""The sessions, those that are like another with the mark `sweep`."""


@pytest.mark.parametrize("drawn", SWEPT, indirect=True)
def test_the_whole_error_mean_and_scatter_is_as_large_as_sigma(drawn):
    _, _, ratio, measured, truth = drawn
    error, sigma = _errors(measured.series, truth.angle_deg)
    assert ratio[0] < np.sqrt(((error / sigma) ** 2).mean()) < ratio[1]


@pytest.mark.parametrize("drawn", SWEPT, indirect=True)
def test_angles_are_right_and_sigma_is_true_beside_a_second_red_object(drawn):
    look, limit, ratio, measured, truth = drawn
    series = measured.series
    assert series.status == ("ok",) * len(truth.angle_deg)
    error, sigma = _errors(series, truth.angle_deg)
    assert np.sqrt((error**2).mean()) < limit
    # neutral's error is one draw for the whole clip: the scatter is held against sigma closely, the mean loosely
    assert ratio[0] < np.std(error / sigma) < ratio[1]
    assert np.abs(np.mean(error / sigma)) < 2.5
    # Against the centroid's own place: the distractor never won.
    assert np.hypot(*(series.mark_px - truth.mark_px).T).max() < 1.0
    six = np.degrees(series.bounds[6.0])
    assert (np.abs(error) < six).all()
    np.testing.assert_allclose(six, np.degrees(np.arcsin(6.0 / look.lever_px)), rtol=0.02)
    np.testing.assert_allclose(series.time, truth.time_s, atol=1e-9)


def test_a_lever_of_120_px_stays_below_a_tenth_of_a_degree(tmp_path, rig_for):
    look = Look(lever_px=120.0, skin="dark")
    series = measure_clip(open_film(_film(tmp_path, look)), rig_for(look), REST).series
    error, _ = _errors(series, SWING)
    assert np.sqrt((error**2).mean()) < 0.1
    assert series.ok.all()


def test_occluded_frames_are_marked_and_no_wrong_row_is_ok(tmp_path, rig_for):
    look = Look()
    hidden = dict(zip(range(45, 58), (5, 9, 14, 25, 60, 60, 60, 60, 60, 25, 14, 9, 5), strict=True))

    def cover(frames, mouths):
        for i, width in hidden.items():
            x, y = mouths[i].round().astype(int)
            cv2.rectangle(frames[i], (x + 24 - width, y - 90), (x + 24, y + 90), (90, 120, 60), -1)

    series = measure_clip(open_film(_film(tmp_path, look, NOD.angle, edit=cover)), rig_for(look), REST).series
    wrong = np.zeros(len(NOD.angle), bool)
    wrong[[i for i, width in hidden.items() if width >= 14]] = True
    assert all(series.status[i] == "occluded" for i in np.flatnonzero(wrong))
    assert (np.array(series.status)[[i for i in range(len(NOD.angle)) if i not in hidden]] == "ok").all()
    error, _ = _errors(series, NOD.angle)
    assert np.abs(error).max() < 0.12
    assert np.isnan(series.angle[~series.ok]).all()
    assert np.isnan(series.mark_px[~series.ok]).all()


def test_a_repeated_frame_in_motion_is_a_duplicate_and_at_rest_it_is_not(tmp_path, rig_for):
    def repeat(frames, _):
        for i in (30, 31, 40):
            frames[i] = frames[i - 1]

    look = Look(noise=0.0)
    # the same picture is the same bytes in MJPG too, and is read ten times as fast as FFV1
    series = measure_clip(open_film(_film(tmp_path, look, edit=repeat)), rig_for(look), REST).series
    assert [i for i, s in enumerate(series.status) if s != "ok"] == [30, 31, 40]
    assert {series.status[i] for i in (30, 31, 40)} == {"duplicate"}


def test_a_clip_at_rest_is_measured_beside_a_larger_red_mug(tmp_path):
    look = Look(lever_px=200.0)
    measured = measure_clip(open_film(_film(tmp_path, look, np.zeros(30))), rig_of(look, mouth="auto"))
    assert measured.series.ok.all()
    assert np.hypot(*(measured.series.mark_px - look.mouth(np.zeros(30))).T).max() < 1.0
    assert np.degrees(np.abs(measured.series.angle)).max() < 0.01


@pytest.mark.parametrize("pivot", ["near", "at"])
@pytest.mark.parametrize("by", ["colour", "place", "box"])
def test_a_declared_mark_that_stands_still_is_no_success(tmp_path, by, pivot):
    look = Look(lever_px=200.0)
    (x, y) = look.mouth(np.zeros(1))[0].tolist()
    marks = {
        "colour": RigMark(rgb=look.lips_rgb),
        "place": RigMark(at=(x, y), frame=3),
        "box": RigMark(box=(x - 3.0, y - 3.0, x + 3.0, y + 3.0), frame=3),
    }
    declared = RigPivot.model_validate({pivot: tuple(look.pivot)})
    rig = rig_of(look, mouth=marks[by], pivot=declared)
    doubt = measure_clip(open_film(_film(tmp_path, look, np.zeros(30))), rig).doubt
    assert doubt is not None
    place = re.search(r"the declared mark stands still: around (\d+),(\d+) it travels 0\.\d+ px", doubt)
    assert place is not None
    assert np.hypot(int(place[1]) - x, int(place[2]) - y) < 2.0


@pytest.mark.parametrize("by", ["colour", "place", "box"])
def test_a_declared_mark_that_stands_still_without_a_pivot_is_refused(tmp_path, by):
    look = Look(lever_px=200.0)
    (x, y) = look.mouth(np.zeros(1))[0].tolist()
    marks = {
        "colour": RigMark(rgb=look.lips_rgb),
        "place": RigMark(at=(x, y), frame=3),
        "box": RigMark(box=(x - 3.0, y - 3.0, x + 3.0, y + 3.0), frame=3),
    }
    try:
        doubt = measure_clip(open_film(_film(tmp_path, look, np.zeros(30))), Rig(mouth=marks[by])).doubt
    except InputError as refused:
        doubt = str(refused)
    assert doubt is not None
    assert re.search("stands still|nothing is seen to turn", doubt)


@pytest.mark.parametrize("rgb", [(225, 62, 70), pytest.param((150, 20, 20), marks=pytest.mark.sweep)])
def test_a_declared_colour_may_be_30_levels_off(films, rgb):
    look = Look()
    measured = films.measured(NOD, rig_of(look, mouth=RigMark(rgb=rgb)), REST)
    error, _ = _errors(measured.series, NOD.angle)
    assert np.sqrt((error**2).mean()) < 0.03
    assert np.abs(np.array(measured.detections.colour_rgb) - look.lips_rgb).max() < 15


def test_flicker_and_pale_lips_do_no_harm(tmp_path):
    def flicker(frames, _):
        for i, frame in enumerate(frames):
            frames[i] = cv2.convertScaleAbs(frame, alpha=1 + 0.1 * np.sin(2.3 * i))

    look = Look(lips_rgb=(168, 92, 92))
    series = measure_clip(open_film(_film(tmp_path, look, edit=flicker)), rig_of(look, mouth="auto"), REST).series
    error, _ = _errors(series, SWING)
    assert series.ok.mean() > 0.97
    assert np.sqrt((error**2).mean()) < 0.03


def test_neutral_is_what_is_declared_else_the_rest_else_the_median(tmp_path, rig_for, monkeypatch):
    look = Look(marker="disc_bright", facing="left")
    clip = _film(tmp_path, look)
    detections = detect_mark(open_film(clip), rig_for(look))  # they do not depend on neutral, radii and command
    monkeypatch.setattr("anglecam.measurement.followed.detect_mark", lambda *_: detections)
    declared = measure_clip(open_film(clip), rig_for(look, neutral=look.neutral_deg - 3.0), REST).series
    rest = measure_clip(open_film(clip), rig_for(look, pixel_error_px=(4.0,)), REST).series
    median = measure_clip(open_film(clip), rig_for(look)).series
    np.testing.assert_allclose(np.degrees(declared.angle), SWING + 3.0, atol=0.5)  # centroid and centre differ a little
    np.testing.assert_allclose(np.degrees(rest.angle), SWING, atol=0.1)
    assert abs(np.median(median.angle)) < 1e-12
    np.testing.assert_allclose(rest.line, median.line)
    assert set(rest.bounds) == {4.0, 6.0, 10.0}


def test_a_marker_away_from_the_centre_of_rotation_is_reported(tmp_path, rig_for):
    look = Look(marker="none")

    def paint(frames, _):
        x, y = (look.pivot + (0.0, 5.0)).round().astype(int)
        for frame in frames:
            cv2.circle(frame, (int(x), int(y)), 9, (20, 20, 20), -1, cv2.LINE_AA)

    measured = measure_clip(open_film(_film(tmp_path, look, edit=paint)), rig_for(look), REST)
    assert any("px apart" in note for note in measured.detections.notes)
    error, _ = _errors(measured.series, SWING)
    assert np.abs(error).max() < 0.15


def test_a_clip_without_the_declared_mouth_is_one_line_with_counts_and_colour(tmp_path):
    clip = broken.clip_without_mouth(tmp_path)
    with pytest.raises(InputError) as error:
        measure_clip(open_film(clip), Rig(mouth=RigMark(rgb=(190, 35, 40))))
    told = f"{clip}: no mark found in 30 of 30 frames (colour 190,35,40); something moves around "
    assert str(error.value).startswith(told)
    assert str(error.value).endswith("; point at what turns: mark: {at: [x, y], frame: k} in rig.yaml")


@pytest.mark.sweep  # `tests/check/test_films.py` has a smaller one, refused in the same words
def test_a_clip_in_which_nothing_turns_is_one_line(tmp_path):
    look = Look(lips_rgb=(216, 182, 160), red_object=None)
    clip = _film(tmp_path, look, np.zeros(30))
    with pytest.raises(InputError) as error:
        measure_clip(open_film(clip), Rig())
    assert str(error.value).startswith(f"{clip}: no mark found in 30 of 30 frames (colour auto)")
    assert "\n" not in str(error.value)


def test_a_head_without_lipstick_is_measured_and_a_red_mug_is_no_mouth_of_it(tmp_path):
    look = Look(lips_rgb=(216, 182, 160))
    measured = measure_clip(open_film(_film(tmp_path, look)), rig_of(look, mouth="auto"), REST)
    error, sigma = _errors(measured.series, SWING)
    assert measured.series.ok.mean() > 0.9
    assert np.sqrt((error**2).mean()) < 0.05
    assert np.std(error / sigma) < 2.0


def test_what_is_left_of_a_truncated_clip_is_measured_and_the_rest_is_said(films, tmp_path, rig_for):
    look = Look()
    cut = broken.truncated_clip(tmp_path, films.film(NOD))
    measured = measure_clip(open_film(cut), rig_for(look), REST)
    read = sum(s != "undecodable" for s in measured.series.status)
    assert 33 < read < 48
    assert measured.detections.truncated == f"truncated: {read} of {len(NOD.angle)} frames could be read"
    error, _ = _errors(measured.series, NOD.angle[: len(measured.series.time)])
    assert np.sqrt((error**2).mean()) < 0.03
    assert films.measured(NOD, rig_for(look), REST).truncated is None


def test_worst_cases_at_the_papers_arms():
    np.testing.assert_allclose(np.degrees(worst_case(6.0, [1228.0, 842.5])), [0.28, 0.408], atol=5e-4)
    assert np.degrees(worst_case(10.0, 842.5)) == pytest.approx(0.68, abs=5e-4)
    assert worst_case_both_ends(5.0, 842.5) == worst_case(10.0, 842.5)
    np.testing.assert_allclose(worst_case(6.0, [6.0, 3.0, 0.0]), np.pi)
    assert np.isnan(worst_case(6.0, np.nan))


def test_sigma_propagates_noise_pose_and_pivot():
    rng = np.random.default_rng(0)
    pivot, R, n = np.array([200.0, 300.0]), 170.0, 400
    covariance = np.diag([0.3, 0.1]) ** 2
    angle = np.where(np.arange(n) < 100, 0.0, np.radians(15 * np.sin(np.arange(n) / 20)))
    pulls = []
    for _ in range(60):
        mouth = pivot + R * np.column_stack([np.cos(angle), -np.sin(angle)]) + 0.03 * rng.standard_normal((n, 2))
        used = pivot + np.sqrt(np.diag(covariance)) * rng.standard_normal(2)
        off = np.hypot(*(mouth - pivot).T) - R
        errors = place_errors(mouth, off, np.full(n, 0.01), np.full(n, 0.01))
        resting = np.arange(n) < 100
        sigma = angle_sigma(mouth, used, covariance, errors, resting).total
        arm = mouth - used
        line = np.arctan2(-arm[:, 1], arm[:, 0])
        pulls.append((line - line[resting].mean() - angle) / sigma)
    assert 0.85 < np.std(pulls) < 1.15


def test_the_random_part_is_the_scatter_of_frames_and_the_common_part_the_error_they_share():
    rng = np.random.default_rng(1)
    pivot, R, n = np.array([200.0, 300.0]), 170.0, 400
    covariance = np.diag([0.3, 0.1]) ** 2
    angle = np.where(np.arange(n) < 100, 0.0, np.radians(15 * np.sin(np.arange(n) / 20)))
    resting, moving = np.arange(n) < 100, np.arange(n) >= 100
    away = moving & (np.abs(angle) > np.radians(5.0))
    scattered, shared = [], []
    for _ in range(60):
        exact = pivot + R * np.column_stack([np.cos(angle), -np.sin(angle)])
        mouth = exact + 0.03 * rng.standard_normal((n, 2))
        used = pivot + np.sqrt(np.diag(covariance)) * rng.standard_normal(2)
        errors = place_errors(mouth, np.hypot(*(mouth - pivot).T) - R, np.full(n, 0.01), np.full(n, 0.01))
        sigma = angle_sigma(mouth, used, covariance, errors, resting)
        about, without_noise = mouth - pivot, exact - used
        line = np.arctan2(-about[:, 1], about[:, 0])
        random = sigma.random(scatter_of(np.arange(n) / 30, line))
        scattered.append((line - angle)[moving] / random[moving])
        line = np.arctan2(-without_noise[:, 1], without_noise[:, 0])
        shared.append((line - line[resting].mean() - angle)[away] / sigma.common[away])
    assert 0.95 < np.sqrt(np.mean(np.square(scattered))) < 1.05
    assert 0.8 < np.sqrt(np.mean(np.square(shared))) < 1.2  # 60 pivots


def test_an_error_of_the_pose_is_random_as_far_as_it_scatters():
    time, noise, pose = np.arange(300) / 30, 1e-4, 1e-3
    parts = Sigma(np.full(300, noise), np.full(300, pose), np.full(300, 5e-3))
    motion = 0.2 * np.sin(2.0 * time)
    rng = np.random.default_rng(2)
    slow = motion + pose * np.sin(3.0 * motion / 0.2) + noise * rng.standard_normal(300)
    fast = motion + np.hypot(noise, pose) * rng.standard_normal(300)
    assert np.median(parts.random(scatter_of(time, slow))) == pytest.approx(noise, rel=0.3)
    assert np.median(parts.random(scatter_of(time, fast))) == pytest.approx(np.hypot(noise, pose), rel=0.2)
    assert np.median(parts.random(Scatter(np.nan, np.nan))) == pytest.approx(np.hypot(noise, pose))


def test_noise_that_does_not_scatter_is_common():
    n = 400
    time, noise, common = np.arange(n) / 30, 1e-4, 5e-3
    parts = Sigma(np.full(n, 10.0 * noise), np.zeros(n), np.full(n, common))
    angle = 0.2 * np.sin(2.0 * time) + noise * np.random.default_rng(2).standard_normal(n)
    assert np.median(parts.random(scatter_of(time, angle))) == pytest.approx(noise, rel=0.15)


@pytest.mark.parametrize("off", [(-60, 30), pytest.param((60, 20), marks=pytest.mark.sweep)])
def test_a_mouth_that_rests_in_two_places_is_found_though_the_hint_is_far_from_its_centre(tmp_path, off):
    look = Look()
    held = np.concatenate([np.full(28, -15.0), [-10.0, -2.0, 4.0, 3.0, 0.5, -0.3], np.zeros(16)])
    x, y = look.pivot
    rig = Rig(facing=look.facing, pivot=RigPivot(near=(x + off[0], y + off[1]), marker="none"))
    measured = measure_clip(open_film(_film(tmp_path, look, held)), rig)
    assert set(measured.series.status) == {"ok"}
    miss = measured.angles.pivot.centre_px - look.pivot
    assert np.hypot(*miss) < 6.0  # the hint, 67 px off, draws it by 3
    assert miss @ np.linalg.solve(measured.angles.pivot.covariance_px2, miss) < 9.21


def test_a_red_thing_that_touches_the_mark_covers_nothing_and_the_body_measures_on(tmp_path, rig_for):
    look = Look()
    beside = 6.0  # degrees above rest, where the mark passes the thing

    def place(frames, mouths):
        x, y = look.mouth(np.array([beside]))[0].round().astype(int)
        for frame in frames:
            cv2.rectangle(frame, (x + 22, y - 4), (x + 40, y + 4), look.lips_rgb[::-1], -1)

    measured = measure_clip(open_film(_film(tmp_path, look, NOD.angle, edit=place)), rig_for(look), REST)
    assert measured.detections.status.count("occluded") >= 2  # by the mark alone
    assert measured.series.ok.all()
    error, sigma = _errors(measured.series, NOD.angle)
    assert np.abs(error).max() < 0.02
    assert np.sqrt(np.mean((error / sigma) ** 2)) < 2.0
