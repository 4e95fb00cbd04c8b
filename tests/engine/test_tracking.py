"""How much the gains of two poses say depends on the turn between them, as it was seen in held-out frames."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from anglecam.engine.tracking import log_odds


def _odds(shares: list[float], gains: tuple[float, float], away: float = np.pi, temper: float = 10.0) -> np.ndarray:
    """Return the log odds of two poses that are half a turn apart, where shares were seen at a turn of ``away``."""
    wrong = np.column_stack([np.full(len(shares), away), shares])
    search = SimpleNamespace(arm=60.0, temper=temper, wrong=wrong)
    return log_odds(search, np.array([0.3, 0.3 + np.pi]), np.array(gains))


def test_a_look_alike_is_as_probable_as_the_pose_that_gains_most():
    better, worse = _odds([-0.02, 0.01, 0.0, -0.01, 0.02], (5000.0, 4900.0))
    assert better == pytest.approx(worse)


def test_a_pose_that_always_gains_less_is_improbable():
    better, worse = _odds([0.45, 0.5, 0.55, 0.5, 0.4], (5000.0, 2400.0))
    assert better - worse > 50.0


def test_the_odds_are_no_more_than_those_of_the_pixels():
    better, worse = _odds([0.5, 0.5, 0.5, 0.5], (5000.0, 2400.0), temper=100.0)
    assert better - worse == pytest.approx(26.0)


def test_a_turn_that_was_never_seen_has_the_odds_of_the_pixels():
    better, worse = _odds([0.0, 0.0, 0.0, 0.0], (5000.0, 4900.0), away=1.0)
    assert better - worse == pytest.approx(10.0)
