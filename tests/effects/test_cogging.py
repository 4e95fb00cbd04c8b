"""Cogging: the prediction against SciPy's integration of its equation."""

from __future__ import annotations

import math

from support.integrated import A, B, C, changes_nothing_at_its_null, integrated, largest_deg, predicted


def test_the_motion_equals_scipys():
    def rates(_, state, u):
        angle, rate = state
        return [rate, C * u - A * rate - B * angle + 6.0 * math.sin(60.0 * angle + 0.4)]

    def even(_, state, u):
        return [state[1], C * u - A * state[1] - B * state[0]]

    expected = integrated(rates)
    assert largest_deg(predicted("cogging", 6.0, 60.0, 0.4) - expected) < 2e-4
    assert largest_deg(expected - integrated(even)) > 0.3


def test_the_starts_are_the_waves_of_the_residual():
    from anglecam.effects import effect
    from support.starts import SEEN

    numbers = [start[1] for start in effect("cogging").starts(SEEN)]
    assert len(numbers) == len(set(numbers)) == 4


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("cogging")
