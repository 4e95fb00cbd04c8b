"""The compiled integrator of the equation of motion, with every effect of a ledger at its port.

    θ̈ = servo(c·v − b·θ) − a·θ̇ + Σ load_i + Σ dynamics_i − dry friction,     τ·v̇ = u − v

It advances from *stop* to *stop*: frames and knots of the command. Between two stops the command is a straight line,
and the lag behind it is solved in closed form. Because every knot is a stop, a delay is exact and the prediction is
differentiable with respect to it. Without an effect inside the equation of motion a stretch between stops is a Taylor
series, exact to rounding (`anglecam.models.linear_step`); otherwise it is Runge-Kutta steps
(`anglecam.models.stepping`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from anglecam import effects, neck
from anglecam.effects import LEDGER, Effect
from anglecam.models.compiled_effects import CompiledEffects, compile_effects
from anglecam.models.drive import drive_at, line_at
from anglecam.models.linear_step import SETTLED, advance_linear
from anglecam.models.stepping import compile_advance

FADED = 12.0
"""Time constants after which 6e-6 of a lag's transient is left."""


def compile_run(effects: CompiledEffects):  # type: ignore[no-untyped-def]  # compiled
    """Return the compiled integrator of a ledger's effects."""
    rows_of, initial, advance = effects.rows, effects.initial, compile_advance(effects)

    @njit(nogil=True)
    def run(states, time, theta, omega, knots, lag, plant, rows, max_step, near):  # type: ignore[no-untyped-def]
        """Write one run's angle and rate to ``states``, (n, 2)."""
        n, m = len(time), knots.shape[1]
        abc = np.array(plant)
        states[0] = theta, omega
        now = time[0]
        k = np.searchsorted(knots[0], now, side="right") - 1
        segment = np.zeros(3)
        segment[0], segment[1] = line_at(knots, k, now)
        v = segment[0]
        extra = initial(theta, omega, v, plant, rows)
        merges = len(near) == n and len(extra) == 0
        for i in range(1, n):
            while now < time[i]:
                stop = time[i]
                if k + 1 < m and knots[0, k + 1] < stop:
                    stop = knots[0, k + 1]
                segment[0], segment[1] = line_at(knots, k, now)
                segment[2] = v - segment[0] + segment[1] * lag
                if max_step == 0.0:
                    theta, omega = advance_linear(theta, omega, stop - now, segment, lag, abc)
                else:
                    # a short lag decays within a step: meanwhile steps are no longer than half of the lag
                    fading = min(FADED * lag, stop - now) if abs(segment[2]) > SETTLED else 0.0
                    for leg in range(2):
                        begin, end = (0.0, fading) if leg == 0 else (fading, stop - now)
                        longest = min(max_step, 0.5 * lag) if leg == 0 else max_step
                        steps = int(np.ceil((end - begin) / longest)) if end > begin else 0
                        for step in range(steps):
                            h = (end - begin) / steps
                            theta, omega, extra = advance(
                                theta, omega, extra, now, begin + step * h, h, segment, lag, plant, rows
                            )
                v = drive_at(stop - now, segment, lag)
                now = stop
                while k + 1 < m and knots[0, k + 1] <= now:
                    k += 1
            states[i] = theta, omega
            if merges and theta == near[i, 0] and omega == near[i, 1]:
                states[i + 1 :] = near[i + 1 :]
                break

    @njit(nogil=True)
    def run_all(time, edges, first, knots, spans, lag, abc, table, max_step, near):  # type: ignore[no-untyped-def]
        plant, rows = (abc[0], abc[1], abc[2]), rows_of(table)
        states = np.empty((len(time), 2))
        for i in range(len(first)):
            part, command = slice(edges[i], edges[i + 1]), knots[:, spans[i, 0] : spans[i, 1]]
            theta, omega = first[i]
            run(states[part], time[part], theta, omega, command, lag, plant, rows, max_step, near[part])
        return states

    return run_all


@dataclass(frozen=True)
class Integrator:
    """The integrator of one ledger."""

    effects: CompiledEffects
    """For the parameter table that `integrate` takes."""
    integrate: Any
    """Compiled; arguments and result as of the module's `integrate`."""


def integrator_of(ledger: Sequence[Effect]) -> Integrator:
    """Return the integrator of a ledger other than the package's, compiled in every process that uses it.

    Parameters
    ----------
    ledger : sequence of Effect
        For example `anglecam.effects.LEDGER` and an effect that is being tried out.
    """
    compiled = compile_effects(ledger)
    return Integrator(compiled, compile_run(compiled))


def hash_of_sources(*folders: Path) -> str:
    """Return a hash of all Python files in some folders."""
    files = [file for folder in folders for file in sorted(folder.glob("*.py"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


SOURCES = hash_of_sources(Path(__file__).parent, Path(effects.__path__[0]), Path(neck.__path__[0]))
"""Hash of the code that the cached integrator is compiled from; the linkage's tables come from the neck's equations.

Numba's cache on disk is keyed by one file and by the variables that a function encloses. A function that is compiled
once for all processes therefore encloses this hash, so that a change of any of these files compiles it anew."""
COMPILED = compile_effects(LEDGER)
_run = compile_run(COMPILED)


def _compile_once(code):  # type: ignore[no-untyped-def]  # compiled
    """Return the integrator of the package's ledger, compiled by the first process that runs it."""

    @njit(nogil=True, cache=True)
    def integrate(time, edges, first, knots, spans, lag, abc, table, max_step, near):  # type: ignore[no-untyped-def]
        """Return angle and rate at ``time`` in one or several runs; compiled, so the arguments are not checked.

        Parameters
        ----------
        time : (n,) ndarray
            Instants of all runs, s, increasing in each; the state is given at the first of each, where a lag and the
            effects' states have settled.
        edges : (r + 1,) ndarray of int
            Where each run begins in ``time``, and the end.
        first : (r, 2) ndarray
            Angle from equilibrium at zero command (rad) and its rate (rad/s) at the first instant of each run.
        knots : (3, m) ndarray
            Commands: instants (s), levels (rad) and slopes (rad/s); before its first knot a command's level holds.
        spans : (r, 2) ndarray of int
            First knot of each run's command, and the end.
        lag : float
            τ, s.
        abc : (3,) ndarray
            a (1/s), b (1/s²), c (1/s²) of Eq. (30).
        table : (k, width + 1) ndarray
            Parameters of the effects inside the equation of motion, from `CompiledEffects.table`.
        max_step : float
            Longest Runge-Kutta step, s; 0 if no effect is inside the equation of motion.
        near : (n, 2) or (0, 2) ndarray
            Result with the same arguments from other states at the first instants, if it is known. A run that reaches
            the same state has forgotten where it started; the rest is copied.

        Returns
        -------
        (n, 2) ndarray
            Angle, rad, and rate, rad/s.
        """
        assert len(code) > 0
        return _run(time, edges, first, knots, spans, lag, abc, table, max_step, near)

    return integrate


integrate = _compile_once(SOURCES)
INTEGRATOR = Integrator(COMPILED, integrate)
"""The integrator of `anglecam.effects.LEDGER`."""
