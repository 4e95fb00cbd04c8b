"""What does not turn about a fixed pivot gets no angle, and too few measured frames are no success."""

from __future__ import annotations

import warnings
from dataclasses import replace

import cv2
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.rig import Rig, RigMark, RigPivot
from anglecam.measurement.clip import measure_clip
from anglecam.measurement.one_rigid_mark import why_not_rigid, why_two_alike
from anglecam.measurement.trust import why_few, why_unproven
from anglecam.video.open_film import open_film
from benchmarks.hostile import nothing_turns
from benchmarks.hostile.draw import write

SIZE = (240, 180)
TIME = np.arange(45) / 30.0
MIDDLE = np.array([120.0, 90.0])


def _film(folder, places, marker=None, other=None):
    """Draw a red ball at (n, 2) places, or two, before a wall with boxes; write it without loss."""
    rng = np.random.default_rng(1)
    wall = np.full((SIZE[1], SIZE[0], 3), (160, 170, 175), np.uint8)
    for x, y in rng.uniform((0, 0), SIZE, (9, 2)).astype(int):
        cv2.rectangle(wall, (x, y), (x + 25, y + 15), [rng.uniform(80, 200)] * 3, -1)
    if marker is not None:
        cv2.circle(wall, marker, 7, (30, 30, 30), -1, cv2.LINE_AA)
    path = folder / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), 30, SIZE)
    y, x = np.indices(wall.shape[:2])
    for balls in zip(*([places] if other is None else [places, other]), strict=True):
        cover = np.max([np.clip(9.5 - np.hypot(x - px, y - py), 0.0, 1.0) for px, py in balls], axis=0)[..., None]
        picture = wall + cover * (np.array((35, 30, 190)) - wall) + rng.normal(0.0, 2.0, wall.shape)
        writer.write(np.clip(picture.round(), 0, 255).astype(np.uint8))
    writer.release()
    return open_film(path)


def _swing(amplitude_deg, lever=70.0, pivot=(120.0, 30.0)):
    angle = np.radians(amplitude_deg) * np.sin(2 * np.pi * 0.9 * TIME)
    return np.array(pivot) + lever * np.column_stack([np.sin(angle), np.cos(angle)])


TURN = 2 * np.pi * TIME / 1.2
OTHERWISE = {
    "a cart on a rail beside a round thing": (MIDDLE + np.outer(np.sin(5 * TIME), (60.0, 5.0)), (60, 40)),
    "an ellipse": (MIDDLE + np.column_stack([80 * np.cos(TURN), 60 * np.sin(TURN)]), None),
    "a pendulum on a cart": (_swing(20.0) + np.outer(np.sin(3 * TIME + 1.0), (25.0, 0.0)), None),
    "at rest beside a round thing": (np.tile((170.0, 120.0), (len(TIME), 1)), (60, 60)),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.sweep if name == "an ellipse" else ()) for name in OTHERWISE]
)
def test_what_does_not_turn_about_a_fixed_pivot_is_one_line(tmp_path, name):
    places, marker = OTHERWISE[name]
    with pytest.raises(InputError) as error:
        measure_clip(_film(tmp_path, places, marker), Rig())
    assert "\n" not in str(error.value)
    assert "internal error" not in str(error.value)


def test_a_pendulum_is_measured(tmp_path):
    measured = measure_clip(_film(tmp_path, _swing(20.0)), Rig())
    found = np.degrees(measured.series.angle)
    truth = 20.0 * np.sin(2 * np.pi * 0.9 * TIME)
    assert measured.series.ok.all()
    assert measured.doubt is None
    assert np.std(found - truth) < 0.15


@pytest.mark.parametrize(
    "declared",
    [{}, pytest.param({"near": (120.0, 30.0)}, marks=pytest.mark.sweep), {"at": (120.0, 30.0), "sigma_px": 0.5}],
)
def test_a_swing_too_small_to_show_its_pivot_is_right_within_sigma_or_refused(tmp_path, declared):
    film = _film(tmp_path, _swing(2.5, lever=100.0), marker=(120, 30))
    truth = 2.5 * np.sin(2 * np.pi * 0.9 * TIME)
    cause, series = None, None
    try:
        series = measure_clip(film, Rig(pivot=RigPivot(**declared))).series
    except InputError as refused:
        cause = str(refused)
    if series is None:
        assert "declare it: pivot: {at: [x, y], sigma_px: s}" in cause
        assert not declared
        return
    error = np.degrees(series.angle) - truth
    error -= np.median(error)  # no neutral is declared
    assert np.sqrt(np.mean((error / np.degrees(series.sigma)) ** 2)) < 1.5
    assert np.std(error) < 0.1


SCREWS = [
    (screw, amplitude_deg) for screw in ((120, 60), (120, 45), (150, 30), (90, 40)) for amplitude_deg in (2.5, 4.0)
]
FEW = (((120, 60), 2.5),)


@pytest.mark.parametrize(
    ("screw", "amplitude_deg"), [pytest.param(*one, marks=() if one in FEW else pytest.mark.sweep) for one in SCREWS]
)
def test_a_screw_near_the_pivot_of_a_short_swing_makes_no_wrong_angle(tmp_path, screw, amplitude_deg):
    measured = measure_clip(_film(tmp_path, _swing(amplitude_deg, lever=100.0), marker=screw), Rig())
    error = np.degrees(measured.series.angle) - amplitude_deg * np.sin(2 * np.pi * 0.9 * TIME)
    error -= np.median(error)
    assert np.sqrt(np.mean((error / np.degrees(measured.series.sigma)) ** 2)) < 1.5


def test_few_measured_frames_are_counted_with_their_causes():
    status = ("ok",) * 9 + ("occluded",) * 6 + ("no_mouth",) * 5
    assert why_few(status, 0.45) is None
    message = why_few(status, 0.5)
    assert message is not None
    assert message.startswith(
        "only 9 of 20 frames are measured (what is seen looks otherwise in 6, nothing like it is seen in 5)"
    )


@pytest.mark.parametrize(("near", "px"), [((126.0, 36.0), None), ((280.0, 70.0), 165)])
def test_a_hint_away_from_the_point_that_the_motion_shows_is_said_and_measured(tmp_path, near, px):
    measured = measure_clip(_film(tmp_path, _swing(40.0)), Rig(pivot=RigPivot(near=near)))
    said = [note for note in measured.notes if "from the hint pivot" in note]
    assert measured.doubt is None
    assert np.hypot(*(measured.angles.pivot.centre_px - [120.0, 30.0])) < 3.0
    assert [f"{px} px from the hint" in note for note in said] == ([] if px is None else [True])


@pytest.fixture(scope="module")
def far(tmp_path_factory):
    """Measure a swing of ±40°."""
    return measure_clip(_film(tmp_path_factory.mktemp("far"), _swing(40.0)), Rig())


@pytest.mark.parametrize(("covered", "doubted"), [(0.02, False), (0.2, True)])
def test_a_mark_that_is_seen_in_part_is_no_success(far, covered, doubted):
    found = far
    assert found.doubt is None
    half = np.arange(len(TIME)) < covered * len(TIME)
    regions = tuple(
        replace(region, moments_px2=region.moments_px2 / 4.0) if part else region
        for region, part in zip(found.detections.regions, half, strict=True)
    )
    message = why_not_rigid(replace(found.detections, regions=regions), found.series.ok)
    assert (message is not None) == doubted


@pytest.mark.parametrize(("amplitude_deg", "doubted"), [(2.0, True), (40.0, False)])
def test_what_is_not_clearly_the_mark_has_to_show_that_it_turns_about_the_pivot(tmp_path, amplitude_deg, doubted):
    rig = Rig(pivot=RigPivot(near=(120.0, 30.0)))
    found = measure_clip(_film(tmp_path, _swing(amplitude_deg, lever=100.0)), rig)
    assert found.doubt is None
    message = why_unproven(replace(found.detections, clear=False), hand_held=False)
    assert (message is not None) == doubted


def test_a_thing_of_the_declared_colour_that_hardly_moves_is_pointed_out(tmp_path):
    rig = Rig(mark=RigMark(rgb=(190, 30, 35)), pivot=RigPivot(near=(120.0, 30.0)))
    few, far = (measure_clip(_film(tmp_path, _swing(a, lever=100.0)), rig).notes for a in (2.0, 40.0))
    assert any("too little to show that it turns about the pivot: is it the mark?" in note for note in few)
    assert not any("is it the mark?" in note for note in far)


def test_a_mark_that_is_pointed_at_in_the_first_frame_is_looked_at_once(tmp_path):
    x, y = _swing(30.0)[0]
    rig = Rig(mark=RigMark(box=(x - 8.0, y - 8.0, x + 8.0, y + 8.0), frame=0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = measure_clip(_film(tmp_path, _swing(30.0)), rig)
    assert found.doubt is None
    assert len(found.series.ok) == len(TIME)


def _assert_turns(measured, turn):
    """Assert that a film shows a motion (n,), rad, clockwise as seen; zero is free."""
    error = np.degrees(np.angle(np.exp(1j * (measured.series.angle + turn))))[measured.series.ok]
    assert measured.series.ok.mean() > 0.9
    assert np.sqrt(((error - np.median(error)) ** 2).mean()) < 0.3


def test_two_marks_that_are_alike_and_turn_together_are_measured_as_one_body(tmp_path):
    arm = 50.0 * np.column_stack([np.cos(TURN), np.sin(TURN)])
    measured = measure_clip(_film(tmp_path, MIDDLE + arm, other=MIDDLE - arm), Rig())
    assert measured.by == "body"
    _assert_turns(measured, TURN)


def test_frames_in_which_two_things_may_be_the_mark_are_refused_if_they_are_many():
    assert why_two_alike(("ok",) * 41 + ("ambiguous",) * 4) is None
    assert "in 15 of 45 frames two things may be the mark" in why_two_alike(("ok",) * 30 + ("ambiguous",) * 15)


@pytest.mark.sweep  # a case of what does not turn about a fixed pivot, of which `OTHERWISE` has shorter ones
def test_a_page_of_text_that_scrolls_is_refused(tmp_path):
    # its lines are alike, and the places at which one or another is seen lie near a large circle
    (text,) = (film for film in nothing_turns.films() if film.name == "scrolling-text")
    with pytest.raises(InputError):
        measure_clip(open_film(write(text, tmp_path)), Rig())


def test_of_two_like_balls_on_a_beam_that_are_hidden_in_turn_none_is_measured(tmp_path):
    angle = np.radians(25.0) * np.sin(2 * np.pi * 0.9 * TIME)
    arm = 60.0 * np.column_stack([np.cos(angle), -np.sin(angle)])
    frame = np.arange(len(TIME))[:, None]
    one, other = np.where(frame < 25, MIDDLE + arm, -80.0), np.where(frame >= 20, MIDDLE - arm, -80.0)
    with pytest.raises(InputError, match="faster than it is ever seen to turn; another like part may be seen"):
        measure_clip(_film(tmp_path, one, other=other), Rig())
