"""A free swing begins where it was released."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.data.record import record_from_series
from anglecam.data.series import AngleSeries
from anglecam.errors import InputError
from anglecam.identification.identify_records import identify_records
from anglecam.io.rig import Rig

HOLD, RATE_HZ = 1.0, 100.0


def _knee(noise_deg: float, seed: int) -> AngleSeries:
    """Return a leg that is held 60° from where it hangs, let go and swings at 0.9 Hz about an unknown angle."""
    time = np.arange(0.0, 9.0, 1.0 / RATE_HZ)
    natural, ratio = 2.0 * np.pi * 0.9, 0.12
    since = np.maximum(time - HOLD, 0.0)
    damped = natural * np.sqrt(1.0 - ratio**2)
    shape = np.cos(damped * since) + ratio * natural / damped * np.sin(damped * since)
    swing = 60.0 * np.exp(-ratio * natural * since) * shape - 35.0
    noise = np.random.default_rng(seed).normal(0.0, noise_deg, len(time))
    unknown = np.full(len(time), np.nan)
    return AngleSeries("knee", time, np.radians(swing + noise), unknown, ("ok",) * len(time))


@pytest.mark.parametrize("noise_deg", [0.01, 0.3, 1.0, 3.0])
def test_noise_of_the_hold_is_no_release(noise_deg):
    for seed in range(10):
        record = record_from_series(_knee(noise_deg, seed), None, zero_known=False)
        assert HOLD - 0.02 < record.time[0] < HOLD + 0.2


def test_a_swing_that_was_held_before_is_fitted_to_the_noise():
    record = record_from_series(_knee(1.0, 4), None, zero_known=False)
    model = identify_records([record], Rig(), "oe2")
    assert np.degrees(model.fit.rmse) == pytest.approx(1.0, rel=0.1)
    assert not model.doubts


def test_a_model_that_does_not_follow_the_motion_is_doubted_though_no_noise_is_stated():
    series = _knee(0.3, 4)
    faster = replace(series, angle=np.sin(2.0 * np.pi * (0.5 * series.time + 0.3 * series.time**2)))
    model = identify_records([record_from_series(faster, None, zero_known=False)], Rig(), "oe2")
    assert "lacks something" in model.doubts[0]


def test_a_model_that_held_out_recordings_contradict_is_doubted():
    fitted, other = (record_from_series(_knee(0.3, seed), None, zero_known=False) for seed in (4, 5))
    later = replace(other, angle=other.angle * np.linspace(1.0, 4.0, len(other.angle)))
    model = identify_records([fitted], Rig(), "oe2", held_out=[later])
    assert not identify_records([fitted], Rig(), "oe2", held_out=[other]).doubts
    assert any("held-out recordings" in doubt for doubt in model.doubts)
    exact = replace(model.fit, residuals=[np.zeros_like(residual) for residual in model.fit.residuals])
    assert any("fitted with 0°" in doubt for doubt in replace(model, fit=exact).doubts)
    nearly = replace(model.fit, residuals=[1e-3 * residual for residual in model.fit.residuals])
    within_noise = replace(
        model, fit=nearly, held_out=model.fit, fitted=(replace(fitted, sigma=0.0 * fitted.angle + 0.01),)
    )
    assert not within_noise.doubts


def _series(angle_deg: np.ndarray, rate_hz: float = 30.0) -> AngleSeries:
    count = len(angle_deg)
    return AngleSeries(
        "swing", np.arange(count) / rate_hz, np.radians(angle_deg), np.full(count, np.nan), ("ok",) * count
    )


@pytest.mark.parametrize("frames_a_period", [3.3, 6.0, 12.0, 15.0, 22.0])
def test_a_swing_with_few_frames_a_period_is_no_rest(frames_a_period):
    frames = np.arange(300)
    noise = np.random.default_rng(0).normal(0.0, 0.5, len(frames))
    angle = 30.0 * np.exp(-frames / 400.0) * np.cos(2.0 * np.pi * frames / frames_a_period) + noise
    assert len(record_from_series(_series(angle), None, zero_known=False).time) > 290


@pytest.mark.parametrize("frames", [40, 300, 3000])
def test_noise_about_a_rest_is_no_swing(frames):
    refused = 0
    for seed in range(50):
        noise = np.random.default_rng(seed).normal(0.0, 0.1, frames)
        try:
            record_from_series(_series(noise), None, zero_known=False)
        except InputError as problem:
            refused += "nothing moves" in str(problem)
    assert refused >= 49
