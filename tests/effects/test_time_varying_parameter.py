"""Time-varying damping: the prediction against SciPy's integration, linear and settling."""

from __future__ import annotations

import math

import pytest

from support.integrated import A, B, C, changes_nothing_at_its_null, integrated, largest_deg, predicted


@pytest.mark.parametrize(("rate", "settling"), [(-0.15, None), (0.2, None), (-0.4, 1.5)])
def test_the_motion_equals_scipys(rate, settling):
    def rates(t, state, u):
        grown = rate * (t if settling is None else settling * (1.0 - math.exp(-t / settling)))
        return [state[1], C * u - A * (1.0 + grown) * state[1] - B * state[0]]

    inverse = 0.0 if settling is None else 1.0 / settling
    assert largest_deg(predicted("time_varying_parameter", rate, inverse) - integrated(rates)) < 2e-4


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("time_varying_parameter")
