"""From tracks to angles: right, as sure as they say, timed by the clip beside them, through to the model."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import anglecam
from anglecam.cli import app as cli
from anglecam.data.command import Command
from anglecam.data.series import SERIES_COLUMNS as COLUMNS
from anglecam.errors import InputError, RigError
from anglecam.io.rig import Rig, RigCamera, RigKeypoints
from anglecam.io.session import read_session, recording_name
from anglecam.measurement.tracks import measure_tracks
from anglecam.workflow.clip import measure_source, open_source
from anglecam.workflow.session import loop_input, measure_session
from support.drawn import Look, Plant, Recording, draw_frames, write_clip
from support.encoded import encode
from support.motion import command_rows, move
from support.tracked import LEVER, PIVOT, SCORER, nod, write_deeplabcut, write_sleap

N = 360
TIME = np.arange(N) / 60.0
SWING = 14.0 * np.sin(2 * np.pi * 0.9 * (TIME - 1.0)) * (TIME > 1.0)
REST = Command(np.array([0.0, 1.0]), np.array([0.0, 0.1]))
MARKS = RigKeypoints(mouth="nose", pivot="neck", rate_hz=60.0)
RIG = Rig(marks=MARKS)


@pytest.fixture
def run(monkeypatch, capsys):
    """Return a function that calls anglecam as a user does and gives (exit status, standard output, standard error)."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["anglecam", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            cli.main()
        return (int(left.value.code or 0), *capsys.readouterr())

    return call


def _pulls(series, angle_deg) -> np.ndarray:
    return (np.degrees(series.angle) - angle_deg)[series.ok] / np.degrees(series.sigma)[series.ok]


def _over_seeds(folder, disturb, seeds=25):
    """Measure as many tracks as seeds, and give each one's RMS error in units of its sigma."""
    ratios, pivots = [], set()
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        points = disturb(nod(SWING, rng), rng)
        measured = measure_tracks(write_sleap(folder / "a.analysis.h5", points), RIG, REST)
        ratios.append(np.sqrt((_pulls(measured.series, SWING) ** 2).mean()))
        pivots.add(measured.pivot)
    return np.sqrt(np.mean(np.square(ratios))), pivots


@pytest.mark.parametrize("write", [write_deeplabcut, write_sleap])
@pytest.mark.parametrize("facing", ["right", "left"])
def test_angles_are_the_true_ones_for_either_program_and_facing(tmp_path, write, facing):
    points = nod(SWING, np.random.default_rng(1), sigma_px=0.1)
    if facing == "left":
        points[..., 0] = 640.0 - points[..., 0]
    series = measure_tracks(write(tmp_path / "a.h5", points), Rig(marks=MARKS, facing=facing), REST).series
    assert series.ok.all()
    error = np.degrees(series.angle) - SWING
    assert np.sqrt((error**2).mean()) < 1.3 * np.degrees(0.1 / LEVER)
    np.testing.assert_allclose(series.time, TIME)
    for radius in (6.0, 10.0):
        np.testing.assert_allclose(series.bounds[radius], np.arcsin(radius / LEVER), rtol=0.01)
    np.testing.assert_allclose(series.line, series.angle, atol=0.003)  # this head's neutral is the horizontal


def test_sigma_is_true_where_points_err_from_frame_to_frame(tmp_path):
    ratio, pivots = _over_seeds(tmp_path, lambda points, rng: points)
    assert pivots == {"neck, fixed"}
    assert 0.9 < ratio < 1.1


def test_sigma_is_true_where_part_of_the_error_stays_for_many_frames(tmp_path):
    def linger(points, rng):
        return points + 0.4 * np.repeat(rng.standard_normal((N // 12, 2, 2)), 12, axis=0) * [[[1.0], [0.0]]]

    ratio, _ = _over_seeds(tmp_path, linger)
    assert 0.9 < ratio < 1.1


def test_a_pivot_that_moves_carries_the_angle_along(tmp_path):
    ratio, pivots = _over_seeds(
        tmp_path, lambda points, rng: points + 30.0 * np.column_stack([np.sin(TIME), np.cos(TIME)])[:, None]
    )
    assert pivots == {"neck, moving"}
    assert 0.9 < ratio < 1.1


def test_a_fixed_pivot_is_the_median_and_halves_the_variance(tmp_path):
    points = nod(SWING, np.random.default_rng(5))
    measured = measure_tracks(write_sleap(tmp_path / "a.h5", points), RIG, REST)
    np.testing.assert_allclose(measured.series.pivot_px, np.broadcast_to(PIVOT, (N, 2)), atol=0.1)
    error = np.degrees(measured.series.angle) - SWING
    own = np.unwrap(np.arctan2(*(points[:, 1] - points[:, 0]).T[::-1] * [[1.0], [-1.0]]))
    assert np.std(error) < 0.8 * np.std(np.degrees(own) - SWING)


def test_one_point_far_off_is_as_unsure_as_it_is_wrong(tmp_path):
    points = nod(SWING, np.random.default_rng(2))
    points[200, 0] += [25.0, 0.0]
    series = measure_tracks(write_sleap(tmp_path / "a.h5", points), RIG, REST).series
    assert np.degrees(series.sigma[200]) > 5.0
    assert np.degrees(np.median(series.sigma)) < 0.15


def test_missing_and_unlikely_points_leave_empty_rows_with_their_cause(tmp_path):
    points, likelihood = nod(SWING, np.random.default_rng(3)), np.full((N, 2), 0.95)
    points[10:13, 0] = np.nan
    likelihood[20:24, 0], likelihood[30:32, 1] = 0.3, 0.59
    path = write_deeplabcut(tmp_path / "a.csv", points, likelihood)
    series = measure_tracks(path, RIG, REST).series
    causes = {i: s for i, s in enumerate(series.status) if s != "ok"}
    no_mouth, no_pivot = (
        dict.fromkeys([*range(10, 13), *range(20, 24)], "no_mouth"),
        dict.fromkeys([30, 31], "no_pivot"),
    )
    assert causes == no_mouth | no_pivot
    for values in (series.angle, series.sigma, series.line, *series.mark_px.T, *series.pivot_px.T, series.bounds[6.0]):
        assert np.isnan(values[~series.ok]).all()
    assert np.abs(_pulls(series, SWING)).max() < 5.0
    lenient = Rig(marks=RigKeypoints(mouth="nose", pivot="neck", rate_hz=60.0, least_likelihood=0.2))
    assert measure_tracks(path, lenient, REST).series.ok.sum() == N - 3


def test_points_in_one_place_have_no_direction(tmp_path):
    points = nod(SWING, np.random.default_rng(3)) + 30.0 * np.sin(TIME)[:, None, None]
    points[50, 1] = points[50, 0]
    assert measure_tracks(write_sleap(tmp_path / "a.h5", points), RIG, REST).series.status[50] == "ambiguous"
    points[:, 1] = points[:, 0]
    with pytest.raises(InputError, match="nose and neck lie in the same place"):
        measure_tracks(write_sleap(tmp_path / "b.h5", points), RIG, REST)


def test_a_tilted_view_is_undone_for_tracks_too(tmp_path):
    tilt = np.radians(25.0)
    points = nod(SWING, np.random.default_rng(4), sigma_px=0.02)
    points[..., 1] = PIVOT[1] + (points[..., 1] - PIVOT[1]) * np.cos(tilt)
    path = write_sleap(tmp_path / "a.h5", points)
    plain = measure_tracks(path, RIG, REST).series
    undone = measure_tracks(path, Rig(marks=MARKS, camera=RigCamera(tilt_deg=25.0)), REST).series
    assert np.abs(np.degrees(plain.angle) - SWING).max() > 1.0
    assert np.abs(np.degrees(undone.angle) - SWING).max() < 0.05


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Draw a film of 40 frames at 30 Hz."""
    path = tmp_path_factory.mktemp("film") / "swing.avi"
    write_clip(path, draw_frames(Look(), np.zeros(40)))
    return path


def test_times_come_from_the_clip_beside_and_every_frame_of_it_has_its_row(clip):
    points = nod(np.linspace(0.0, 20.0, 36), np.random.default_rng(0))
    path = write_deeplabcut(clip.with_name(f"swing{SCORER}.h5"), points)
    source = open_source(path, RIG)  # RIG declares 60 Hz; the clip's time stamps are used
    measured = measure_source(source)
    path.unlink()
    assert source.film.path == clip
    assert measured.series.name == "swing"
    np.testing.assert_allclose(measured.series.time, np.arange(40) / 30.0, atol=1e-9)
    assert measured.series.evidence.picture_px == (640, 480)
    assert measured.series.status == ("ok",) * 36 + ("no_mouth",) * 4


@pytest.mark.parametrize("has_clip", [True, False])
def test_a_range_of_frames_is_that_of_the_tracks(clip, tmp_path, has_clip):
    angles = np.linspace(0.0, 20.0, 40)
    beside = clip if has_clip else tmp_path / "swing.avi"
    path = write_sleap(beside.with_name("swing.analysis.h5"), nod(angles, np.random.default_rng(0)))
    series = measure_source(open_source(path, RIG, (10, 29))).series
    path.unlink()
    assert series.first_frame == 10
    np.testing.assert_allclose(series.time, np.arange(10, 30) / (30.0 if has_clip else 60.0), atol=1e-9)
    np.testing.assert_allclose(np.diff(np.degrees(series.angle)).mean(), np.diff(angles).mean(), atol=0.05)


def test_points_found_in_stored_pixels_are_placed_in_the_shown_picture(tmp_path):
    blank = [np.zeros((480, 480, 3), np.uint8)] * N
    encode(tmp_path / "a.mp4", blank, rate_hz=60, aspect=Fraction(4, 3), options={"preset": "ultrafast"})
    points = nod(SWING, np.random.default_rng(0))
    points[..., 0] = (points[..., 0] + 0.5) * 0.75 - 0.5  # trackers see the pixels as they are stored
    series = measure_source(open_source(write_sleap(tmp_path / "a.analysis.h5", points), RIG)).series
    assert series.evidence.picture_px == (640, 480)
    off = np.degrees(series.angle) - SWING
    assert np.std(off) < 2.0 * np.degrees(np.median(series.sigma))  # ignoring the aspect costs 3°


def test_tracks_longer_than_the_clip_beside_are_not_of_it(clip):
    path = write_sleap(clip.with_name("swing.analysis.h5"), nod(np.zeros(41), np.random.default_rng(0)))
    with pytest.raises(InputError, match=r"41 frames, but swing\.avi has 40"):
        measure_source(open_source(path, RIG))
    path.unlink()


def test_without_clip_and_rate_or_with_too_few_points_or_without_marks_there_is_one_line(tmp_path):
    path = write_sleap(tmp_path / "a.analysis.h5", nod(SWING, np.random.default_rng(0)))
    with pytest.raises(InputError, match=r"its frames have no times: put the clip a\.… in the same folder"):
        measure_tracks(path, Rig(marks=RigKeypoints(mouth="nose", pivot="neck")))
    with pytest.raises(RigError, match="declare which of nose, neck are mark and pivot"):
        measure_tracks(path, Rig())
    with pytest.raises(InputError, match="no point mouth in it; it has nose, neck"):
        measure_tracks(path, Rig(marks=RigKeypoints(mouth="mouth", pivot="neck", rate_hz=60.0)))
    with pytest.raises(
        InputError, match=r"nose and neck are both present in only 0 of 360 frames \(likelihood at least 0"
    ):
        measure_tracks(path, Rig(marks=RigKeypoints(mouth="nose", pivot="neck", rate_hz=60.0, least_likelihood=0.9)))
    with pytest.raises(InputError, match="need the clip in the folder of the tracks"):
        measure_tracks(path, Rig(marks=MARKS, camera=RigCamera(row_time_s=1e-5)))


def test_the_name_is_the_longest_that_stands_beside(tmp_path):
    for name in ("nod", "nod-2"):
        (tmp_path / f"{name}.command.csv").write_text("time_s,command_deg\n0,0\n")
    assert recording_name(tmp_path / "nod-2_dlc.csv") == "nod-2"
    assert recording_name(tmp_path / "nod.tracks.h5") == "nod"
    assert recording_name(tmp_path / "nodding.h5") == "nodding"
    assert recording_name(tmp_path / "other.h5") == "other"


def _write_session(folder: Path, plant: Plant) -> dict[str, np.ndarray]:
    """Four recordings of a plant as tracks, half of DeepLabCut and half of SLEAP; their true angles."""
    rng = np.random.default_rng(7)
    kinds = ("steps", "stairs", "chirp", "random")
    truth = {}
    for i, kind in enumerate(kinds):
        recording = Recording(kind, kind, duration_s=6.0)
        rows, time = command_rows(recording, rng), np.arange(0.0, 6.0, 1.0 / 60.0)
        truth[kind] = move(plant, recording, time, rows)
        text = "".join(f"{t:.6f},{u:.6f}\n" for t, u in rows)
        (folder / f"{kind}.command.csv").write_text("time_s,command_deg\n" + text)
        points = nod(truth[kind], rng)
        if i % 2:
            write_deeplabcut(folder / f"{kind}{SCORER}{'.csv' if i == 1 else '.h5'}", points)
        else:
            write_sleap(folder / f"labels.v001.{i:03}_{kind}.analysis.h5", points)
    marks = "marks: {mouth: nose, pivot: neck, rate_hz: 60}\nheld_out: [random]\n"
    (folder / "rig.yaml").write_text(marks)
    return truth


def test_from_tracks_to_the_plant(tmp_path, run):
    session, out = tmp_path / "session", tmp_path / "out"
    session.mkdir()
    truth = _write_session(session, Plant())
    status, _, told = run("identify", session, "--out", out)
    assert (status, told) == (0, "")
    model = json.loads((out / "model.json").read_text())
    for name, true in {"a_per_s": 26.0, "b_per_s2": 524.0, "c_per_s2": 508.0}.items():
        found = model["parameters"][name]
        assert found["value"] == pytest.approx(true, rel=0.03)
        assert abs(found["value"] - true) < 4.0 * found["sigma"]
    assert model["rmse_deg"]["held_out"] == pytest.approx(np.degrees(0.3 / LEVER), rel=0.1)
    for name, true in truth.items():
        header, *rows = list(csv.reader((out / f"{name}.angles.csv").open()))
        assert tuple(header) == COLUMNS
        assert [float(row[2]) for row in rows] == pytest.approx(true, abs=0.6)
    assert anglecam.measure(session / f"random{SCORER}.h5").name == "random"


def test_the_loop_sees_tracks_as_they_are_measured_and_a_tilted_view_of_them_as_it_was_filmed(tmp_path):
    truth = _write_session(tmp_path, Plant())
    opened = read_session(tmp_path)
    measured = measure_session(opened)
    assert not loop_input(measured).differs
    tilted = replace(opened, rig=opened.rig.model_copy(update={"camera": RigCamera(tilt_deg=30.0)}))
    undone = measure_session(tilted)
    shown = loop_input(undone)
    assert shown.differs
    steps = [s.name for s in shown.series].index("steps")
    assert np.degrees(np.std(undone.series[steps].angle)) > 1.05 * np.std(truth["steps"])
    assert np.degrees(np.std(shown.series[steps].angle)) == pytest.approx(np.std(truth["steps"]), rel=0.01)


def test_what_is_wrong_with_one_file_of_tracks_costs_that_recording(tmp_path, run):
    session = tmp_path / "session"
    session.mkdir()
    _write_session(session, Plant())
    broken = session / f"random{SCORER}.h5"
    broken.write_bytes(broken.read_bytes()[:2000])
    write_deeplabcut(session / f"stairs{SCORER}_filtered.csv", nod(np.zeros(9), np.random.default_rng(0)))
    status, _, told = run("identify", session, "--estimator", "ekf", "--out", tmp_path / "out")
    assert status == 1
    note, problem = told.splitlines()
    assert note == f"{session / f'stairs{SCORER}_filtered.csv'}: not used; stairs{SCORER}.csv is the same recording"
    assert problem.startswith(f"{broken}: cannot be read as HDF5 (truncated file")
    assert (tmp_path / "out" / "model.json").exists()


def test_a_session_says_which_of_several_animals_was_followed(tmp_path, run):
    _write_session(tmp_path, Plant())
    points = np.full((300, 2, 2, 2), np.nan)
    points[:, 1], points[40:90, 0] = nod(np.zeros(300), np.random.default_rng(0)), 100.0
    path = write_sleap(tmp_path / "two.analysis.h5", points, tracks=("mia", "max"))
    status, said, told = run("identify", tmp_path, "--estimator", "ekf", "--out", tmp_path / "out")
    assert f"{path}: max is followed: it shows nose and neck most often (mia 50, max 300 frames)" in said
    assert (status, told) == (1, "two: no command, and nothing moves; there is no swing to fit\n")


def test_tracks_stand_in_the_clips_place_only_where_marks_are_declared(tmp_path, clip):
    (tmp_path / "swing.avi").write_bytes(clip.read_bytes())
    path = write_sleap(tmp_path / "swing.analysis.h5", nod(np.zeros(40), np.random.default_rng(0)))
    plain = read_session(tmp_path)
    assert [r.source.name for r in plain.recordings] == ["swing.avi"]
    assert "marks: {mouth: …, pivot: …} in rig.yaml" in plain.notes[0]
    (tmp_path / "rig.yaml").write_text("marks: {mouth: nose, pivot: neck}\n")
    declared = read_session(tmp_path)
    assert [(r.name, r.source) for r in declared.recordings] == [("swing", path)]
    assert declared.notes == ()
    (tmp_path / "swing.angles.csv").write_text("time_s,angle_deg\n0,1\n")
    assert read_session(tmp_path).recordings[0].is_series


def test_measure_takes_tracks_and_draws_on_the_clip_beside(tmp_path, clip, run):
    (tmp_path / "swing.avi").write_bytes(clip.read_bytes())
    path = write_sleap(tmp_path / "swing.analysis.h5", nod(np.linspace(0.0, 20.0, 40), np.random.default_rng(0)))
    alone = write_sleap(tmp_path / "alone.analysis.h5", nod(np.linspace(0.0, 20.0, 40), np.random.default_rng(0)))
    (tmp_path / "rig.yaml").write_text("marks: {mouth: nose, pivot: neck}\n")
    out = tmp_path / "out"
    status, said, told = run("measure", path, alone, "--overlay", "--out", out)
    assert status == 1
    assert told == (
        f"{alone}: its frames have no times: put the clip alone.… in the same folder, or declare marks:"
        " {rate_hz: …} in rig.yaml\n"
    )
    assert sorted(p.name for p in out.iterdir()) == ["swing.angles.csv", "swing.html", "swing.overlay.mp4", "swing.png"]
    assert "nose (SLEAP)" in said
    status, _, told = run("budget", path, "--out", out)
    assert (status, told) == (1, f"{path}: a budget needs the pictures; give the clip\n")


@pytest.mark.parametrize(
    ("declared", "told"),
    [
        ("{mouth: nose}", "marks.pivot: field required"),
        ("{mouth: nose, pivot: nose}", "marks: mouth and pivot are the same point"),
        ("{mouth: nose, pivot: neck, rate: 30}", "unknown key marks.rate"),
        ("{mouth: nose, pivot: neck, rate_hz: 0}", "marks.rate_hz: input should be greater than 0"),
        ("{mouth: nose, pivot: neck, least_likelihood: 2}", "marks.least_likelihood: input should be less than"),
    ],
)
def test_wrong_marks_are_exit_status_2_and_one_line(tmp_path, run, declared, told):
    write_sleap(tmp_path / "a.h5", nod(SWING, np.random.default_rng(0)))
    (tmp_path / "rig.yaml").write_text(f"marks: {declared}\n")
    status, _, line = run("measure", tmp_path / "a.h5", "--out", tmp_path / "out")
    assert status == 2
    assert line.startswith(f"{tmp_path / 'rig.yaml'}: {told}")
    assert line.count("\n") == 1
