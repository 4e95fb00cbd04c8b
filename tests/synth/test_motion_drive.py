"""The command's path to the load: controller, dead time, rate limit, play, lag."""

import math

import numpy as np
import pytest

from anglecam.neck import FourBar
from support.moved import spec_of
from synth.effects import PiecewiseLinear
from synth.effects.backlash import play
from synth.motion.controller import level_size
from synth.motion.drive import drive
from synth.motion.linkage import straight_gamma

ROWS = np.array([[0.0, 0.0], [0.5, 10.0], [0.6, 0.0], [1.5, 5.0]])
PULSED = {"pulse_hz": 50, "bits": 8}


def asked(rows: np.ndarray, effects: dict | None = None, controller: dict | None = None) -> PiecewiseLinear:
    return drive(rows, spec_of(effects or {}, controller=controller or {}))


def sampled(line: PiecewiseLinear, times: np.ndarray) -> np.ndarray:
    k = np.searchsorted(line.knots, times, side="right") - 1
    values = line.levels[k] + line.slopes[k] * (times - line.knots[k])
    return np.where(k >= 0, values, 0.0)


def test_the_rate_limit_continues_from_its_present_value_at_a_new_command():
    line = asked(ROWS, {"rate_limit": {"r_deg_per_s": 50.0}})
    np.testing.assert_allclose(line.knots, [0.0, 0.5, 0.6, 0.7, 1.5, 1.6])
    np.testing.assert_allclose(np.degrees(line.levels), [0, 0, 5, 0, 0, 5], atol=1e-12)
    np.testing.assert_allclose(np.degrees(line.slopes), [0, 50, -50, 0, 50, 0], atol=1e-12)


def test_dead_time_shifts_every_knot_and_nothing_else():
    line = asked(ROWS, {"dead_time": {"tau_s": 0.0437}})
    np.testing.assert_array_equal(line.knots, ROWS[:, 0] + 0.0437)
    np.testing.assert_array_equal(line.levels, np.radians(ROWS[:, 1]))


def test_play_equals_a_finely_stepped_play_operator():
    rng = np.random.default_rng(8)
    knots = np.sort(rng.choice(np.arange(1, 5000), 60, replace=False)) / 1000  # on the grid below
    slopes = rng.normal(0, math.radians(60), 60) * (rng.random(60) < 0.8)
    levels = np.cumsum(rng.normal(0, math.radians(2), 60))
    leader, half_width = PiecewiseLinear(knots, levels, slopes), math.radians(1.5)
    times = np.arange(0, 20001) / 4000
    follower, at = [], 0.0
    # the value just before each knot is needed too, because the line may turn there
    for time in times:
        for value in (sampled(leader, np.array([time - 1e-12]))[0], sampled(leader, np.array([time]))[0]):
            at = min(max(at, value - half_width), value + half_width)
        follower.append(at)
    np.testing.assert_allclose(sampled(play(leader, half_width), times), follower, atol=1e-9)


def test_play_loses_its_full_width_at_every_turn_of_a_ramped_triangle():
    rows = np.array([[0.0, 0.0], [0.5, 10.0], [1.5, -10.0], [3.0, 10.0]])
    line = asked(rows, {"rate_limit": {"r_deg_per_s": 40.0}, "backlash": {"half_width_deg": 1.0}})
    # starts in the middle: 1° to contact, 2° at each turn
    np.testing.assert_allclose(np.degrees(sampled(line, np.array([0.524, 0.75, 1.4]))), [0.0, 9.0, 9.0], atol=1e-9)
    np.testing.assert_allclose(np.degrees(sampled(line, np.array([1.549, 1.575, 2.9]))), [9.0, 8.0, -9.0], atol=1e-9)


def test_play_follows_a_jump_at_once_and_a_small_one_not_at_all():
    rows = np.array([[0.0, 0.0], [0.5, 0.9], [1.0, 10.0], [1.5, 8.1]])
    line = asked(rows, {"backlash": {"half_width_deg": 1.0}})
    np.testing.assert_allclose(np.degrees(line.levels), [0.0, 0.0, 9.0, 9.0], atol=1e-12)


def test_eight_bits_over_180_degrees_of_the_arm_are_a_quarter_of_a_degree_of_the_head():
    size = level_size(8, FourBar())
    assert math.degrees(size) == pytest.approx(0.357 * 180 / 255, abs=5e-4 * 180 / 255)
    assert straight_gamma(FourBar()) == pytest.approx(-0.357, abs=5e-4)
    levels = asked(np.array([[0.0, 0.0], [0.5, 10.0], [1.0, 10.3], [1.5, -7.77]]), controller={"bits": 8}).levels / size
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-9)
    np.testing.assert_allclose(levels * math.degrees(size), [0.0, 10.0, 10.3, -7.77], atol=math.degrees(size) / 2)
    assert asked(np.array([[0.0, 80.0]]), controller={"bits": 8}).levels[0] == pytest.approx(127 * size)


def test_a_command_waits_for_the_next_pulse_and_only_the_last_command_before_it_counts():
    rows = np.array([[0.0, 0.0], [0.5, 1.0], [0.7101, 2.0], [0.7199, 3.0], [0.741, 4.0]])
    line = asked(rows, controller={"pulse_hz": 50})
    np.testing.assert_allclose(line.knots, [0.0, 0.5, 0.72, 0.76], atol=1e-12)
    np.testing.assert_allclose(np.degrees(line.levels), [0.0, 1.0, 3.0, 4.0])
    shifted = asked(rows, controller={"pulse_hz": 50, "phase_s": 0.013})
    np.testing.assert_allclose(shifted.knots, [0.013, 0.513, 0.713, 0.733, 0.753], atol=1e-12)


def test_controller_dead_time_rate_limit_and_play_act_in_this_order():
    effects = {
        "dead_time": {"tau_s": 0.0437},
        "rate_limit": {"r_deg_per_s": 100.0},
        "backlash": {"half_width_deg": 0.5},
    }
    size = math.degrees(level_size(8, FourBar()))
    line = asked(np.array([[0.0, 0.0], [0.509, 10.0]]), effects, PULSED)
    level = round(10 / size) * size
    begins = 0.52 + 0.0437 + 0.005
    np.testing.assert_allclose(line.knots[-2:], [begins, 0.52 + 0.0437 + level / 100], atol=1e-12)
    np.testing.assert_allclose(np.degrees(line.levels[-1]), level - 0.5, atol=1e-9)


def test_the_lag_has_the_closed_form_of_a_ramp_through_a_first_order_system():
    line = PiecewiseLinear(np.array([0.0, 0.5]), np.array([0.0, 0.0]), np.array([0.0, 2.0]))
    v = line.lagged(0.05, 0.5, 0.3)
    t = 0.62
    assert v(t) == pytest.approx(2.0 * (t - 0.5 - 0.05) + (0.3 + 0.1) * math.exp(-(t - 0.5) / 0.05), abs=1e-14)
    later = line.lagged(0.05, 0.6, v(0.6))  # started later on the same line it gives the same values
    assert later(t) == pytest.approx(v(t), abs=1e-14)
