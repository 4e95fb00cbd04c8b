"""Causes that the ledger lacks: torques that are functions of angle, velocity, command, phase or time.

The motion is integrated here by classical Runge-Kutta steps of at most 2 ms from switch to switch of the command, and
shares nothing with the package. Units are SI and radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from anglecam.data.command import Command
from anglecam.data.record import Record
from support.motion import UPDATE_S, Recording, command_rows
from support.series import noise

Torque = Callable[[float, float, float, float, float], float]
"""(angle, velocity, command, phase, time) → angular acceleration, rad/s²."""
A, B, C = 26.0, 524.0, 508.0
STEP = 0.002


@dataclass(frozen=True)
class Cause:
    """One cause outside the ledger."""

    over: tuple[str, ...]
    """What it depends on."""
    draw: Callable[[np.random.Generator], Torque]
    """Draws size and place."""


def _near(x: float, at: float, width: float) -> float:
    return math.exp(-(((x - at) / width) ** 2))


def _magnet(rng: np.random.Generator) -> Torque:
    at, width, size = math.radians(rng.uniform(-4, 4)), math.radians(rng.uniform(2.5, 4)), rng.uniform(8, 14)
    return lambda th, om, u, ph, t: -size * (th - at) / width * _near(th, at, width)


def _bent_cable(rng: np.random.Generator) -> Torque:
    at, width, size = math.radians(rng.uniform(2, 6)), math.radians(rng.uniform(3, 5)), rng.uniform(8, 14)
    return lambda th, om, u, ph, t: size * _near(th, at, width)


def _eddy_brake(rng: np.random.Generator) -> Torque:
    fastest, size = rng.uniform(0.4, 0.8), rng.uniform(10, 16)
    return lambda th, om, u, ph, t: -size * 2.0 * (om / fastest) / (1.0 + (om / fastest) ** 2)


def _chatter(rng: np.random.Generator) -> Torque:
    at, width, size = rng.uniform(0.8, 1.4), rng.uniform(0.5, 0.8), rng.uniform(12, 18)
    return lambda th, om, u, ph, t: size * _near(om, at, width)


def _van_der_pol(rng: np.random.Generator) -> Torque:
    width, rate = math.radians(rng.uniform(7, 10)), rng.uniform(6, 10)
    return lambda th, om, u, ph, t: rate * (1.0 - (th / width) ** 2) * om


def _rubbing_place(rng: np.random.Generator) -> Torque:
    at, width, rate = math.radians(rng.uniform(-5, 5)), math.radians(rng.uniform(3, 5)), rng.uniform(12, 18)
    return lambda th, om, u, ph, t: -rate * om * _near(th, at, width)


def _amplifier_step(rng: np.random.Generator) -> Torque:
    at, width, size = math.radians(rng.uniform(-4, 4)), math.radians(rng.uniform(2, 3)), rng.uniform(8, 12)
    return lambda th, om, u, ph, t: size * _near(u, at, width)


def _cam(rng: np.random.Generator) -> Torque:
    at, size = rng.uniform(0.1, 0.9), rng.uniform(8, 12)

    def torque(th: float, om: float, u: float, ph: float, t: float) -> float:
        return size * math.exp(8.0 * (math.cos(math.tau * (ph - at)) - 1.0)) if ph >= 0.0 else 0.0

    return torque


def _touch(rng: np.random.Generator) -> Torque:
    at, width, size = rng.uniform(2.5, 5.5), rng.uniform(0.5, 0.9), rng.uniform(8, 12)
    return lambda th, om, u, ph, t: size * _near(t, at, width)


def _settling_spring(rng: np.random.Generator) -> Torque:
    tau, size = rng.uniform(2.0, 4.0), rng.uniform(60, 100)
    return lambda th, om, u, ph, t: -size * th * math.exp(-t / tau)


CAUSES = {
    "magnet": Cause(("angle",), _magnet),
    "bent_cable": Cause(("angle",), _bent_cable),
    "eddy_brake": Cause(("velocity",), _eddy_brake),
    "chatter": Cause(("velocity",), _chatter),
    "van_der_pol": Cause(("angle", "velocity"), _van_der_pol),
    "rubbing_place": Cause(("angle", "velocity"), _rubbing_place),
    "amplifier_step": Cause(("command",), _amplifier_step),
    "cam": Cause(("phase",), _cam),
    "touch": Cause(("time",), _touch),
    "settling_spring": Cause(("angle", "time"), _settling_spring),
}
"""By name."""


def torque_of(name: str, seed: int, size: float = 1.0) -> Torque:
    """Return the torque of a session, ``size`` times as large as it is drawn."""
    drawn = CAUSES[name].draw(np.random.default_rng([seed, list(CAUSES).index(name), 7]))
    return lambda th, om, u, ph, t: size * drawn(th, om, u, ph, t)


def outside_session(name: str, seed: int, *, size: float = 1.0, sigma_deg: float = 0.05) -> list[Record]:
    """Return records of steps, stairs, triangle, chirp and random steps, of which the last is meant to be held out.

    For a torque over the phase, the triangle is repeated every two seconds, and so are the held-out recording's steps.
    """
    torque, rng = torque_of(name, seed, size), np.random.default_rng(seed)
    kinds = ("steps", "stairs", "triangle", "chirp", "random")
    return [_record(kind, torque, CAUSES[name].over == ("phase",), rng, sigma_deg) for kind in kinds]


def _record(kind: str, torque: Torque, periodic: bool, rng: np.random.Generator, sigma_deg: float) -> Record:
    rows = command_rows(Recording(kind, kind), rng)
    period, begin = 2.0, float(rows[1, 0])
    if periodic:
        times = begin + np.arange(0.0, 7.0, UPDATE_S)
        share = np.mod(times - begin + UPDATE_S, period) / period
        first = rows[1:, 1][: 4 if kind in ("steps", "stairs", "random") else None]
        levels = first[(share * len(first)).astype(int)] if len(first) <= 4 else 12 * np.sin(math.tau * share)
        rows = np.vstack([[0.0, 0.0], np.column_stack([times, levels])])
    time = np.arange(0.0, 8.0, 1 / 30)
    knots, levels = rows[:, 0], np.radians(rows[:, 1])
    angle = moved(torque, time, knots, levels, (begin, period) if periodic else None)
    command = Command(knots, levels)
    measured = angle + noise(rng, len(time), math.radians(sigma_deg))
    return Record(kind, time, measured, command, False, np.full(len(time), np.nan))


def moved(
    torque: Torque, time: np.ndarray, knots: np.ndarray, levels: np.ndarray, cycle: tuple[float, float] | None
) -> np.ndarray:
    """Return the angle at ``time``, rad, from rest where nothing pulls at the first instant."""
    stops = np.union1d(time, knots[(knots > time[0]) & (knots < time[-1])])
    held = levels[np.maximum(np.searchsorted(knots, stops, side="right") - 1, 0)]

    def rate(t: float, th: float, om: float, u: float) -> float:
        phase = -1.0 if cycle is None else ((t - cycle[0]) / cycle[1]) % 1.0
        return C * u - A * om - B * th + torque(th, om, u, phase, t)

    th, om = 0.0, 0.0
    for _ in range(50):  # rest under the first command
        th += rate(time[0], th, 0.0, held[0]) / B
    path = [th]
    for begin, end, u in zip(stops[:-1].tolist(), stops[1:].tolist(), held.tolist(), strict=False):
        steps = max(1, math.ceil((end - begin) / STEP))
        h = (end - begin) / steps
        for k in range(steps):
            t = begin + k * h
            k1 = rate(t, th, om, u)
            k2 = rate(t + h / 2, th + h / 2 * om, om + h / 2 * k1, u)
            k3 = rate(t + h / 2, th + h / 2 * om + h * h / 4 * k1, om + h / 2 * k2, u)
            k4 = rate(t + h, th + h * om + h * h / 2 * k2, om + h * k3, u)
            th, om = th + h * om + h * h / 6 * (k1 + k2 + k3), om + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        path.append(th)
    return np.array(path)[np.searchsorted(stops, time)]
