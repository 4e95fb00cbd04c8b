"""One-sided spring: the prediction against SciPy's integration of its equation."""

from __future__ import annotations

import math

import pytest

from support.integrated import A, B, C, changes_nothing_at_its_null, integrated, largest_deg, predicted


@pytest.mark.parametrize(("stiffness", "slack_deg"), [(200.0, 3.0), (-200.0, 2.0), (200.0, -4.0)])
def test_the_motion_equals_scipys(stiffness, slack_deg):
    slack = math.radians(slack_deg)

    def rates(_, state, u):
        angle, rate = state
        stretched = max(angle - slack, 0.0) if stiffness > 0.0 else min(angle - slack, 0.0)
        return [rate, C * u - A * rate - B * angle - abs(stiffness) * stretched]

    assert largest_deg(predicted("one_sided_spring", stiffness, slack) - integrated(rates)) < 2e-4


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("one_sided_spring")
