"""Where a residual sits is found, and a residual that is as large everywhere sits nowhere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from anglecam.data.record import Record
from anglecam.loop.seat import seats_of

SIGMA = 1e-3
TIME = np.arange(360) / 30.0


def _seats(seed, excess=lambda angle: np.zeros(len(angle))):
    """Return the seats of AR(1) noise with something on top, in four swings of different frequencies."""
    rng = np.random.default_rng(seed)
    records, residuals = [], []
    for frequency in (0.3, 0.4, 0.5, 0.6):
        path = 0.3 * np.sin(2.0 * np.pi * frequency * TIME) + 0.1 * np.sin(0.74 * np.pi * frequency * TIME)
        noise = 0.8 * SIGMA * lfilter([1.0], [1.0, -0.6], rng.standard_normal(len(TIME)))
        residuals.append(noise + excess(path))
        records.append(Record("swing", TIME, path + residuals[-1], None, False, np.full(len(TIME), np.nan)))
    return seats_of(records, residuals, SIGMA, rng)


def test_what_acts_near_one_angle_is_found_there():
    for seed in range(5):
        first, *_ = _seats(seed, lambda angle: 4.0 * SIGMA * (np.abs(angle - 0.15) < 0.04) * np.sin(20.0 * TIME))
        assert first.variable == "angle"
        assert first.start < 0.15 < first.stop
        assert first.share_of_excess > 0.3
        assert first.q_value <= 0.05


@pytest.mark.sweep
def test_noise_sits_nowhere():
    # 5 % of the sessions have a region by chance: more than 12 of 100 have a probability of 0.1 %
    assert sum(bool(_seats(seed)) for seed in range(100)) <= 12


def test_a_body_at_rest_has_no_regions():
    still = Record("rest", TIME, np.zeros(len(TIME)), None, False, np.full(len(TIME), np.nan))
    assert seats_of([still], [np.zeros(len(TIME))], 0.0, np.random.default_rng(0)) == ()
