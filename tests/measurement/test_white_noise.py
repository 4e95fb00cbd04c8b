"""White noise on a smooth motion is found from the angles alone, and motion is not taken for it."""

import numpy as np
import pytest

from anglecam.measurement.sigma import Sigma
from anglecam.measurement.white_noise import beyond_stated, white_noise

NOISE = 1e-4
"""rad."""


def _swing(time):
    return 0.3 * np.exp(-0.2 * time) * np.sin(2.0 * time)


def _kinked(time):
    """Return the motion under torques that jump four times a second."""
    jumps = np.arange(0.0, time[-1], 0.25)
    sizes = 20.0 * np.random.default_rng(3).choice([-1.0, 1.0], len(jumps))
    return (0.5 * sizes * np.maximum(time[:, None] - jumps, 0.0) ** 2).sum(axis=1)


@pytest.mark.parametrize("rate", [15, 30, 60])
def test_noise_is_found_whatever_the_frame_rate(rate):
    found = []
    for seed in range(20):
        time = np.arange(150) / rate
        found.append(white_noise(time, _swing(time) + NOISE * np.random.default_rng(seed).standard_normal(150)))
    assert np.median(found) == pytest.approx(NOISE, rel=0.1)


@pytest.mark.parametrize("motion", [_swing, _kinked, lambda time: np.sin(2.0 * np.pi * time) * 0.5])
def test_a_motion_without_noise_shows_none(motion):
    time = np.arange(240) / 30
    assert white_noise(time, motion(time)) < 0.01 * NOISE


@pytest.mark.parametrize("rounded", [False, True])
def test_an_uneven_rate_and_rounded_times_are_no_noise(rounded):
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(0.8, 1.2, 200)) / 30 if not rounded else np.arange(200) / 30
    angle = 3.0 * time + NOISE * rng.standard_normal(200)  # 1 ms is 3 mrad, or 30 times the noise
    stamps = np.round(time, 3) if rounded else time
    assert white_noise(stamps, angle) == pytest.approx(NOISE, rel=0.3)


def test_frames_after_a_gap_are_no_neighbours():
    rng = np.random.default_rng(6)
    time = np.delete(np.arange(200) / 30, np.arange(20, 200, 40))
    angle = np.sin(2.0 * time) + NOISE * rng.standard_normal(len(time))
    assert white_noise(time, angle) == pytest.approx(NOISE, rel=0.3)


@pytest.mark.parametrize("time", [np.arange(30) / 30, np.delete(np.arange(120) / 30, np.arange(5, 120, 6))])
def test_too_few_frames_in_a_row_show_no_noise(time):
    assert white_noise(time, np.random.default_rng(7).standard_normal(len(time))) == 0.0


def test_only_the_scatter_beyond_what_is_stated_is_added():
    time = np.arange(10_000) / 30
    angle = _swing(time) + NOISE * np.random.default_rng(8).standard_normal(10_000)
    by_noise, by_pose, common = (np.full(10_000, part * NOISE) for part in (0.6, 0.0, 3.0))
    assert beyond_stated(Sigma(by_noise, by_pose, common), time, angle) == pytest.approx(0.8 * NOISE, rel=0.1)
    assert beyond_stated(Sigma(2.0 * by_noise, by_pose, common), time, angle) == 0.0
