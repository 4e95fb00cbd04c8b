"""Speed-dependent torque: the prediction against SciPy's integration of its equation."""

from __future__ import annotations

import math

import pytest

from support.integrated import A, B, C, changes_nothing_at_its_null, integrated, largest_deg, predicted


@pytest.mark.parametrize(("stall", "no_load"), [(60.0, math.radians(250.0)), (40.0, math.radians(120.0))])
def test_the_motion_equals_scipys(stall, no_load):
    def rates(_, state, u):
        angle, rate = state
        upper, lower = stall * max(1.0 - rate / no_load, 0.0), -stall * max(1.0 + rate / no_load, 0.0)
        return [rate, min(max(C * u - B * angle, lower), upper) - A * rate]

    assert largest_deg(predicted("speed_dependent_torque", 1.0 / stall, 1.0 / no_load) - integrated(rates)) < 2e-4


def test_while_the_limit_is_not_reached_it_is_the_base_model():
    assert largest_deg(predicted("speed_dependent_torque", 1e-4, 0.1) - predicted("dead_zone", 0.0)) < 1e-12


def test_at_an_unlimited_speed_it_is_a_torque_limit():
    fixed = predicted("torque_saturation", 1.0 / 60.0, 1.0)
    assert largest_deg(predicted("speed_dependent_torque", 1.0 / 60.0, 0.0) - fixed) < 1e-12


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("speed_dependent_torque")
