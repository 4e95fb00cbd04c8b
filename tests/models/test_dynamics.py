"""Effects with additional states, defined in this file only, against SciPy's integration of the same equations."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from anglecam.data.command import Command
from anglecam.effects import Effect, Parameter, effect, ports
from anglecam.models.added_acceleration import added_acceleration
from anglecam.models.plant import Plant

A, B, C = 26.0, 524.0, 508.0
TIME = np.arange(0.0, 5.0, 1 / 30)
COMMAND = Command(np.array([0.0, 0.51, 1.9, 3.2]), np.array([0.0, 0.3, -0.2, 0.05]))
RATIO, FREQUENCY, DAMPING = 0.3, 40.0, 3.0


@ports.dynamics
def _second_mass(time, theta, omega, v, abc, states, parameters, derivatives):
    """Return the reaction on the load of a mass at y on a spring and a damper."""
    push = parameters[1] ** 2 * (theta - states[0]) + parameters[2] * (omega - states[1])
    derivatives[0], derivatives[1] = states[1], push
    return -parameters[0] * push


@ports.initial
def _moves_along(theta, omega, v, abc, parameters, states):
    states[0], states[1] = theta, omega


@ports.dynamics
def _lagging_drive(time, theta, omega, v, abc, states, parameters, derivatives):
    """Replace the drive c·v by c·x with τ·ẋ = v − x."""
    derivatives[0] = (v - states[0]) / parameters[0]
    return abc[2] * (states[0] - v)


@ports.initial
def _settled(theta, omega, v, abc, parameters, states):
    states[0] = v


def _entry(effect_id, states, dynamics, initial, *parameters):
    return Effect(
        effect_id, "load", "", "", "", parameters, (), "", "", states=states, dynamics=dynamics, initial=initial
    )


EFFECT = _entry(
    "second_mass",
    2,
    _second_mass,
    _moves_along,
    Parameter("inertia_ratio", "μ", 0.0, 0.0, 1.0, (0.1,)),
    Parameter("frequency_per_s", "ω", 0.0, 0.0, 500.0, (40.0,)),
    Parameter("damping_per_s", "d", 0.0, 0.0, 500.0, (3.0,)),
)
LAGGING = _entry("drive_state", 1, _lagging_drive, _settled, Parameter("lag_s", "τ", 0.0, 0.0, 1.0, (0.05,)))


def second_mass(state, u, sign):
    theta, omega, y, speed = state
    push = FREQUENCY**2 * (theta - y) + DAMPING * (omega - speed)
    return C * u - A * omega - B * theta - RATIO * push - sign, push


def reference(first, friction=0.0):
    """Integrate load and second mass between switches and standstills; dry friction is F·sgn θ̇."""
    state, angles = np.array(first, dtype=float), np.empty(len(TIME))
    for now, until in pairwise([*COMMAND.time, TIME[-1] + 1e-9]):
        u = float(COMMAND.at(np.array([now]))[0])
        while now < until:
            torque = second_mass(state, u, 0.0)[0]
            stuck = friction > 0.0 and state[1] == 0.0 and abs(torque) <= friction
            direction = np.sign(state[1] or torque)

            def rate(_t, x, u=u, stuck=stuck, direction=direction):
                acceleration, push = second_mass(x, u, friction * direction)
                return [0.0, 0.0, x[3], push] if stuck else [x[1], acceleration, x[3], push]

            def ends(_t, x, u=u, stuck=stuck, direction=direction):
                return abs(second_mass(x, u, 0.0)[0]) - friction if stuck else direction * x[1]

            ends.terminal, ends.direction = friction > 0.0, (1.0 if stuck else -1.0)
            run = solve_ivp(rate, (now, until), state, "DOP853", events=ends, dense_output=True, rtol=1e-10, atol=1e-12)
            inside = (now <= TIME) & (run.t[-1] >= TIME)
            angles[inside] = run.sol(TIME[inside])[0]
            now, state = run.t[-1], run.y[:, -1].copy()
            if run.status == 1 and not stuck:
                state[1] = 0.0
            elif run.status == 1:  # just over the level that holds
                state[1] = 1e-12 * np.sign(second_mass(state, u, 0.0)[0])
    return angles


@pytest.mark.parametrize("first", [(0.0, 0.0), (0.1, 0.5)])
def test_a_second_mass_behind_a_spring_moves_the_load_as_scipy_integrates_it(first):
    plant = Plant((EFFECT,))
    predicted = plant.predict(np.array([A, B, C, RATIO, FREQUENCY, DAMPING]), TIME, COMMAND, np.array(first))
    assert np.degrees(predicted) == pytest.approx(np.degrees(reference([*first, *first])), abs=1e-4)
    without = Plant().predict(np.array([A, B, C]), TIME, COMMAND, np.array(first))
    assert np.max(np.abs(np.degrees(predicted - without))) > 1.0


def test_states_go_on_while_dry_friction_holds_the_load():
    plant = Plant((EFFECT, effect("coulomb_friction")))
    parameters = np.array([A, B, C, RATIO, FREQUENCY, DAMPING, 8.0, 0.0, 0.0, 0.0])
    predicted = plant.predict(parameters, TIME, COMMAND, np.zeros(2))
    assert np.degrees(predicted) == pytest.approx(np.degrees(reference(np.zeros(4), 8.0)), abs=2e-3)


def test_a_lag_as_a_state_equals_the_lag_in_closed_form():
    parameters, first = np.array([A, B, C, 0.05]), np.array([0.1, 0.5])
    stepped = Plant((LAGGING,)).predict(parameters, TIME, COMMAND, first)
    closed = Plant((effect("actuator_lag"),)).predict(parameters, TIME, COMMAND, first)
    assert np.degrees(stepped) == pytest.approx(np.degrees(closed), abs=1e-4)


def test_two_effects_with_states_act_together():
    parameters = np.array([A, B, C, RATIO, FREQUENCY, DAMPING])
    both = Plant((EFFECT, LAGGING))
    mixed = Plant((EFFECT, effect("actuator_lag")))
    first = np.array([0.1, 0.5])
    predicted = [p.predict(np.append(parameters, 0.05), TIME, COMMAND, first) for p in (both, mixed)]
    assert np.degrees(predicted[0]) == pytest.approx(np.degrees(predicted[1]), abs=1e-4)


def test_an_effect_at_its_null_changes_nothing():
    plant = Plant((EFFECT,))
    at_null = plant.predict(np.array([A, B, C, *EFFECT.null]), TIME, COMMAND, np.array([0.1, 0.5]))
    without = Plant((effect("dead_zone"),)).predict(np.array([A, B, C, 0.0]), TIME, COMMAND, np.array([0.1, 0.5]))
    assert at_null == pytest.approx(without, abs=1e-14)  # both in Runge-Kutta steps of one length


def test_the_acceleration_added_along_a_motion_is_that_of_the_equation():
    time = np.arange(0.0, 2.0, 1e-3)
    values = np.array([RATIO, FREQUENCY, DAMPING])
    plant = Plant((EFFECT,))
    motion = plant.run(np.array([A, B, C, *values]), time, COMMAND, np.array([0.1, 0.5]))
    added = added_acceleration(EFFECT, values, np.array([A, B, C]), time, motion[:, 0], COMMAND)
    left = np.gradient(motion[:, 1], time) - (C * COMMAND.at(time) - A * motion[:, 1] - B * motion[:, 0])
    away = np.min(np.abs(time[:, None] - COMMAND.time), axis=1) > 0.01  # not a difference quotient across a step
    away[-1] = False
    assert added[away] == pytest.approx(left[away], abs=0.02 * np.max(np.abs(left)))
