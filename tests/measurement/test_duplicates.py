"""Frames that repeat the one before are found by the motion, with any noise, and pauses of the mechanism are kept."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from anglecam.measurement.duplicates import duplicate_frames

NOISE = 1e-4
TIME = np.arange(90) / 30.0
SWING = 0.3 * np.cos(2 * np.pi * 0.7 * TIME + 0.5)


def _found(line, repeated=(), seed=0):
    noisy = line + NOISE * np.random.default_rng(seed).standard_normal(len(line))
    equal = np.isin(np.arange(len(line)), repeated)
    for i in np.flatnonzero(equal):
        noisy[i] = noisy[i - 1]
    return duplicate_frames(noisy, np.full(len(line), NOISE), equal)


def _shown(rows):
    line = SWING.copy()
    for i in rows:
        line[i] = line[i - 1]
    return line


def test_a_repeated_frame_with_fresh_noise_is_found_wherever_its_error_matters():
    rows = [11, 19, 27, 35, 43, 51, 59, 67, 75, 83]
    found = _found(_shown(rows))
    missed = set(rows) - set(found)
    assert set(found) <= set(rows)
    # at a turning point the repeated frame shows nearly what a new one would
    assert all(abs(SWING[i] - SWING[i - 1]) < 0.1 * np.abs(np.diff(SWING)).max() for i in missed)


def test_exactly_repeated_frames_are_found_at_turning_points_too():
    turning = int(np.argmin(SWING[:40]))
    rows = [20, turning, turning + 1, 60]
    assert _found(_shown(rows), rows) == sorted(rows)


def test_a_film_that_stops_and_catches_up_is_found_and_a_mechanism_that_stops_is_not():
    assert _found(_shown([30, 31, 32])) == [30, 31, 32]
    pause = np.concatenate([np.linspace(0.0, 0.5, 30), np.full(8, 0.5), np.linspace(0.5, 1.0, 30)])
    assert _found(pause) == []


def test_a_smooth_turning_point_and_a_rest_are_no_duplicates():
    assert _found(SWING) == []
    rest = np.concatenate([np.zeros(20), np.linspace(0.0, 0.5, 20)])
    assert _found(rest, repeated=range(1, 20)) == []


def _servo(rng):
    """Return the angle of a second-order servo that gets ten commands in three seconds, rad."""
    w, damping = rng.uniform(5, 40), rng.uniform(0.1, 1.0)
    command = np.repeat(rng.uniform(-0.3, 0.3, 10), 90)
    time = np.arange(len(command)) / 300.0
    return lsim(TransferFunction([w * w], [1.0, 2.0 * damping * w, w * w]), command, time)[1][::10]


def _fast_swing(rng):
    return 0.3 * np.cos(2 * np.pi * rng.uniform(0.2, 3.0) * TIME + rng.uniform(0, 2 * np.pi))


@pytest.mark.parametrize("motion", [_servo, _fast_swing])
def test_a_film_without_repeated_frames_has_none(motion):
    flagged = 0
    for seed in range(1000, 1060):
        rng = np.random.default_rng(seed)
        line, noise = motion(rng), 10.0 ** rng.uniform(-5.5, -2.5)
        noisy = line + noise * rng.standard_normal(len(line))
        flagged += len(duplicate_frames(noisy, np.full(len(line), noise), np.zeros(len(line), bool)))
    assert flagged <= 1  # of 5,400 frames
