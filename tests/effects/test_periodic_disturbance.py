"""Periodic disturbance: the prediction against SciPy's integration, and against the plant's frequency response."""

from __future__ import annotations

import math

import numpy as np

from anglecam.data.command import Command
from support.integrated import TIME, A, B, C, changes_nothing_at_its_null, integrated, largest_deg, predicted


def test_the_motion_equals_scipys():
    def rates(t, state, u):
        angle, rate = state
        return [rate, C * u - A * rate - B * angle + 6.0 * math.sin(math.tau * 1.7 * t + 0.4)]

    assert largest_deg(predicted("periodic_disturbance", 6.0, 1.7, 0.4) - integrated(rates)) < 2e-4


def test_once_settled_it_is_the_frequency_response():
    rate, quiet = math.tau * 2.3, Command(np.zeros(1), np.zeros(1))
    settled = np.imag(5.0 * np.exp(1j * (rate * TIME + 0.3)) / (B - rate**2 + 1j * A * rate))
    found = predicted("periodic_disturbance", 5.0, 2.3, 0.3, command=quiet)
    assert largest_deg((found - settled)[TIME > 2.0]) < 1e-4


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("periodic_disturbance")
