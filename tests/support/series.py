"""Angle series with noise of known size and AR(1) coefficient, for tests that need no film.

The motion comes from `support.motion`, whose integration shares nothing with the package.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anglecam.data.command import Command
from anglecam.data.record import Record
from support.motion import Plant, Recording, command_rows, move


def noise(rng: np.random.Generator, n: int, sigma: float, phi: float = 0.0) -> NDArray[np.float64]:
    """Return (n,) AR(1) noise of standard deviation ``sigma`` and coefficient ``phi``."""
    e = rng.normal(size=n)
    for i in range(1, n):
        e[i] = phi * e[i - 1] + np.sqrt(1.0 - phi**2) * e[i]
    return sigma * e


def record(
    plant: Plant,
    recording: Recording,
    rng: np.random.Generator,
    *,
    sigma_deg: float,
    phi: float = 0.0,
    rate_hz: float = 30.0,
) -> Record:
    """Return one recording's series: exact motion plus noise."""
    rows = None if recording.kind == "release" else command_rows(recording, rng)
    time = np.arange(0.0, recording.duration_s, 1.0 / rate_hz)
    if rows is None:
        time = time[time >= recording.rest_s]
    angle = np.radians(move(plant, recording, time, rows)) + noise(rng, len(time), np.radians(sigma_deg), phi)
    command = None if rows is None else Command(rows[:, 0], np.radians(rows[:, 1]))
    return Record(recording.name, time, angle, command, False, np.full(len(time), np.nan))


def session(
    plant: Plant, seed: int, *, sigma_deg: float = 0.05, phi: float = 0.0, duration_s: float = 8.0
) -> list[Record]:
    """Return records of steps, stairs, triangle, chirp and random steps; the last is meant to be held out."""
    rng = np.random.default_rng(seed)
    kinds = ("steps", "stairs", "triangle", "chirp", "random")
    return [record(plant, Recording(kind, kind, duration_s), rng, sigma_deg=sigma_deg, phi=phi) for kind in kinds]
