"""The motion of one recording, as a function of time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synth.effects import Effect
from synth.effects.actuator_lag import ActuatorLag
from synth.effects.elastic_coupling import ElasticCoupling
from synth.motion.assemble import assemble, rest_angle
from synth.motion.drive import drive
from synth.motion.integrate import integrate
from synth.motion.nod import nod
from synth.motion.system import state_count, state_places
from synth.spec import Free, Nod, Recording, Spec

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """θ, θ̇ and the states of the effects at any time: at rest before the motion begins, and still after its end."""

    state: Callable[[Floats], Floats]
    """Times of shape (n,), s → rows θ, θ̇ and the effects' states, shape (m, n)."""
    places: dict[str, slice]
    """Rows of each effect's states, by effect id."""

    def angle(self, times: ArrayLike) -> Floats:
        """Return θ of the head, rad, in the shape of the times, s."""
        return self._row(0, times)

    def speed(self, times: ArrayLike) -> Floats:
        """Return θ̇ of the head, rad/s, in the shape of the times, s."""
        return self._row(1, times)

    def appendage(self, times: ArrayLike) -> Floats:
        """Return ψ of the appendage from the head, rad, in the shape of the times, s; zero without an appendage."""
        return self._row(self.places[ElasticCoupling.id].start, times)

    def _row(self, row: int, times: ArrayLike) -> Floats:
        at = np.asarray(times, dtype=float)
        return np.asarray(self.state(at.ravel())[row].reshape(at.shape))


def move(spec: Spec, recording: Recording, rows: Floats | None, until: float) -> Motion:
    """Work out the motion of one recording.

    Parameters
    ----------
    spec : Spec
        Plant, controller, linkage and effects.
    recording : Recording
        Its command; a nod needs no plant, and a free head is held until it is released.
    rows : ndarray or None
        Command rows (time_s, command_deg).
    until : float
        End of the motion, s.

    Returns
    -------
    Motion
        θ(t), to about 1e-11 rad.

    Raises
    ------
    ValueError
        If the head leaves the range in which the linkage closes or runs away, or the spec contradicts itself.
    """
    command, effects = recording.command, spec.effects.present()
    places, count = state_places(effects), state_count(effects)
    if isinstance(command, Nod):
        return Motion(lambda times: np.vstack([nod(command, times), np.zeros((count - 2, len(times)))]), places)
    system = assemble(spec)
    if isinstance(command, Free):
        start, begin = math.radians(command.initial_angle_deg), command.rest_s
    else:
        start, begin = rest_angle(system), 0.0
    if begin >= until:
        return Motion(lambda times: np.outer([start] + [0.0] * (count - 1), np.ones(len(times))), places)
    lag = spec.effects.get(ActuatorLag)
    states = integrate(system, drive(rows, spec), lag.tau_s if lag else 0.0, start, begin, until)
    speeds = _speed_rows(effects, places)
    return Motion(lambda times: _clamped(states, times, begin, until, speeds), places)


def _speed_rows(effects: tuple[Effect, ...], places: dict[str, slice]) -> list[int]:
    """Return the rows of the state that are speeds."""
    return [1] + [
        places[effect.id].start + number
        for effect in effects
        for number, variable in enumerate(effect.states)
        if variable.is_speed
    ]


def _clamped(
    states: Callable[[Floats], Floats], times: Floats, begin: float, until: float, speeds: list[int]
) -> Floats:
    """Return the states, standing still outside the interval that was integrated."""
    rows = states(np.clip(times, begin, until))
    outside = (times < begin) | (times > until)
    for row in speeds:
        rows[row, outside] = 0.0
    return rows
