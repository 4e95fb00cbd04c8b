"""Command curve: equal to the base model behind bent levels, and rising for any parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from anglecam.data.command import Command
from anglecam.effects import Knots, effect
from anglecam.models.plant import Plant
from support.integrated import COMMAND, TIME, A, B, C, changes_nothing_at_its_null, largest_deg, predicted

UNIT = math.radians(15.0)


def test_it_is_the_base_model_behind_the_integral_of_the_slope():
    p, q = 0.8, -3.0
    levels = [quad(lambda u: math.exp(p * u + q * u * u), 0.0, level)[0] for level in COMMAND.angle]
    base = Plant().predict(np.array([A, B, C]), TIME, Command(COMMAND.time, np.array(levels)), np.zeros(2))
    strength, shape = math.hypot(p * UNIT, q * UNIT**2), math.atan2(q * UNIT, p)
    found = predicted("command_curve", strength, shape)
    assert largest_deg(found - base) < 1e-9
    assert largest_deg(found - predicted("command_curve", 0.0, shape)) > 0.5


@pytest.mark.parametrize("shape", np.radians([0.0, 90.0, 135.0, 180.0, -90.0]))
def test_it_rises_everywhere(shape):
    level = np.radians(np.linspace(-30.0, 30.0, 121))
    time = np.arange(len(level), dtype=float)
    bent = effect("command_curve").command(Knots(time, level, np.zeros(len(level))), np.array([0.6, shape]))
    assert np.all(np.diff(bent.level) > 0.0)
    assert bent.level[60] == 0.0


def test_a_ramp_stays_a_ramp_between_its_bent_ends():
    given = Knots(np.array([0.0, 1.0]), np.array([0.0, 0.2]), np.array([0.2, 0.0]))
    bent = effect("command_curve").command(given, np.array([0.6, 0.5 * math.pi]))
    assert bent.level[0] + bent.slope[0] == pytest.approx(bent.level[1], rel=1e-12)


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("command_curve")
