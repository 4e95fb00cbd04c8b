"""What every kind of mechanism is made of: a stage to stand on, motions in time, and the mechanism itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.drawn.canvas import Canvas, Picture, pick

Motion = Callable[[float], float]
"""Angle, deg, at a time, s."""
Pose = dict[str, float]
"""Angle of every moving part, deg, counter-clockwise as seen."""


@dataclass(frozen=True)
class Stage:
    """What a mechanism is drawn for."""

    rng: np.random.Generator
    width: int
    height: int
    fps: float
    frames: int

    @property
    def middle(self) -> tuple[float, float]:
        return self.width / 2.0, self.height / 2.0

    def near(self, x: float, y: float, spread: float = 20.0) -> np.ndarray:
        """Return a place near a share of the width and of the height, px."""
        return np.array([x * self.width, y * self.height]) + self.rng.uniform(-spread, spread, 2)


@dataclass(frozen=True)
class Mechanism:
    """One mechanism."""

    pivot: Any
    """(2,) px."""
    pose: Callable[[float], Pose]
    """Of a time, s."""
    paint: Callable[[Canvas, Pose, float], None]
    grip: Callable[[Pose], Any]
    """Where a hand would take it, px."""
    scenery: Picture | None = None
    """(rows, columns, 3) what stands behind it, margin included; ``None``: any room."""


def motion(stage: Stage, amplitude: float, among: Sequence[str] = ()) -> Motion:
    """Return a motion of an amplitude, deg: one of those named, by default any.

    Its frequency lies between 0.4 and 1.6 Hz, and at most at a fourteenth of the frame rate.
    """
    rng, seconds = stage.rng, stage.frames / stage.fps
    kind = pick(rng, among or ("sine", "damped", "mix", "steps", "triangle"))
    f = min(rng.uniform(0.4, 1.1) if seconds > 2.5 else rng.uniform(0.8, 1.6), stage.fps / 14.0)
    w, phase = 2.0 * np.pi * f, rng.uniform(0.0, 2.0 * np.pi)
    if kind == "sine":
        return lambda t: amplitude * np.sin(w * t + phase)
    if kind == "damped":
        rate = rng.uniform(0.1, 0.5)
        return lambda t: amplitude * np.exp(-rate * t) * np.cos(w * t)
    if kind == "mix":
        v, other = w * rng.uniform(1.6, 2.4), rng.uniform(0.0, 2.0 * np.pi)
        return lambda t: amplitude * (0.65 * np.sin(w * t + phase) + 0.35 * np.sin(v * t + other))
    if kind == "triangle":
        return lambda t: amplitude * (4.0 * abs((f * t + phase) % 1.0 - 0.5) - 1.0)
    return _steps(rng, amplitude, seconds)


def _steps(rng: np.random.Generator, amplitude: float, seconds: float) -> Motion:
    """Return a staircase whose every step is a decay to the next level."""
    count = max(2, int(seconds / 0.7))
    level, tau = rng.uniform(-amplitude, amplitude, count + 1), rng.uniform(0.05, 0.15)
    at = np.arange(count + 1) * seconds / (count + 0.5)

    def angle(t: float) -> float:
        y = level[0]
        for start, goal in zip(at[1:], level[1:], strict=True):
            if t > start:
                y += (goal - y) * (1.0 - np.exp(-(t - start) / tau))
        return float(y)

    return angle


def one(name: str, angle: Motion) -> Callable[[float], Pose]:
    """Return the pose of a mechanism with one moving part."""
    return lambda t: {name: float(angle(t))}
