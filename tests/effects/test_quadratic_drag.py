"""Quadratic drag: the prediction against scipy's integration of its equation."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from anglecam.data.command import Command
from anglecam.effects import effect
from anglecam.models.plant import Plant

A, B, C = 26.0, 524.0, 508.0
TIME = np.arange(0.0, 4.0, 1 / 30)
COMMAND = Command(np.array([0.0, 0.5, 1.5, 2.5]), np.radians([0.0, 15.0, -12.0, 20.0]))
INTEGRATION_DEG = {0.5: 2e-4, 5.0: 2e-4, 20.0: 1e-3}
"""Largest error of the integrator's steps of 6 ms, by drag in 1/rad: it grows with the torque's curvature."""


def predicted(drag):
    return Plant((effect("quadratic_drag"),)).predict(np.array([A, B, C, drag]), TIME, COMMAND, np.zeros(2))


def reference(drag):
    def rates(_, state, u):
        angle, rate = state
        return [rate, C * u - A * rate - B * angle - drag * rate * abs(rate)]

    state, angle = np.zeros(2), np.zeros(len(TIME))
    for (begin, end), u in zip(pairwise([*COMMAND.time, TIME[-1] + 1e-9]), COMMAND.angle, strict=True):
        motion = solve_ivp(rates, (begin, end), state, args=(u,), rtol=1e-10, atol=1e-12, dense_output=True)
        inside = (begin <= TIME) & (end > TIME)
        angle[inside] = motion.sol(TIME[inside])[0]
        state = motion.y[:, -1]
    return angle


@pytest.mark.parametrize("drag", INTEGRATION_DEG)
def test_the_motion_with_drag_equals_scipys(drag):
    expected = reference(drag)
    assert np.degrees(np.abs(predicted(drag) - expected)).max() < INTEGRATION_DEG[drag]
    assert np.degrees(np.abs(expected - reference(0.0))).max() > 100.0 * INTEGRATION_DEG[drag]


def test_the_steps_of_a_kinked_torque_are_short_enough_for_strong_drag():
    kinked = replace(effect("quadratic_drag"), kinked=True)
    found = Plant((kinked,)).predict(np.array([A, B, C, 20.0]), TIME, COMMAND, np.zeros(2))
    assert np.degrees(np.abs(found - reference(20.0))).max() < INTEGRATION_DEG[0.5]


def test_at_its_null_it_is_the_base_model():
    base = Plant().predict(np.array([A, B, C]), TIME, COMMAND, np.zeros(2))
    assert np.degrees(np.abs(predicted(effect("quadratic_drag").null[0]) - base)).max() < INTEGRATION_DEG[0.5]
