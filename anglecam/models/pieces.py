"""The effects of a plant inside its equation of motion, as the compiled integrator takes and evaluates them.

    θ̈ = servo(c·v − b·θ) − a·θ̇ + Σ load_i(t, θ, θ̇) + Σ dynamics_i(t, θ, θ̇, v, x_i) − dry friction

A *piece* is the function of one effect. The integrator gets the pieces of a plant and an array with all their
parameters. An effect that is not in the plant costs nothing.

Compiled functions take the plant as (abc, table, edges, numbers, rubs): pointers to a, b, c, to the table of the pieces
and to their parameters; where the pieces of each port begin; and whether there is dry friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.effects.ports import DYNAMICS, FRICTION, INITIAL, LOAD, MOST_PARAMETERS, SERVO, caller_of, shifted

PORTS = ("servo", "load", "friction", "dynamics")
"""Ports inside the equation of motion, in the order of the pieces."""
_SERVO, _LOAD, _FRICTION, _DYNAMICS, _END = range(5)
_FUNCTION, _INITIAL, _NUMBERS, _STATES, _COLUMNS = range(5)


@dataclass(frozen=True)
class Pieces:
    """The functions of a plant's effects, in the order in which they are evaluated."""

    ids: tuple[str, ...]
    """Effects of the pieces."""
    table: NDArray[np.int64]
    """(k, 4) for each piece the addresses of its function and of its initial states' function, 0 without one, the place
    of its first parameter among those of all pieces, and that of its first state among all states."""
    edges: NDArray[np.int64]
    """(5,) where the pieces of each of `PORTS` begin, and the end."""
    count: int
    """Number of parameters of all pieces: `MOST_PARAMETERS` for each effect, whose function may read so many."""
    states: int
    """Number of additional states."""

    def numbers(self, pairs: Sequence[tuple[Effect, Floats]]) -> Floats:
        """Return the (count,) parameters of all pieces, SI, zeros for those that an effect omits or lacks."""
        numbers = np.zeros(self.count)
        for effect, values in pairs:
            if effect.id in self.ids:
                first = self.table[self.ids.index(effect.id), _NUMBERS]
                numbers[first : first + len(values)] = values
        return numbers

    def with_torque(self, function: Any) -> Pieces:
        """Return the pieces and a torque without states, compiled for the port ``dynamics``, which is added last.

        Its parameters follow those of the effects.
        """
        row = np.array([[function.address, 0, self.count, self.states]])
        edges = self.edges + np.arange(_END + 1) // _END
        return Pieces(self.ids, np.vstack([self.table, row]), edges, self.count, self.states)


def pieces_of(effects: Sequence[Effect]) -> Pieces:
    """Return the pieces of a plant; effects at ports outside the equation of motion have none.

    Servo effects act in the order of their ranks, the others in that of their ids.
    """
    inside = [effect for effect in effects if effect.port in PORTS]
    inside.sort(key=lambda e: (PORTS.index(e.port), e.rank if e.port == "servo" else 0, e.id))
    states = np.array([e.states for e in inside], dtype=np.int64)
    table = np.zeros((len(inside), _COLUMNS), dtype=np.int64)
    for row, effect in zip(table, inside, strict=True):
        row[_FUNCTION] = getattr(effect, effect.port).address
        row[_INITIAL] = 0 if effect.initial is None else effect.initial.address
    table[:, _NUMBERS] = MOST_PARAMETERS * np.arange(len(inside))
    table[:, _STATES] = np.cumsum(states) - states
    edges = np.searchsorted([PORTS.index(e.port) for e in inside], np.arange(_END + 1)).astype(np.int64)
    return Pieces(tuple(e.id for e in inside), table, edges, MOST_PARAMETERS * len(inside), int(states.sum()))


@njit
def any_friction(table, edges, numbers):  # type: ignore[no-untyped-def]  # compiled
    """Return whether any parameter of a friction is not zero; otherwise there is none."""
    begin = table[edges[_FRICTION], _NUMBERS] if edges[_FRICTION] < edges[_END] else len(numbers)
    end = table[edges[_DYNAMICS], _NUMBERS] if edges[_DYNAMICS] < edges[_END] else len(numbers)
    return np.any(numbers[begin:end] != 0.0)


_call_servo, _call_load, _call_friction = caller_of(SERVO), caller_of(LOAD), caller_of(FRICTION)
_call_dynamics, _call_initial = caller_of(DYNAMICS), caller_of(INITIAL)


@njit(forceinline=True)
def rates(time, theta, omega, states, v, plant, derivatives):  # type: ignore[no-untyped-def]  # compiled
    """Return θ̈ without dry friction and the torque of servo and springs, rad/s²; fill the states' derivatives."""
    abc, table, edges, numbers, _ = plant
    torque = abc[2] * v - abc[1] * theta
    for k in range(edges[_SERVO], edges[_LOAD]):
        piece = shifted(table, _COLUMNS * k)
        torque = _call_servo(piece[_FUNCTION], (torque, theta, omega, abc, shifted(numbers, piece[_NUMBERS])))
    acceleration = torque - abc[0] * omega
    if edges[_LOAD] < edges[_FRICTION]:
        added = 0.0
        for k in range(edges[_FRICTION] - 1, edges[_LOAD] - 1, -1):
            piece = shifted(table, _COLUMNS * k)
            added += _call_load(piece[_FUNCTION], (time, theta, omega, abc, shifted(numbers, piece[_NUMBERS])))
        acceleration += added
    for k in range(edges[_DYNAMICS], edges[_END]):
        piece = shifted(table, _COLUMNS * k)
        parameters, first = shifted(numbers, piece[_NUMBERS]), piece[_STATES]
        here, there = shifted(states, first), shifted(derivatives, first)
        acceleration += _call_dynamics(piece[_FUNCTION], (time, theta, omega, v, abc, here, parameters, there))
    return acceleration, torque


@njit
def dry_friction(torque, theta, plant):  # type: ignore[no-untyped-def]  # compiled
    """Return the levels sliding up, sliding down and breaking away (rad/s²), and the largest Stribeck speed (rad/s).

    The torque is that of servo and springs, rad/s².
    """
    abc, table, edges, numbers, _ = plant
    up, down, breakaway, speed = 0.0, 0.0, 0.0, 0.0
    for k in range(edges[_DYNAMICS] - 1, edges[_FRICTION] - 1, -1):
        piece = shifted(table, _COLUMNS * k)
        more = _call_friction(piece[_FUNCTION], (torque, theta, abc, shifted(numbers, piece[_NUMBERS])))
        up, down, breakaway, speed = up + more[0], down + more[1], breakaway + more[2], max(speed, more[3])
    return up, down, breakaway, speed


@njit
def settle(theta, omega, v, plant, states, count):  # type: ignore[no-untyped-def]  # compiled
    """Fill the additional states at the first instant of a run; zeros for an effect that states none."""
    abc, table, edges, numbers, _ = plant
    for i in range(count):
        states[i] = 0.0
    for k in range(edges[_DYNAMICS], edges[_END]):
        piece = shifted(table, _COLUMNS * k)
        if piece[_INITIAL] != 0:
            parameters, here = shifted(numbers, piece[_NUMBERS]), shifted(states, piece[_STATES])
            _call_initial(piece[_INITIAL], (theta, omega, v, abc, parameters, here))
