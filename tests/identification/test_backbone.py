"""Period and decay of free swings over the amplitude agree with theory, as far as their uncertainties say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.identification.backbone import backbones

STIFFNESS, DAMPING, NOISE = 64.0, 0.1, np.radians(0.1)


def swing(rates, *, rate=30.0, seconds=20.0, seed=0, name="swing"):
    time = np.arange(0.0, seconds, 1.0 / rate)
    angle = solve_ivp(rates, (0.0, time[-1]), [1.0, 0.0], t_eval=time, rtol=1e-10, atol=1e-12).y[0]
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(time))
    return Record(name, time, 0.2 + angle + noise, None, zero_known=False, sigma=np.full(len(time), np.nan))


def pendulum(t, y):
    return [y[1], -DAMPING * y[1] - STIFFNESS * np.sin(y[0])]


def linear(t, y):
    return [y[1], -DAMPING * y[1] - STIFFNESS * y[0]]


def dry(t, y):
    return [y[1], -STIFFNESS * y[0] - 1.0 * np.tanh(1e3 * y[1])]


@pytest.mark.parametrize("rate", [15.0, 60.0])
def test_the_period_of_a_pendulum_is_the_elliptic_integral_of_its_amplitude(rate):
    standard = []
    for seed in range(5):
        (found,) = backbones([swing(pendulum, rate=rate, seed=seed)])
        true = 4.0 * ellipk(np.sin(0.5 * found.amplitude) ** 2) / np.sqrt(STIFFNESS)
        np.testing.assert_allclose(found.period, true, rtol=6e-3)
        standard.append((found.period - true) / found.period_sigma)
    assert np.ptp(np.degrees(found.amplitude)) > 30.0
    assert np.mean(np.abs(standard) < 1.96) > 0.9


def test_the_decay_of_a_linear_swing_is_its_damping_at_all_amplitudes():
    standard = []
    for seed in range(5):
        (found,) = backbones([swing(linear, seed=seed)])
        seen = np.isfinite(found.decay)
        assert seen.sum() == len(found.time) - 1
        standard.append((found.decay[seen] - DAMPING) / found.decay_sigma[seen])
    assert np.mean(np.abs(standard) < 1.96) > 0.9
    assert abs(np.mean(standard)) < 0.3


def test_dry_friction_takes_the_same_amplitude_away_in_each_cycle():
    (found,) = backbones([swing(dry, seconds=8.0)])
    lost = -np.diff(found.amplitude)
    np.testing.assert_allclose(lost, 4.0 * 1.0 / STIFFNESS, rtol=0.1)  # 4F/b
    assert found.decay[-2] > 1.5 * found.decay[0]


def test_windows_of_a_recording_are_put_together_and_commands_and_rests_have_no_cycles():
    whole = swing(linear)
    parts = [whole.between(0.0, 9.0), whole.between(9.0, 30.0)]
    (one,), (joined,) = backbones([whole]), backbones(parts)
    np.testing.assert_array_equal(one.period, joined.period)
    commanded = replace(whole, command=Command(np.array([0.0, 1.0]), np.array([0.0, 0.1])))
    still = replace(whole, angle=np.random.default_rng(0).normal(0.0, NOISE, len(whole.time)))
    assert backbones([commanded]) == backbones([still]) == []


def test_a_gap_takes_its_cycles_away_and_no_others():
    whole = swing(linear)
    kept = whole.only((whole.time < 5.0) | (whole.time > 5.5))
    (one,), (less,) = backbones([whole]), backbones([kept])
    assert len(one.time) - 2 <= len(less.time) < len(one.time)
    assert np.isnan(less.decay[:-1]).sum() == 1
