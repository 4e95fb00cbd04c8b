"""The true motion: the base model and its hidden effects, integrated from event to event.

    θ̈ = p(t, θ) − a·θ̇ − q·θ̇·|θ̇| − F·sgn θ̇          while sliding
    p(t, θ) = c·v − b·θ − k3·θ³ + A·sin(2πft + φ)
    θ̇ = 0                                             while |p| ≤ breakaway: the head sticks

u is the commanded head angle and v what arrives at the torque: u itself, or u after its lag, τ·v̇ = u − v. Between
two knots u is a straight line of time, so v has a closed form and only θ and θ̇ are integrated. Nothing is smoothed:
switches are shifted by the dead time exactly, and the sign of θ̇ never changes within a piece.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from synth.spec import Effects, Plant

Floats = NDArray[np.float64]

LONGEST_STEP_S = 0.005
"""No step is longer: it keeps the interpolant as good as the steps, and no reversal of the head is stepped over."""


@dataclass(frozen=True)
class Drive:
    """A command made of straight lines: from each knot on, u = level + slope·(t − knot)."""

    knots: Floats
    """s, ascending."""
    levels: Floats
    """rad."""
    slopes: Floats
    """rad/s."""


@dataclass(frozen=True)
class Motion:
    """The angle as a function of time, piece by piece."""

    starts: Floats
    """When each piece begins, s."""
    pieces: tuple[Callable[[Floats], Floats], ...]

    def angle(self, times: ArrayLike) -> Floats:
        """θ in rad at the given times, s."""
        at = np.asarray(times, dtype=float)
        which = np.clip(np.searchsorted(self.starts, at, side="right") - 1, 0, None)
        out = np.empty(at.shape)
        for k in np.unique(which):
            inside = which == k
            out[inside] = self.pieces[k](at[inside])
        return out


def drive_from_rows(rows: Floats | None, effects: Effects) -> Drive:
    """Turn command rows into what the actuator is asked for: later by the dead time, no faster than the rate limit.

    Parameters
    ----------
    rows : ndarray or None
        (time_s, command_deg), each held until the next; ``None`` for no command.
    effects : Effects
        Of which ``dead_time`` and ``rate_limit`` act here.

    Returns
    -------
    Drive
        Zero before its first knot.
    """
    if rows is None:
        return Drive(np.zeros(1), np.zeros(1), np.zeros(1))
    knots = rows[:, 0] + (effects.dead_time.tau_s if effects.dead_time else 0.0)
    levels = np.radians(rows[:, 1])
    if effects.rate_limit:
        return _ramps(knots, levels, math.radians(effects.rate_limit.r_deg_per_s))
    return Drive(knots, levels, np.zeros(len(knots)))


def move(
    plant: Plant, effects: Effects, drive: Drive, end: float, start_angle: float = 0.0, let_go: float = 0.0
) -> Motion:
    """Integrate the motion of one recording.

    Parameters
    ----------
    plant : Plant
        a, b, c.
    effects : Effects
        Those of the load and of the actuator's lag act here.
    drive : Drive
        What the actuator is asked for.
    end : float
        s; the motion is known from 0 to here.
    start_angle : float
        rad; the head rests there.
    let_go : float
        s; until then the head is held.

    Returns
    -------
    Motion
        θ(t), to about 1e-9 rad.
    """
    load = _load(plant, effects)
    starts, pieces = [0.0], [_constant(start_angle)]
    state = np.array([start_angle, 0.0])
    v = 0.0
    bounds = np.union1d([let_go, end], drive.knots[(drive.knots > let_go) & (drive.knots < end)])
    for begin, until in itertools.pairwise(bounds):
        arriving = _arriving(drive, load.lag, begin, v)
        now = begin
        while now < until:
            starts.append(now)
            if load.breakaway > 0 and state[1] == 0.0 and abs(load.pull(now, state[0], arriving)) <= load.breakaway:
                pieces.append(_constant(state[0]))
                now = _breaks_away(load, state[0], arriving, now, until)
                continue
            interpolant, now, state = _slide(load, state, arriving, now, until)
            pieces.append(interpolant)
        v = arriving(until)
    return Motion(np.array(starts), tuple(pieces))


@dataclass(frozen=True)
class _Load:
    """The numbers of the right-hand side, with every absent effect at its null."""

    a: float
    b: float
    c: float
    lag: float
    q: float
    k3: float
    friction: float
    breakaway: float
    shake: float
    shake_rate: float
    shake_phase: float

    def pull(self, t: float, theta: float, arriving: Callable[[float], float]) -> float:
        """Angular acceleration at rest and without friction, p(t, θ), rad/s²."""
        steady = self.c * arriving(t) - self.b * theta - self.k3 * theta**3
        return steady + self.shake * math.sin(self.shake_rate * t + self.shake_phase)


def _load(plant: Plant, effects: Effects) -> _Load:
    dry, shake = effects.coulomb_friction, effects.periodic_disturbance
    friction = dry.torque if dry else 0.0
    return _Load(
        a=plant.a,
        b=plant.b,
        c=plant.c,
        lag=effects.actuator_lag.tau_s if effects.actuator_lag else 0.0,
        q=effects.quadratic_drag.q if effects.quadratic_drag else 0.0,
        k3=effects.stiffening_spring.k3 if effects.stiffening_spring else 0.0,
        friction=friction,
        breakaway=dry.breakaway if dry and dry.breakaway is not None else friction,
        shake=shake.amplitude if shake else 0.0,
        shake_rate=2 * math.pi * shake.frequency_hz if shake else 0.0,
        shake_phase=shake.phase if shake else 0.0,
    )


def _slide(
    load: _Load, state: Floats, arriving: Callable[[float], float], now: float, until: float
) -> tuple[Callable[[Floats], Floats], float, Floats]:
    """Integrate until the next knot, or until the head stops if there is dry friction."""
    direction = math.copysign(1.0, state[1] if state[1] != 0.0 else load.pull(now, state[0], arriving))

    def rate(t: float, x: Floats) -> tuple[float, float]:
        theta, omega = x
        resisting = load.a * omega + load.q * omega * abs(omega) + direction * load.friction
        return omega, load.pull(t, theta, arriving) - resisting

    def stop(t: float, x: Floats) -> float:
        # a piece that starts at rest must not end where it starts
        return direction * x[1] if t > now else 1.0

    stop.terminal, stop.direction = True, -1.0  # type: ignore[attr-defined]
    run = solve_ivp(
        rate,
        (now, until),
        state,
        method="DOP853",
        rtol=1e-10,
        atol=1e-12,
        max_step=LONGEST_STEP_S,
        dense_output=True,
        events=stop if load.breakaway > 0 else None,
    )
    solution = run.sol
    stopped = run.status == 1
    return (
        lambda times: np.asarray(solution(times)[0]),
        float(run.t[-1]),
        np.array([run.y[0, -1], 0.0 if stopped else run.y[1, -1]]),
    )


def _breaks_away(load: _Load, theta: float, arriving: Callable[[float], float], now: float, until: float) -> float:
    """First instant at which the pull on the resting head exceeds the breakaway torque, or `until`."""

    def excess(t: float) -> float:
        return abs(load.pull(t, theta, arriving)) - load.breakaway

    grid = np.linspace(now, until, 2 + int((until - now) / 0.001))
    for before, after in itertools.pairwise(grid):
        if excess(after) > 0:
            root = brentq(excess, before, after, xtol=1e-14) if excess(before) < 0 else before
            # a hair later, so that the pull truly exceeds the limit and time moves on
            return float(min(max(root, now) + 1e-12, until))
    return until


def _arriving(drive: Drive, lag: float, begin: float, v: float) -> Callable[[float], float]:
    """v(t) from the knot at or before `begin` on, where it has the value `v`."""
    k = int(np.searchsorted(drive.knots, begin, side="right")) - 1
    knot, level, slope = (drive.knots[k], drive.levels[k], drive.slopes[k]) if k >= 0 else (begin, 0.0, 0.0)
    knot, level, slope = float(knot), float(level), float(slope)
    if lag == 0.0:
        return lambda t: level + slope * (t - knot)
    behind = level + slope * (begin - knot) - slope * lag
    return lambda t: behind + slope * (t - begin) + (v - behind) * math.exp(-(t - begin) / lag)


def _ramps(knots: Floats, levels: Floats, rate: float) -> Drive:
    """Follow a staircase no faster than `rate`, rad/s."""
    out: list[tuple[float, float, float]] = []
    at = 0.0
    for knot, following, level in zip(knots, [*knots[1:], math.inf], levels, strict=True):
        takes = abs(level - at) / rate
        if takes > 0:
            slope = math.copysign(rate, level - at)
            out.append((knot, at, slope))
            if knot + takes >= following:
                at += slope * (following - knot)
                continue
        at = float(level)
        out.append((knot + takes, at, 0.0))
    return Drive(*np.array(out).T)


def _constant(value: float) -> Callable[[Floats], Floats]:
    return lambda times: np.full(np.shape(times), value)
