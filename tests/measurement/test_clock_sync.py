"""A lamp that lights at the first command change ties the command's clock to the clip's."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import yaml

from anglecam.data.command import Command
from anglecam.effects import effect
from anglecam.errors import RigError
from anglecam.identification.noise import DISTANCE, Noise
from anglecam.identification.output_error import fit_output_error
from anglecam.identification.systematic import full_sigma
from anglecam.io.command_csv import read_command
from anglecam.io.rig import Rig, RigSync
from anglecam.io.session import read_session, rig_beside
from anglecam.measurement.clip import measure_clip
from anglecam.measurement.clock_sync import AGREED, offsets
from anglecam.models.plant import Plant
from anglecam.video.open_film import open_film
from anglecam.vision.image.lamp import lit_between
from anglecam.workflow.session import measure_session
from synth.session import render

RESTS = (0.81, 0.82, 0.83)
"""s until the command first changes: at another place between two frames in each clip."""
LATE = 0.2371
"""s by which the commands' clock is behind the clips': without the lamp the head would set off before its command."""
SPEC = {
    "seed": 4,
    "camera": {"size": [320, 240], "exposure_s": 0.01, "codec": "mjpeg"},
    "rig": {"lever_px": 100, "pivot_px": [120.3, 149.6]},
    "scene": {"lamp_px": [295, 20]},
    "declare": {"mouth": {"rgb": [190, 35, 40]}, "sync": {"lamp": [295, 20]}},
    "recordings": [
        {"name": f"steps-{k}", "duration_s": 2.0, "command": {"kind": "random", "amplitude_deg": 12, "rest_s": rest}}
        for k, rest in enumerate(RESTS)
    ],
}


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lamp")
    (folder / "spec.yaml").write_text(yaml.safe_dump(SPEC))
    render(folder / "spec.yaml", folder / "session", folder / "truth")
    return folder / "session"


@pytest.fixture(scope="module")
def agreeing(filmed):
    return measure_session(read_session(filmed))


@pytest.fixture(scope="module")
def late(filmed, tmp_path_factory):
    folder = tmp_path_factory.mktemp("late") / "session"
    shutil.copytree(filmed, folder)
    for path in folder.glob("*.command.csv"):
        command = read_command(path)
        rows = zip(command.time + LATE, np.degrees(command.angle), strict=True)
        path.write_text("time_s,command_deg\n" + "".join(f"{t:.6f},{u:.6f}\n" for t, u in rows))
    return folder


def test_a_lamp_that_agrees_with_the_command_changes_nothing(agreeing):
    assert not agreeing.notes
    for series, record, rest in zip(agreeing.series, agreeing.records, RESTS, strict=True):
        dark, lit = series.evidence.lamp_s
        assert dark < rest <= lit
        assert lit - dark < 0.07
        assert record.command.first_change() == pytest.approx(rest, abs=1e-6)
        assert record.clock_sigma == 0.0


def test_commands_by_another_clock_are_dated_by_the_lamps_of_all_clips_together(late, agreeing):
    measured = measure_session(read_session(late))
    assert len(measured.notes) == len(RESTS)
    assert "behind the command's" in measured.notes[0]
    sigma = measured.records[0].clock_sigma
    assert 0.0 < sigma < 1 / 30 / np.sqrt(12.0)  # better than one clip's lamp could tell
    for record, rest in zip(measured.records, RESTS, strict=True):
        assert abs(record.command.first_change() - rest) < np.sqrt(3.0) * sigma + 1e-6  # half of what was possible
    for series, same in zip(measured.series, agreeing.series, strict=True):
        np.testing.assert_allclose(series.angle, same.angle, atol=np.radians(1e-3))  # neutral is that of the true rest
    delayed = Plant().with_effect(effect("dead_time"))
    fit = fit_output_error(delayed, measured.records, [np.array([26.0, 524.0, 508.0, 0.0])])
    (tau,) = full_sigma(fit, measured.records, Noise(np.radians(0.001), 0.0, 0.1, DISTANCE))[3:]
    assert tau == pytest.approx(sigma, rel=0.2)
    assert abs(fit.parameters[3]) < 2.0 * tau


def test_a_clip_of_its_own_says_that_the_clocks_disagree(late):
    clip = late / "steps-0.avi"
    measurement = measure_clip(open_film(clip), rig_beside(clip), read_command(late / "steps-0.command.csv"))
    assert any("the command's times are corrected by it" in note for note in measurement.notes)


def test_a_lamp_that_stays_dark_is_missed_and_one_outside_the_picture_is_an_error(filmed):
    clip, command = filmed / "steps-0.avi", read_command(filmed / "steps-0.command.csv")
    dark = measure_clip(open_film(clip), Rig(sync=RigSync(lamp=(5.0, 235.0))), command)
    assert any("not seen to light" in note for note in dark.notes)
    with pytest.raises(RigError, match=r"sync: \{lamp: \[400, 20\]\} lies outside its picture of 320 × 240 pixels"):
        measure_clip(open_film(clip), Rig(sync=RigSync(lamp=(400.0, 20.0))), command)


def levels(*course):
    """Return a grey patch's three channels."""
    return np.repeat(np.array(course, float)[:, None], 3, axis=1)


TIME = np.arange(20) / 10.0


def test_a_frame_in_which_it_is_lit_in_part_tells_nothing_finer():
    course = [30.0] * 9 + [120.0] + [200.0] * 10
    assert lit_between(TIME, levels(*course)) == (0.8, 1.0)
    course[9] = 30.0
    assert lit_between(TIME, levels(*course)) == (0.9, 1.0)


def test_a_red_lamp_a_brief_one_and_one_behind_lost_frames_are_seen():
    red = levels(*[80.0] * 10, *[80.0] * 10)
    red[10:, 2], red[10:, :2] = 220.0, 40.0
    assert lit_between(TIME, red) == (0.9, 1.0)
    brief = levels(*[30.0] * 15, 200.0, 200.0, *[30.0] * 3)
    assert lit_between(TIME, brief) == (1.4, 1.5)
    lost = levels(*[30.0] * 10, *[200.0] * 10)
    lost[9:11] = np.nan
    assert lit_between(TIME, lost) == (0.8, 1.1)


@pytest.mark.parametrize(
    "course",
    [[200.0] * 20, [30.0] * 20, [30.0] * 10 + [45.0] * 10, [30.0, 90.0] * 10, [30.0] * 12 + [200.0] + [30.0] * 7],
)
def test_what_is_lit_always_never_hardly_or_flickers_is_no_lamp(course):
    assert lit_between(TIME, levels(*course)) is None


def test_clips_that_no_one_offset_suits_have_each_their_own():
    command = Command(np.array([0.0, 1.0]), np.array([0.0, 0.1]))
    commands = dict.fromkeys("abc", command)
    found = offsets(commands, {"a": (1.3, 1.4), "b": (0.9, 1.02), "c": None})
    assert found["a"].value == pytest.approx(0.35)
    assert found["a"].sigma == pytest.approx(0.1 / np.sqrt(12.0))
    assert found["b"] == found["c"] == AGREED
    together = offsets(commands, {"a": (1.3, 1.4), "b": (1.38, 1.5), "c": None})
    assert [one.value for one in together.values()] == pytest.approx([0.39, 0.39, 0.0])  # nothing is known of the last
