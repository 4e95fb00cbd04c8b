"""Command rows exactly as written to the command file, so that the plant gets what the file states."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from synth.spec import Chirp, Free, Nod, PaperSeries, RandomSteps, Recording, Release, Stairs, Step, Triangle

Floats = NDArray[np.float64]

UPDATE_S = 0.02
"""Sample time of smooth commands, s: a servo takes a new position 50 times a second."""

PAPER_SERIES_DEG = (22.0, 0.0, 12.0, -8.0, 18.0, 5.0, -15.0, 10.0, 0.0)
"""Levels of the paper's verification. Figs. 11 and 15 show steps of several heights from several angles; the only
printed number is the 22° of the text. These levels begin with 22° and go in both directions within the linkage's
−23.9° to 31.1°, so that no step leaves the reach with the 14 % overshoot that the paper measured."""


def command_rows(recording: Recording, seed: np.random.SeedSequence) -> Floats | None:
    """Return the command of one recording.

    Parameters
    ----------
    recording : Recording
        Its command and duration are used.
    seed : numpy.random.SeedSequence
        Source of random steps.

    Returns
    -------
    ndarray or None
        Rows (time_s, command_deg), each held until the next; ``None`` without a command.
    """
    command, end = recording.command, recording.duration_s
    start = command.rest_s
    match command:
        case Free() | Nod():
            return None
        case Step():
            changes = [(start, command.amplitude_deg)]
        case Release():
            changes = [(start, command.amplitude_deg), (start + command.hold_s, 0.0)]
        case Stairs():
            changes = _stairs(start, command.tread_s, command.levels_deg)
        case PaperSeries():
            changes = _stairs(start, command.tread_s, PAPER_SERIES_DEG)
        case RandomSteps():
            changes = _random_steps(command, end, np.random.default_rng(seed))
        case Triangle() | Chirp():
            since = np.arange(0.0, max(end - start, 0.0), UPDATE_S)
            # Sampled at the middle of each hold, so that the staircase neither leads nor lags the smooth curve.
            levels = _smooth(command, since + UPDATE_S / 2, end - start)
            changes = list(zip(start + since, levels, strict=True))
    rows = np.array([(0.0, 0.0), *changes])
    # Rounded once, here, so that the file and the plant use identical numbers.
    return np.round(rows[rows[:, 0] < end], 6)


def _stairs(start: float, tread: float, levels: Sequence[float]) -> list[tuple[float, float]]:
    return [(start + k * tread, level) for k, level in enumerate(levels)]


def _random_steps(command: RandomSteps, end: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    changes, time = [], command.rest_s
    while time < end:
        changes.append((time, rng.uniform(-1.0, 1.0) * command.amplitude_deg))
        time += rng.uniform(command.shortest_s, command.longest_s)
    return changes


def _smooth(command: Triangle | Chirp, since: Floats, span: float) -> Floats:
    if isinstance(command, Triangle):
        phase = 2 * math.pi * since / command.period_s
        return np.asarray(command.amplitude_deg * (2 / math.pi) * np.arcsin(np.sin(phase)))
    growth = (command.to_hz - command.from_hz) / span
    return np.asarray(command.amplitude_deg * np.sin(2 * math.pi * (command.from_hz + growth * since / 2) * since))
