"""Series, commands and rig files are read back as they were written, and faults are refused in one line."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from anglecam.data.command import Command
from anglecam.data.series import SERIES_COLUMNS as COLUMNS
from anglecam.data.series import AngleSeries
from anglecam.errors import InputError, RigError
from anglecam.io.command_csv import read_command
from anglecam.io.rig import Rig, RigKeypoints, read_rig
from anglecam.io.series_csv import read_series, write_series
from anglecam.io.session import find_measurable, read_session
from anglecam.measurement.derivatives import with_derivatives
from anglecam.workflow.session import measure_session
from support import broken


def _series(n: int = 30) -> AngleSeries:
    time = np.arange(n) / 30.0
    angle = np.radians(10.0 * np.sin(time))
    angle[4] = np.nan
    status = tuple("occluded" if i == 4 else "ok" for i in range(n))
    mouth = np.column_stack([400.0 + time, 200.0 - time])
    mouth[4] = np.nan
    pivot = np.where(np.isnan(mouth), np.nan, [200.0, 300.0])
    bounds = {r: np.where(np.isnan(angle), np.nan, np.arcsin(r / 220.0)) for r in (6.0, 8.0, 10.0)}
    sigma = np.where(np.isnan(angle), np.nan, np.radians(0.01))
    return with_derivatives(AngleSeries("clip", time, angle, sigma, status, angle + 0.1, mouth, pivot, bounds))


def test_a_series_reads_back_as_it_was_written(tmp_path):
    series = _series()
    path = tmp_path / "clip.angles.csv"
    write_series(series, path)
    back = read_series(path)
    assert back.name == "clip"
    assert back.status == series.status
    np.testing.assert_allclose(back.time, series.time, rtol=1e-8)
    np.testing.assert_allclose(back.angle, series.angle, atol=np.radians(1e-6))
    np.testing.assert_allclose(back.mark_px, series.mark_px, atol=1e-4)
    for name, values in vars(series.derivatives).items():
        np.testing.assert_allclose(getattr(back.derivatives, name), values, atol=np.radians(1e-6))


def test_columns_are_those_of_the_contract_and_an_unmeasured_row_is_empty(tmp_path):
    path = tmp_path / "clip.angles.csv"
    write_series(_series(), path)
    header, *rows = list(csv.reader(path.open()))
    assert tuple(header[: len(COLUMNS)]) == COLUMNS
    assert header[len(COLUMNS) :] == ["bound_8px_deg"]
    assert rows[4][0] == "4"
    assert rows[4][2:11] == [""] * 9
    assert rows[4][11] == "occluded"
    assert header[11:18] == [
        "status",
        "sigma_random_deg",
        "sigma_common_deg",
        "velocity_deg_s",
        "velocity_sigma_deg_s",
        "acceleration_deg_s2",
        "acceleration_sigma_deg_s2",
    ]
    assert rows[4][12:18] == [""] * 6
    assert float(rows[20][14]) == pytest.approx(10.0 * np.cos(20 / 30), abs=5.0 * float(rows[20][15]))
    assert float(rows[5][4]) == pytest.approx(np.degrees(np.arcsin(6 / 220)), abs=1e-4)


def test_a_bare_series_from_elsewhere_is_enough(tmp_path):
    path = tmp_path / "encoder.angles.csv"
    path.write_text("time_s,angle_deg,note\n0,1.5,a\n0.5,2.5,b\n1.0,,c\n1.5,3,d\n2.0,nan,e\n")
    series = read_series(path)
    assert list(series.ok) == [True, True, False, True, False]
    assert np.degrees(series.angle[1]) == pytest.approx(2.5)
    assert np.isnan(series.sigma).all()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty file"),
        ("time_s,angle\n0,1\n", "no column angle_deg"),
        ("time_s,angle_deg\n", "no rows"),
        ("time_s,angle_deg\n0,1\n1,two\n2,3\n", "line 3: angle_deg is 'two'"),
        ("time_s,angle_deg\n0,1\n2,1\n1,3\n", "times must increase"),
        ("time_s,angle_deg\n0,1\n2\n", "line 3 has 1 cells"),
        ("time_s,angle_deg\n0,inf\n1,1\n2,2\n", "not a number"),
    ],
)
def test_a_bad_series_is_one_line_with_file_and_cause(tmp_path, text, says):
    path = tmp_path / "bad.angles.csv"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_series(path)
    message = str(error.value)
    assert str(path) in message
    assert says in message
    assert "\n" not in message


def test_words_in_an_angle_column_are_refused(tmp_path):
    path = broken.angles_with_text(tmp_path)
    with pytest.raises(InputError, match="not a number"):
        read_series(path)


def test_a_command_is_held_until_its_next_row():
    command = Command(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.0, 0.3]))
    assert command.first_change() == 2.0
    assert list(command.at(np.array([-1.0, 1.999, 2.0, 9.0]))) == [0.0, 0.0, 0.3, 0.3]
    assert Command(np.array([0.0, 1.0]), np.array([0.1, 0.1])).first_change() is None


def test_bad_commands_are_one_line(tmp_path):
    for path in (broken.command_with_unreadable_rows(tmp_path, "a"), broken.command_backwards(tmp_path, "b")):
        with pytest.raises(InputError) as error:
            read_command(path)
        assert str(path) in str(error.value)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("moth: auto", "unknown key moth"),
        ("pivot: {near: [1, 2], marker: auto, radius: 3}", "unknown key pivot.radius"),
        ("mouth: {rgb: [1, 2, 300]}", "mouth.rgb"),
        ("mark: auto\nmouth: auto", "mark and mouth are two names of one key"),
        ("mark: {rgb: [1, 2, 3], at: [4, 5]}", "declare only one of them"),
        ("mark: {frame: 3}", "frame says in which frame at or box is"),
        ("mark: {box: [9, 5, 4, 8]}", "left < right"),
        ("mark: {at: [4, 5], frame: -1}", "mouth.frame"),
        ("pivot: {at: [1, 2], near: [1, 2]}", "declare only one of them"),
        ("pivot: {sigma_px: 2}", "sigma_px is the uncertainty of at"),
        ("facing: up", "facing"),
        ("pixel_error_px: [6, -1]", "pixel_error_px"),
        ("- a\n- b", "expected keys and values"),
        ("a: [1, 2", "not YAML"),
        ("neutral: .nan", "neutral"),
    ],
)
def test_a_bad_rig_file_names_its_key(tmp_path, text, says):
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    with pytest.raises(RigError) as error:
        read_rig(path)
    assert str(path) in str(error.value)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_one_bad_command_costs_its_recording_only(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.angles.csv").write_text("time_s,angle_deg\n0,1\n1,2\n2,3\n")
    broken.command_backwards(tmp_path, "b")
    session = read_session(tmp_path)
    assert [r.name for r in session.recordings] == ["a"]
    assert len(session.problems) == 1
    assert "b.command.csv" in str(session.problems[0])


def test_a_folder_without_recordings_is_refused_with_what_an_angles_file_is(tmp_path):
    (tmp_path / "angles.json").write_text("{}")
    with pytest.raises(RigError) as error:
        read_session(tmp_path)
    assert "no *.angles.csv (columns time_s,angle_deg: see docs/files.md) in it" in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_held_out_name_is_a_rig_error(tmp_path):
    (tmp_path / "a.angles.csv").write_text("time_s,angle_deg\n0,1\n1,2\n2,3\n")
    (tmp_path / "rig.yaml").write_text("held_out: [nowhere]")
    with pytest.raises(RigError, match="held_out names nowhere"):
        read_session(tmp_path)


def test_a_command_without_a_recording_is_noted(tmp_path):
    (tmp_path / "a.angles.csv").write_text("time_s,angle_deg\n0,1\n1,2\n2,3\n")
    (tmp_path / "b.command.csv").write_text("time_s,command_deg\n0,0\n")
    session = read_session(tmp_path)
    assert session.problems == ()
    assert "b.command.csv" in session.notes[0]


def test_a_declared_centre_of_mass_comes_with_every_recording(tmp_path):
    rows = "".join(f"{k / 30:.4f},{10 * np.sin(k / 5):.4f}\n" for k in range(60))
    (tmp_path / "swing.angles.csv").write_text("time_s,angle_deg\n" + rows)
    for declared, upright in (("{}", None), ("model: {gravity_deg: -30}", np.radians(-30.0))):
        (tmp_path / "rig.yaml").write_text(declared)
        (record,) = measure_session(read_session(tmp_path)).records
        assert record.mass_from_upright == upright


def test_unused_files_and_free_swings_are_noted(tmp_path):
    rows = "".join(f"{k / 30:.4f},{10 * np.sin(k / 5):.4f}\n" for k in range(60))
    (tmp_path / "swing.angles.csv").write_text("time_s,angle_deg\n" + rows)
    (tmp_path / "swing.commands.csv").write_text("time_s,command_deg\n0,0\n1,5\n")
    session = read_session(tmp_path)
    (unused,) = session.notes
    assert "swing.commands.csv: not used; a command is NAME.command.csv" in unused
    assert measure_session(session).notes == ("swing: no command that changes; treated as a free swing",)


def test_times_in_milliseconds_are_refused(tmp_path):
    rows = "".join(f"{k * 33.3:.1f},{10 * np.sin(k / 5):.4f}\n" for k in range(60))
    (tmp_path / "swing.angles.csv").write_text("time_s,angle_deg\n" + rows)
    measured = measure_session(read_session(tmp_path))
    assert not measured.records
    assert "33.3 s apart; are times in seconds?" in str(measured.problems[0])


def test_a_command_that_changes_after_the_recording_costs_that_recording(tmp_path):
    rows = "".join(f"{k / 30:.4f},{10 * np.sin(k / 5):.4f}\n" for k in range(60))
    for name in ("one", "two"):
        (tmp_path / f"{name}.angles.csv").write_text("time_s,angle_deg\n" + rows)
    (tmp_path / "one.command.csv").write_text("time_s,command_deg\n0,0\n500,10\n")  # milliseconds
    (tmp_path / "two.command.csv").write_text("time_s,command_deg\n0,0\n0.5,10\n")
    measured = measure_session(read_session(tmp_path))
    assert [record.name for record in measured.records] == ["two"]
    said = "one: its command first changes at 500 s, after the last measured frame at 1.967 s"
    assert [str(problem).partition(";")[0] for problem in measured.problems] == [said]


def test_mark_is_another_name_of_mouth_and_points_at_it(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text("mark: {at: [12, 30.5], frame: 7}\npivot: {at: [100, -300], sigma_px: 2}")
    rig = read_rig(path)
    assert rig.pointed_mark.as_box == (12.0, 30.5, 12.0, 30.5)
    assert rig.pointed_mark.frame == 7
    assert rig.pivot.expected == (100.0, -300.0)
    path.write_text("mark: {rgb: [40, 40, 40]}")
    assert read_rig(path).mark_rgb == (40, 40, 40)
    assert read_rig(path).pointed_mark is None


def test_tracks_replace_their_clip_if_the_rig_names_their_points(tmp_path):
    for name in ("a.avi", "b.avi"):
        (tmp_path / name).touch()
    head = "scorer,x,x,x\nbodyparts,nose,nose,nose\ncoords,x,y,likelihood\n"
    tracks = tmp_path / "aDLC_resnet50_labshuffle1_100.csv"
    tracks.write_text(head + "0,1,2,0.9\n")
    rig = Rig(marks=RigKeypoints(mouth="nose", pivot="neck"))
    assert find_measurable(tmp_path, rig) == ([tracks, tmp_path / "b.avi"], [])
    clips, (idle,) = find_measurable(tmp_path, Rig())
    assert [clip.name for clip in clips] == ["a.avi", "b.avi"]
    assert "not used; name its points with marks: {mouth: …, pivot: …} in rig.yaml" in idle
