"""End stops: the prediction against SciPy's integration of its equation, on one side and on both."""

from __future__ import annotations

import math

import pytest

from support.integrated import A, B, C, changes_nothing_at_its_null, integrated, largest_deg, predicted

STIFFNESS, CHI = 8000.0, 0.3
CONTACT_DEG = 2e-3
"""A step of 2 ms in which the body meets the stop is of second order: see the effect's module."""


@pytest.mark.parametrize("sides", [(9.0, -8.0), (9.0, None), (None, -8.0)])
def test_the_motion_equals_scipys(sides):
    upper, lower = (None if side is None else math.radians(side) for side in sides)

    def rates(_, state, u):
        angle, rate = state
        torque = 0.0
        if upper is not None and angle > upper:
            torque = -STIFFNESS * (angle - upper) * max(1.0 + CHI * rate, 0.0)
        if lower is not None and angle < lower:
            torque = STIFFNESS * (lower - angle) * max(1.0 - CHI * rate, 0.0)
        return [rate, C * u - A * rate - B * angle + torque]

    found = predicted("end_stop", STIFFNESS, *(0.0 if side is None else 1.0 / side for side in (upper, lower)), CHI)
    assert largest_deg(found - integrated(rates)) < CONTACT_DEG


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("end_stop")
