"""The commands, and the human nod, which has no command."""

import math

import numpy as np
import pytest

from anglecam.neck import FourBar
from support.moved import COMMANDS, performed
from synth.motion import command_rows
from synth.motion.command import PAPER_SERIES_DEG
from synth.motion.linkage import transmission
from synth.motion.nod import nod
from synth.spec import Recording

COMMANDED = [kind for kind in COMMANDS if kind not in ("free", "nod")]


def rows_of(kind: str, duration_s: float = 4.0, seed: int = 3, **numbers) -> np.ndarray:
    command = {"kind": kind, **COMMANDS[kind], **numbers}
    recording = Recording.model_validate({"name": "x", "duration_s": duration_s, "command": command})
    rows = command_rows(recording, np.random.SeedSequence(seed))
    assert rows is not None
    return rows


@pytest.mark.parametrize("effect", [{}, {"coulomb_friction": {"torque": 5.0, "breakaway": 6.0}}])
@pytest.mark.parametrize("kind", [kind for kind in COMMANDED if kind != "paper_series"])
def test_every_command_starts_with_rest_and_keeps_within_its_amplitude(kind, effect):
    rows = rows_of(kind)
    assert tuple(rows[0]) == (0.0, 0.0)
    assert rows[1, 0] >= 0.5
    assert (np.diff(rows[:, 0]) > 0).all()
    assert rows[-1, 0] < 4.0
    assert np.abs(rows[:, 1]).max() <= 15.0
    angle = np.degrees(performed(effect, kind, 4.0).angle(np.linspace(0, 4, 121)))
    assert np.abs(angle[:15]).max() == 0.0
    assert 3.0 < np.abs(angle).max() < 25.0


@pytest.mark.parametrize("kind", ["free", "nod"])
def test_a_free_head_and_a_nod_have_no_command(kind):
    recording = Recording.model_validate({"name": "x", "duration_s": 2.0, "command": {"kind": kind}})
    assert command_rows(recording, np.random.SeedSequence(0)) is None


def test_the_papers_step_is_22_degrees_and_its_series_begins_with_it():
    np.testing.assert_array_equal(rows_of("step", amplitude_deg=22.0), [[0.0, 0.0], [0.71, 22.0]])
    rows = rows_of("paper_series", 20.0, tread_s=1.5)
    np.testing.assert_array_equal(rows[1:, 1], PAPER_SERIES_DEG)
    np.testing.assert_allclose(np.diff(rows[1:, 0]), 1.5, atol=1e-6)
    assert rows[1, 1] == 22.0


def test_the_papers_series_stays_within_the_linkage_with_the_overshoot_that_the_paper_measured():
    levels = np.array([0.0, *PAPER_SERIES_DEG])
    peaks = levels[1:] + 0.14 * np.diff(levels)
    low, high = np.degrees(transmission(FourBar()).reach)
    np.testing.assert_allclose([low, high], [-23.9, 31.1], atol=0.05)
    assert low + 2 < peaks.min() < 0 < peaks.max() < high - 2
    moved = np.degrees(performed({}, "paper_series", 9.0).angle(np.linspace(0, 9, 901)))
    assert low + 2 < moved.min() < moved.max() < high - 2


def test_a_chirp_sweeps_from_its_first_frequency_to_its_last():
    rows = rows_of("chirp", 10.71, amplitude_deg=8.0, from_hz=0.5, to_hz=2.0)
    since = rows[1:, 0] - 0.71 + 0.01  # the middle of each hold
    expected = 8.0 * np.sin(2 * math.pi * (0.5 * since + 1.5 / 10 * since**2 / 2))
    np.testing.assert_allclose(rows[1:, 1], expected, atol=1e-5)
    np.testing.assert_allclose(np.diff(rows[1:, 0]), 0.02, atol=2e-6)


def test_a_triangle_is_straight_between_its_corners():
    rows = rows_of("triangle", 4.71, amplitude_deg=10.0, period_s=4.0)
    corners = np.interp(rows[1:, 0] - 0.71 + 0.01, [0, 1, 3, 4], [0, 10, -10, 0])
    np.testing.assert_allclose(rows[1:, 1], corners, atol=1e-5)


def test_random_steps_follow_their_seed_and_their_bounds():
    np.testing.assert_array_equal(rows_of("random", 60.0, 5), rows_of("random", 60.0, 5))
    rows = rows_of("random", 60.0, 6, amplitude_deg=10.0, shortest_s=0.2, longest_s=0.9)
    assert not np.array_equal(rows[:3], rows_of("random", 60.0, 5)[:3])
    treads = np.diff(rows[1:, 0])
    assert 0.2 <= treads.min() < 0.3
    assert 0.8 < treads.max() <= 0.9
    assert -10 <= rows[:, 1].min() < -8
    assert 8 < rows[:, 1].max() <= 10


def test_a_nod_takes_0_3_s_for_70_degrees_without_overshoot_and_comes_back():
    motion = performed({"coulomb_friction": {"torque": 5.0}}, "nod")  # effects of the plant do not affect a nod
    times = np.linspace(0.0, 3.0, 30001)
    angle = np.degrees(motion.angle(times))
    rising, held, back = times >= 0.71, times >= 1.01, times >= 1.61
    assert np.abs(angle[~rising]).max() == 0.0
    np.testing.assert_allclose(angle[held & ~back], 70.0, atol=1e-9)
    assert angle.max() <= 70.0 + 1e-9
    assert angle.min() >= -1e-9
    np.testing.assert_allclose(angle[times >= 1.911], 0.0, atol=1e-9)
    assert (np.diff(angle[rising & ~held]) > 0).all()
    # minimum jerk has 1.875 times the mean speed in the middle, and 10/√3 of 70°/0.3² s as its largest acceleration
    speed = np.degrees(motion.speed(times))
    assert speed.max() == pytest.approx(1.875 * 70 / 0.3, rel=1e-6)
    assert speed.max() == pytest.approx(np.gradient(angle, times).max(), rel=1e-5)
    acceleration = np.gradient(speed, times)
    assert acceleration.max() == pytest.approx(10 / math.sqrt(3) * 70 / 0.09, rel=1e-3)


def test_no_smooth_motion_from_rest_to_rest_has_less_jerk_than_the_nod():
    times = np.linspace(0.0, 1.0, 4001)
    command = {"kind": "nod", "rise_deg": math.degrees(1.0), "rise_s": 1.0, "rest_s": 0.5}
    recording = Recording.model_validate({"name": "x", "duration_s": 3.0, "command": command})
    way = nod(recording.command, times + 0.5)[0]

    def jerk(path: np.ndarray) -> float:
        third = np.diff(path, 3) / np.diff(times)[0] ** 3
        return float(np.mean(third**2))

    assert jerk(way) == pytest.approx(720.0, rel=0.01)  # ∫ (60 − 360τ + 360τ²)² dτ
    for n in (1, 2, 3):
        # keeps angle, speed and acceleration at both ends
        bump = 0.05 * times**3 * (1 - times) ** 3 * np.cos(n * math.pi * times)
        assert jerk(way + bump) > jerk(way)
