"""The laboratory's neck at large angles, commanded over the full reach of its linkage, and the model of that neck."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.neck.large_angle import LargeAngleNeck
from anglecam.neck.parameters import PAPER
from anglecam.neck.statics import slack_limit
from support.moved import NECK, spec_of
from synth.motion import command_rows, move

COMMANDS = {
    "stairs": {"kind": "stairs", "levels_deg": [12, 25, 10, -10, -20, -8]},
    "high": {"kind": "stairs", "levels_deg": [25, 0, 25, 12, 25, 5]},
    "triangle": {"kind": "triangle", "amplitude_deg": 20.0},
    "chirp": {"kind": "chirp", "amplitude_deg": 12.0},
    "held": {"kind": "stairs", "levels_deg": [18, -5, 25, 8, -12, -19]},
}
TIME = np.arange(0.0, 6.0, 1 / 30)

_LIMIT = slack_limit(PAPER.spring, *LargeAngleNeck(gamma="exact").ratio.reach)
LABORATORY = LargeAngleNeck(gamma="exact", common_stretch=1.25 * _LIMIT)
"""Springs stretched a quarter more than is needed to keep both taut, as in `synth.motion.neck`."""


def command(name: str, share: float = 1.0) -> Command:
    """Return one of the commands, scaled by ``share``."""
    rows = _rows(name)
    return Command(rows[:, 0], share * np.radians(rows[:, 1]))


def true_angle(name: str) -> NDArray[np.float64]:
    """Return the laboratory's response to one of the commands, rad, at `TIME`."""
    spec = spec_of({}, COMMANDS[name], NECK)
    return move(spec, spec.recordings[0], _rows(name), TIME[-1]).angle(TIME)


def noisy(name: str, angle: NDArray[np.float64], rng: np.random.Generator, sigma_deg: float) -> Record:
    """Return a record of an angle with white noise and an unknown zero."""
    measured = angle + rng.normal(0.0, math.radians(sigma_deg), len(angle))
    return Record(name, TIME, measured, command(name), False, np.full(len(angle), np.nan))


def _rows(name: str) -> NDArray[np.float64]:
    spec = spec_of({}, COMMANDS[name], NECK)
    recording = spec.recordings[0].model_copy(update={"duration_s": float(TIME[-1])})
    rows = command_rows(recording, np.random.SeedSequence(0))
    assert rows is not None
    return rows
