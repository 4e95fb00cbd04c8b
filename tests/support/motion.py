"""The true motion behind a drawn film: commands, and the response of the plant.

θ̈ = c·u − a·θ̇ − b·θ is solved by the matrix exponential from one instant to the next, so the linear response has no step
size. Quadratic drag and dry friction are integrated from event to event. Units inside are SI and radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

UPDATE_S = 0.02
"""Interval of a servo's set-points, s: 50 a second. Smooth commands are stairs with this tread."""


@dataclass(frozen=True)
class Plant:
    """Second-order plant with the effects that it may contain."""

    a: float = 26.0
    """Viscous damping, 1/s."""
    b: float = 524.0
    """Stiffness, 1/s²."""
    c: float = 508.0
    """Drive, 1/s²."""
    dead_time_s: float = 0.0
    """Delay of the command, s."""
    quadratic_drag: float = 0.0
    """q in −q·θ̇·abs(θ̇), 1/rad."""
    coulomb: float = 0.0
    """Dry friction while moving, rad/s²."""
    breakaway: float | None = None
    """Dry friction at rest, rad/s²; ``None`` for the same as while moving."""


@dataclass(frozen=True)
class Recording:
    """The command played to the rig during one clip."""

    name: str
    kind: str = "steps"
    """steps | stairs | triangle | chirp | random | release; release has no command file."""
    duration_s: float = 8.0
    amplitude_deg: float = 12.0
    """Largest command; for a release, the angle from which the body is released."""
    rest_s: float = 0.8
    """Time at rest before anything moves."""
    fastest_hz: float = 3.0
    """Frequency at the end of a chirp."""
    held_out: bool = False


def command_rows(recording: Recording, rng: np.random.Generator) -> np.ndarray:
    """Return rows (time_s, command_deg), each held until the next; switches fall between frames."""
    start, end, top = recording.rest_s, recording.duration_s, recording.amplitude_deg
    if recording.kind in {"steps", "stairs", "random"}:
        shares = {
            "steps": np.array([1.0, 0.0, -1.0, 0.0]),
            "stairs": np.array([0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.4, -0.8, -0.4, 0.0]),
            "random": rng.uniform(-1.0, 1.0, max(4, int(2 * (end - start)))),
        }[recording.kind]
        times = start + (end - start) * np.arange(len(shares)) / len(shares)
        times += rng.uniform(0.0, 1 / 30, len(shares))
        levels = top * shares
    else:
        times = start + rng.uniform(0.0, 1 / 30) + np.arange(0.0, end - start - 1 / 30, UPDATE_S)
        since, span = times - times[0] + UPDATE_S, end - start
        if recording.kind == "triangle":
            levels = top * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * since / span))
        elif recording.kind == "chirp":
            slowest = 0.3
            levels = top * np.sin(2 * np.pi * (slowest + (recording.fastest_hz - slowest) * since / (2 * span)) * since)
        else:
            raise ValueError(f"no command for a recording of kind {recording.kind!r}")
    rows = np.vstack([[0.0, 0.0], np.column_stack([times, levels])])
    # the file is the truth: the command is played as it can be read back from the file
    return np.column_stack([rows[:, 0].round(6), rows[:, 1].round(5)])


def move(plant: Plant, recording: Recording, times: np.ndarray, rows: np.ndarray | None) -> np.ndarray:
    """Return the angle, degrees, at given times, from rest at zero or, without rows, released from `amplitude_deg`."""
    if rows is None:
        angle, begin = np.radians(recording.amplitude_deg), recording.rest_s
        knots, levels = np.array([begin]), np.array([0.0])
    else:
        angle, begin = 0.0, 0.0
        knots, levels = rows[:, 0] + plant.dead_time_s, np.radians(rows[:, 1])
    solve = _by_exponential if plant.quadratic_drag == 0.0 == plant.coulomb else _by_events
    moving = times >= begin
    angles = np.full(len(times), angle)
    angles[moving] = solve(plant, knots, levels, times[moving], begin, angle)
    return np.degrees(angles)


def _by_exponential(
    plant: Plant, knots: np.ndarray, levels: np.ndarray, times: np.ndarray, begin: float, angle: float
) -> np.ndarray:
    """Return the angles at `times` with the command as a third, constant state: (θ, ω, u) ← exp(A·Δt)·(θ, ω, u)."""
    instants = np.union1d(np.union1d(knots[knots > begin], times), [begin])
    held = levels[np.maximum(np.searchsorted(knots, instants, side="right") - 1, 0)]
    A = np.array([[0.0, 1.0, 0.0], [-plant.b, -plant.a, plant.c], [0.0, 0.0, 0.0]])
    steps = expm(A * np.diff(instants)[:, None, None])
    state, path = np.array([angle, 0.0]), [angle]
    for step, u in zip(steps, held, strict=False):
        state = step[:2, :2] @ state + step[:2, 2] * u
        path.append(state[0])
    return np.array(path)[np.searchsorted(instants, times)]


def _by_events(
    plant: Plant, knots: np.ndarray, levels: np.ndarray, times: np.ndarray, begin: float, angle: float
) -> np.ndarray:
    """Return the angles at `times`, integrated between switches and stops, so that ω has one sign within each run."""
    last = max(times[-1], begin) + 1e-9
    switches = np.append(np.union1d([begin], knots[(knots > begin) & (knots < last)]), last)
    limit = plant.coulomb if plant.breakaway is None else plant.breakaway
    out = np.empty(len(times))
    state = np.array([angle, 0.0])
    for now, until in pairwise(switches):
        u = levels[max(np.searchsorted(knots, now, side="right") - 1, 0)]
        while now < until:
            pull = plant.c * u - plant.b * state[0]
            if state[1] == 0.0 and abs(pull) <= limit:  # stuck until the command changes
                out[(times >= now) & (times < until)] = state[0]
                break
            sign = np.sign(state[1]) if state[1] != 0.0 else np.sign(pull)

            def rate(_t: float, x: np.ndarray, u: float = u, sign: float = sign) -> list[float]:
                drag = plant.quadratic_drag * x[1] * abs(x[1])
                return [x[1], plant.c * u - plant.a * x[1] - plant.b * x[0] - drag - sign * plant.coulomb]

            def stop(_t: float, x: np.ndarray, sign: float = sign) -> float:
                return sign * x[1]

            stop.terminal, stop.direction = True, -1
            run = solve_ivp(rate, (now, until), state, "DOP853", events=stop, dense_output=True, rtol=1e-10, atol=1e-12)
            inside = (times >= now) & (times < run.t[-1])
            if inside.any():
                out[inside] = run.sol(times[inside])[0]
            stopped = run.status == 1
            now, state = run.t[-1], np.array([run.y[0, -1], 0.0 if stopped else run.y[1, -1]])
    return out
