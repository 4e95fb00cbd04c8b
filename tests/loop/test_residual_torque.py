"""The residual torque against torques that are known, and its uncertainty against noise."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.data.record import Record
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise
from anglecam.identification.slopes import Slopes
from anglecam.loop.residual_torque import estimate_residual_torque
from anglecam.models.plant import Plant
from support.series import noise

A, B = 26.0, 524.0
TIME = np.arange(0.0, 8.0, 1.0 / 30.0)
SIGMA = np.radians(0.02)


def _remainder(error, *, phi=0.0, time=TIME):
    """Return the torque that a fit leaves over whose model stands still and whose residual is ``error``."""
    record = Record("swing", time, error, None, False, np.full(len(time), np.nan))
    flat = Slopes(np.zeros((len(time), 3)), np.zeros((len(time), 3)), np.array([0, len(time)]))
    fit = Fit(Plant(), np.array([A, B, 508.0]), (np.zeros(3),), (error,), flat, phi, error)
    (left,) = estimate_residual_torque(fit, [record], Noise(SIGMA, phi, 0.0, "rest"))
    return left


def _response(time, torque, omega):
    """Return the steady angle that a torque ``torque``·sin(omega·t) makes."""
    gain = torque / ((B - omega**2) + 1j * A * omega)
    return np.imag(gain * np.exp(1j * omega * time))


@pytest.mark.parametrize("omega", [2.0, 8.0])
def test_a_hidden_torque_is_estimated_within_a_tenth(omega):
    rng = np.random.default_rng(1)
    left = _remainder(_response(TIME, 3.0, omega) + noise(rng, len(TIME), SIGMA))
    off = left.torque - 3.0 * np.sin(omega * left.time)
    assert np.sqrt(np.mean(off**2)) < 0.1 * 3.0 / np.sqrt(2.0)


@pytest.mark.parametrize("phi", [0.0, 0.6])
def test_noise_alone_gives_as_much_torque_as_its_sigma_states(phi):
    rng = np.random.default_rng(2)
    ratios = []
    for _ in range(10):
        left = _remainder(noise(rng, len(TIME), SIGMA, phi), phi=phi)
        ratios.append(left.torque / left.sigma)
    # long stretches: few torques of a recording are independent
    assert np.sqrt(np.mean(np.concatenate(ratios) ** 2)) == pytest.approx(1.0, abs=0.15)


def test_lost_frames_do_not_bias_the_torque():
    rng = np.random.default_rng(3)
    time = np.delete(TIME, rng.choice(len(TIME), 40, replace=False))
    left = _remainder(_response(time, 3.0, 2.0) + noise(rng, len(time), SIGMA), time=time)
    off = left.torque - 3.0 * np.sin(2.0 * left.time)
    assert np.sqrt(np.mean(off**2)) < 0.1 * 3.0 / np.sqrt(2.0)
