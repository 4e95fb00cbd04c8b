"""The motion of one recording, as a function of time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synth.motion.assemble import assemble, rest_angle
from synth.motion.drive import drive
from synth.motion.integrate import integrate
from synth.motion.nod import nod
from synth.spec import Free, Nod, Recording, Spec

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """θ, θ̇ and what swings on the head, at any time: at rest before the motion begins, and still after its end."""

    state: Callable[[Floats], Floats]
    """Times of shape (n,), s → rows θ, θ̇, ψ, ψ̇ and w, the share of the oil that is warm, shape (5, n)."""

    def angle(self, times: ArrayLike) -> Floats:
        """θ of the head, rad, in the shape of the times, s."""
        return self._row(0, times)

    def speed(self, times: ArrayLike) -> Floats:
        """θ̇ of the head, rad/s, in the shape of the times, s."""
        return self._row(1, times)

    def appendage(self, times: ArrayLike) -> Floats:
        """ψ of the appendage from the head, rad, in the shape of the times, s; zero where there is none."""
        return self._row(2, times)

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
        What is commanded; a nod has no plant, and a free head is held until it is let go.
    rows : ndarray or None
        Command rows (time_s, command_deg).
    until : float
        The motion is known to this time, s.

    Returns
    -------
    Motion
        θ(t), to about 1e-11 rad.

    Raises
    ------
    ValueError
        If the head leaves the range in which the linkage closes or runs away, or the spec contradicts itself.
    """
    command = recording.command
    if isinstance(command, Nod):
        return Motion(lambda times: np.vstack([nod(command, times), np.zeros((3, len(times)))]))
    system = assemble(spec)
    if isinstance(command, Free):
        start, begin = math.radians(command.initial_angle_deg), command.rest_s
    else:
        start, begin = rest_angle(system), 0.0
    if begin >= until:
        return Motion(lambda times: np.outer([start, 0.0, 0.0, 0.0, 0.0], np.ones(len(times))))
    lag = spec.effects.actuator_lag.tau_s if spec.effects.actuator_lag else 0.0
    states = integrate(system, drive(rows, spec), lag, start, begin, until)
    return Motion(lambda times: _known(states, times, begin, until))


def _known(states: Callable[[Floats], Floats], times: Floats, begin: float, until: float) -> Floats:
    """States, standing still outside of the time that was integrated."""
    rows = states(np.clip(times, begin, until))
    rows[1::2, (times < begin) | (times > until)] = 0.0  # both speeds
    return rows
