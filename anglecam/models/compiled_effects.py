"""A ledger's effects compiled into a few functions for the integrator, each effect at its port.

    θ̈ = servo(c·v − b·θ) − a·θ̇ + Σ load_i(t, θ, θ̇) + Σ dynamics_i(t, θ, θ̇, v, x_i) − dry friction

The functions are composed from the ledger, so that nobody edits the integrator to add an effect. Parameters travel as
tuples: reading them from an array in every evaluation costs more than the evaluation itself. So does passing them in a
call; the functions of a step are therefore compiled into one (``forceinline``). An effect that is not in the plant is
not evaluated: its states stand still and it adds nothing, not even a zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from anglecam.data.typing import Floats
from anglecam.effects import Effect

STEPPED_PORTS = ("servo", "load", "friction", "dynamics")
"""Ports inside the equation of motion: a plant with an effect at one of them is integrated in Runge-Kutta steps."""


@dataclass(frozen=True)
class CompiledEffects:
    """Functions that the integrator calls, composed from a ledger."""

    ids: tuple[str, ...]
    """Effects at `STEPPED_PORTS`, one for each row of the parameter table."""
    width: int
    """Largest number of parameters of an effect."""
    rows: Any
    """(table) → the rows as tuples, by port; then whether a servo and a load are in the plant, and whether it rubs."""
    rates: Any
    """(time, θ, ω, additional states, v, abc, rows) → θ̈ without dry friction, torque of servo and springs (rad/s²),
    derivatives of the states."""
    friction: Any
    """(torque of servo and springs, θ, abc, rows) → levels sliding up, sliding down and breaking away (rad/s²), and the
    Stribeck speed (rad/s)."""
    initial: Any
    """(θ, ω, v, abc, rows) → additional states at the first instant."""
    moved: Any
    """(states, h, derivatives) → states + h·derivatives, element by element."""

    def table(self, pairs: Sequence[tuple[Effect, Floats]]) -> Floats:
        """Return the parameter table of a plant.

        Parameters
        ----------
        pairs : sequence of (Effect, (k,) ndarray)
            Effects with their parameters, SI; those at other ports are left out.

        Returns
        -------
        (r, width + 1) ndarray
            A row for each of `ids`, at least one. The last column is 1 for an effect that is in the plant; the rows of
            the others are zeros.
        """
        table = np.zeros((max(1, len(self.ids)), self.width + 1))
        for effect, values in pairs:
            if effect.port in STEPPED_PORTS:
                row = self.ids.index(effect.id)
                table[row, : len(values)] = values
                table[row, self.width] = 1.0
        return table


def compile_effects(ledger: Sequence[Effect]) -> CompiledEffects:
    """Compose the functions of a ledger; numba compiles them when they are first called.

    Parameters
    ----------
    ledger : sequence of Effect
        Any number of effects; servo effects act in the order of their ranks.

    Returns
    -------
    CompiledEffects
        Functions and the order of the rows.
    """
    ports = {port: [e for e in ledger if e.port == port] for port in STEPPED_PORTS}
    ports["servo"].sort(key=lambda e: e.rank)
    width = max((len(e.parameters) for e in ledger), default=0)
    edges = np.cumsum([0, *(len(entries) for entries in ports.values())]).tolist()
    servos, loads, frictions = edges[1:4]
    numbers = _tuple_of(width + 1, njit(lambda value: value))
    servo_rows, load_rows, friction_rows, dynamic_rows = (
        _tuple_of(len(entries), numbers, first) for entries, first in zip(ports.values(), edges, strict=False)
    )
    servo = _chain_of_servos([e.servo for e in ports["servo"]], width)
    load = _sum_of_loads([e.load for e in ports["load"]], width)
    friction = _sum_of_frictions([e.friction for e in ports["friction"]], width)
    dynamics = _sum_of_dynamics(ports["dynamics"], width)
    settled = _chain_of_initial_states(ports["dynamics"], width)

    @njit
    def rows(table):  # type: ignore[no-untyped-def]  # compiled
        served, loaded = np.any(table[:servos, width] != 0.0), np.any(table[servos:loads, width] != 0.0)
        rubs = np.any(table[loads:frictions, :width] != 0.0)
        return servo_rows(table), load_rows(table), friction_rows(table), dynamic_rows(table), served, loaded, rubs

    @njit(forceinline=True)
    def rates(time, theta, omega, extra, v, abc, rows):  # type: ignore[no-untyped-def]  # compiled
        torque = abc[2] * v - abc[1] * theta
        if rows[4]:
            torque = servo(torque, theta, omega, abc, rows[0])
        smooth = torque - abc[0] * omega
        if rows[5]:
            smooth += load(time, theta, omega, abc, rows[1])
        acceleration, derivatives = dynamics(smooth, time, theta, omega, v, abc, extra, rows[3])
        return acceleration, torque, derivatives

    @njit(forceinline=True)
    def all_friction(torque, theta, abc, rows):  # type: ignore[no-untyped-def]  # compiled
        return friction(torque, theta, abc, rows[2])

    @njit
    def initial(theta, omega, v, abc, rows):  # type: ignore[no-untyped-def]  # compiled
        return settled(theta, omega, v, abc, rows[3])

    ids = tuple(e.id for entries in ports.values() for e in entries)
    count = sum(e.states for e in ports["dynamics"])
    return CompiledEffects(ids, width, rows, rates, all_friction, initial, _shift_of(count))


def _tuple_of(count, item, first=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the tuple of ``count`` items of an array, from the item ``first`` on."""
    if count == 0:
        return njit(lambda array: ())
    before, at = _tuple_of(count - 1, item, first), first + count - 1
    return njit(lambda array: before(array) + (item(array[at]),))  # numba builds no other tuple from an array


def _shift_of(count):  # type: ignore[no-untyped-def]  # compiled
    """Compile states + h·derivatives for tuples of ``count`` numbers."""
    if count == 0:
        return njit(lambda states, h, derivatives: ())
    before, at = _shift_of(count - 1), count - 1
    return njit(lambda states, h, derivatives: before(states, h, derivatives) + (states[at] + h * derivatives[at],))


def _chain_of_servos(servos, width, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the servo functions, one after another, into one function."""
    if row == len(servos):
        return njit(lambda torque, theta, omega, abc, table: torque)
    first, others = servos[row], _chain_of_servos(servos, width, row + 1)

    @njit
    def chain(torque, theta, omega, abc, table):  # type: ignore[no-untyped-def]  # compiled
        if table[row][width] != 0.0:
            torque = first(torque, theta, omega, abc, table[row])
        return others(torque, theta, omega, abc, table)

    return chain


def _sum_of_loads(loads, width, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the sum of all load functions into one function."""
    if row == len(loads):
        return njit(lambda time, theta, omega, abc, table: 0.0)
    first, others = loads[row], _sum_of_loads(loads, width, row + 1)

    @njit
    def total(time, theta, omega, abc, table):  # type: ignore[no-untyped-def]  # compiled
        added = others(time, theta, omega, abc, table)
        if table[row][width] != 0.0:
            added += first(time, theta, omega, abc, table[row])
        return added

    return total


def _sum_of_frictions(frictions, width, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the sums of the levels of dry friction, and the largest of the Stribeck speeds, into one function."""
    if row == len(frictions):
        return njit(lambda torque, theta, abc, table: (0.0, 0.0, 0.0, 0.0))
    first, others = frictions[row], _sum_of_frictions(frictions, width, row + 1)

    @njit
    def total(torque, theta, abc, table):  # type: ignore[no-untyped-def]  # compiled
        up, down, breakaway, speed = others(torque, theta, abc, table)
        if table[row][width] != 0.0:
            more_up, more_down, more_breakaway, more_speed = first(torque, theta, abc, table[row])
            up, down, breakaway = up + more_up, down + more_down, breakaway + more_breakaway
            speed = max(speed, more_speed)
        return up, down, breakaway, speed

    return total


def _sum_of_dynamics(entries, width, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile all effects with additional states into one function: acceleration and all states' derivatives."""
    if row == len(entries):
        return njit(lambda acceleration, time, theta, omega, v, abc, extra, table: (acceleration, ()))
    first, others = entries[row].dynamics, _sum_of_dynamics(entries, width, row + 1)
    begin, end, still = _place(entries, row)

    @njit
    def total(acceleration, time, theta, omega, v, abc, extra, table):  # type: ignore[no-untyped-def]  # compiled
        derivatives = still
        if table[row][width] != 0.0:
            derivatives, added = first(time, theta, omega, v, abc, extra[begin:end], table[row])
            acceleration = acceleration + added
        acceleration, more = others(acceleration, time, theta, omega, v, abc, extra, table)
        return acceleration, derivatives + more

    return total


def _chain_of_initial_states(entries, width, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile all effects' initial states into one function; zeros for an effect that states none."""
    if row == len(entries):
        return njit(lambda theta, omega, v, abc, table: ())
    first, others = entries[row].initial, _chain_of_initial_states(entries, width, row + 1)
    still = _place(entries, row)[2]
    if first is None:
        return njit(lambda theta, omega, v, abc, table: still + others(theta, omega, v, abc, table))

    @njit
    def total(theta, omega, v, abc, table):  # type: ignore[no-untyped-def]  # compiled
        states = still
        if table[row][width] != 0.0:
            states = first(theta, omega, v, abc, table[row])
        return states + others(theta, omega, v, abc, table)

    return total


def _place(entries, row):  # type: ignore[no-untyped-def]
    """Return where an effect's states begin and end among all, and that many zeros."""
    begin = sum(e.states for e in entries[:row])
    return begin, begin + entries[row].states, (0.0,) * entries[row].states
