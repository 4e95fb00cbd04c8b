"""Elastic coupling: the prediction against SciPy's integration of both masses."""

from __future__ import annotations

import math

from support.integrated import A, B, C, changes_nothing_at_its_null, integrated, largest_deg, predicted


def test_the_motion_equals_scipys():
    share, rate, damping = 0.2, math.tau * 3.0, 0.05

    def rates(_, state, u):
        angle, speed, second, moving = state
        push = rate**2 * (angle - second) + 2.0 * damping * rate * (speed - moving)
        return [speed, C * u - A * speed - B * angle - share * push, moving, push]

    found = predicted("elastic_coupling", share, 3.0, damping)
    assert largest_deg(found - integrated(rates, (0.0, 0.0, 0.0, 0.0))) < 2e-4


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("elastic_coupling")
