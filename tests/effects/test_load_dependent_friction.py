"""Load-dependent friction: the prediction against SciPy's integration from standstill to standstill."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from anglecam.data.command import Command
from anglecam.effects import effect
from anglecam.models.plant import Plant
from support.integrated import COMMAND, TIME, A, B, C, changes_nothing_at_its_null, largest_deg, predicted

SLOW = Command(
    np.array([0.0, *np.arange(0.5, 4.0, 0.02)]), 0.25 * np.sin(1.6 * np.array([0.0, *np.arange(0.0, 3.5, 0.02)]))
)
EVENT_DEG = 2e-3
"""An instant of sticking is located to within a step, in which the torque is taken at both ends only."""


def reference(command, friction, share):
    """Integrate from switch to switch of the command and from standstill to standstill."""
    state, angles = np.zeros(2), np.empty(len(TIME))

    def torques(angle, u):
        torque = C * u - B * angle
        return torque, friction * abs(torque + share * B * angle)

    for (now, until), u in zip(pairwise([*command.time, TIME[-1] + 1e-9]), command.angle, strict=True):
        while now < until:
            torque, level = torques(state[0], u)
            if state[1] == 0.0 and abs(torque) <= level:
                angles[(now <= TIME) & (until >= TIME)] = state[0]
                break
            sense = np.sign(state[1] or torque)

            def rates(_, x, u=u, sense=sense):
                torque, level = torques(x[0], u)
                return [x[1], torque - A * x[1] - sense * level]

            def stands(_, x, sense=sense):
                return sense * x[1]

            stands.terminal, stands.direction = True, -1.0
            run = solve_ivp(
                rates, (now, until), state, "DOP853", events=stands, rtol=1e-10, atol=1e-12, max_step=2e-3,
                dense_output=True,
            )  # fmt: skip
            inside = (now <= TIME) & (run.t[-1] >= TIME)
            if inside.any():
                angles[inside] = run.sol(TIME[inside])[0]
            now, state = run.t[-1], run.y[:, -1].copy()
            if run.status == 1:
                state[1] = 0.0
    return angles


@pytest.mark.parametrize("command", [COMMAND, SLOW])
@pytest.mark.parametrize(("friction", "share"), [(0.15, 0.0), (0.15, 0.6), (0.4, 1.0)])
def test_the_motion_equals_scipys(friction, share, command):
    found = predicted("load_dependent_friction", friction, share, command=command)
    assert largest_deg(found - reference(command, friction, share)) < EVENT_DEG


def test_springs_make_it_stick_in_a_band_that_widens_with_the_angle():
    def still(share):
        angle = Plant((effect("load_dependent_friction"),)).run(
            np.array([A, B, C, 0.3, share]), np.arange(0.0, 4.0, 0.01), SLOW, np.zeros(2)
        )
        return np.mean(angle[60:, 1] == 0.0)

    assert still(0.0) == 0.0
    assert still(0.5) < still(1.0)


def test_it_adds_to_constant_friction():
    both = Plant((effect("coulomb_friction"), effect("load_dependent_friction")))
    parameters = np.array([A, B, C, 3.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    only = predicted("coulomb_friction", 3.0, 0.0, 0.0, 0.0)
    assert largest_deg(both.predict(parameters, TIME, COMMAND, np.zeros(2)) - only) < 1e-3  # in other steps
    parameters[-2] = 0.2
    assert largest_deg(both.predict(parameters, TIME, COMMAND, np.zeros(2)) - only) > 0.1


def test_at_its_null_it_is_the_base_model():
    assert changes_nothing_at_its_null("load_dependent_friction")
