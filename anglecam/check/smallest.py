"""The smallest size of each effect that a session of recordings like a clip would show.

A session is simulated with the plant that the clip shows, with noise of the predicted size, and tested as the loop
tests a session (`anglecam.loop.residual_test`): an effect is detectable from the size on at which its change of the
angles exceeds what noise leaves, less what the plant's parameters can follow. A command that might be played instead is
judged by the norms of the same changes: smallest sizes are inversely proportional to them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import LEDGER, Effect
from anglecam.identification.fit import Fit
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.next_experiment.commands import LONGEST, candidate_commands
from anglecam.loop.policy import DEFAULT
from anglecam.loop.residual_test import run_residual_test
from anglecam.loop.screen import changes, directions
from anglecam.loop.stepwise import applicable
from anglecam.models.plant import FASTEST, Plant

RECORDINGS = 4
"""Recordings of a session."""
SIZE_SPREAD = 2.0
"""Factor within which a predicted size holds: the residual test depends on the draw of the noise and on the plant."""
AFTER = 1.0
"""Time that a recording goes on after the last change of its command, s."""
LONGEST_RECORDING = 60.0
"""s; a longer one is simulated up to here."""
PLANT_DOUBT = 0.25
"""RMS error of the fitted plant as a share of the motion from which on its prediction is doubtful."""


@dataclass(frozen=True)
class Smallest:
    """Smallest size of an effect that would be detected."""

    effect: Effect
    size: float
    """Of the effect's first parameter, in the unit of its name. For a limit it is the largest that still acts."""


@dataclass(frozen=True)
class Sizes:
    """What a session would show."""

    smallest: tuple[Smallest, ...]
    """In the order of the ledger; effects that the session cannot show are missing."""
    recordings: int
    duration: float
    """Of each recording, s."""
    parameters: Floats
    """Of the plant: a (1/s), b (1/s²) and, where a command is played, c (1/s²)."""
    motion: str
    """What moves the body, in words."""
    doubt: str | None
    """Why the plant may be another one."""


@dataclass(frozen=True)
class Played:
    """A command that would show more."""

    command: Command
    description: str
    factor: float
    """Smallest sizes with it, divided by those with the present motion; geometric mean over the effects."""


def fit_plant(record: Record, declared: Floats | None = None) -> tuple[Floats, Floats, str | None]:
    """Fit the base model to a part of a clip.

    Parameters
    ----------
    record : Record
        The part.
    declared : (3,) ndarray, optional
        Starting values of a, b, c that the rig declares.

    Returns
    -------
    parameters : ndarray
        a, b and, with a command, c.
    first : (2,) ndarray
        Angle (rad) and rate (rad/s) at its beginning, from equilibrium.
    doubt : str or None
        Message where the model leaves much of the motion.
    """
    starts = start_parameters([record])
    plant = Plant(driven=record.command is not None, fastest=max(FASTEST, *(math.sqrt(s[1]) for s in starts)))
    more = [] if declared is None else [declared[: plant.base_count]]
    fit = fit_output_error(plant, [record], [*starts, *more])
    moved = float(np.std(record.angle))
    doubt = None
    if fit.rmse > PLANT_DOUBT * moved:
        doubt = (
            f"the base model leaves {fit.rmse / moved:.0%} of the motion in the part that was read, so the sizes are"
            " rough; give the command with --command, or frames of a free swing with --from"
        )
    return fit.parameters, fit.nuisance[0][:2], doubt


def planned(record: Record, command: Command | None, parameters: Floats, first: Floats, duration: float) -> Record:
    """Return a recording as it would be made, without noise.

    Parameters
    ----------
    record : Record
        The part of the clip: its frame interval and its view hold.
    command : Command or None
        The command to play; ``None`` for a release as in the clip.
    parameters : ndarray
        Of the plant.
    first : (2,) ndarray
        State at the beginning where no command is played.
    duration : float
        s.
    """
    time = np.arange(0.0, duration, record.interval)
    state = first if command is None else np.array([0.0, 0.0])
    angle = Plant(driven=command is not None).predict(parameters, time, command, state)
    blank = np.full(len(time), np.nan)
    return replace(record, time=time, angle=angle, command=command, sigma=blank, lever_scatter=None, clock_sigma=0.0)


def smallest_sizes(
    plan: Record, parameters: Floats, scatter: float, camera: float, seed: int = 0
) -> tuple[Smallest, ...]:
    """Return the smallest detectable sizes in a session of `RECORDINGS` recordings.

    Parameters
    ----------
    plan : Record
        One of the recordings, from `planned`.
    parameters : ndarray
        Of the plant.
    scatter, camera : float
        Of an angle: what differs from frame to frame, and the noise floor of the film, rad. The loop ignores structure
        below twice that floor.
    seed : int
        Of the noise.
    """
    rng = np.random.default_rng(seed)
    fit, records, effects = _session(plan, parameters, scatter, rng)
    each = directions(fit, records, changes(fit, records, effects))
    limits = DEFAULT.stepwise
    least = max(limits.numerical_error_rad, limits.film_error_sigmas * camera)
    found = run_residual_test(fit, records, each, rng, least, phi_estimated=False).detectable
    return tuple(
        Smallest(e, e.parameters[0].in_file_unit(found[e.id])[0]) for e in LEDGER if found.get(e.id, 0.0) > 0.0
    )


def best_command(plan: Record, parameters: Floats, scatter: float) -> Played | None:
    """Return the command that would show the most, within the limits that the present command shows.

    Parameters
    ----------
    plan, parameters, scatter
        As of `smallest_sizes`.

    Returns
    -------
    Played or None
        ``None`` without a command, and where no other command shows more.
    """
    if plan.command is None:
        return None
    natural_hz = math.sqrt(max(float(parameters[1]), 0.0)) / (2.0 * math.pi)
    now = _norms(plan, parameters, scatter)
    width = float(np.ptp(plan.angle))
    best: Played | None = None
    for one in candidate_commands([plan], natural_hz):
        if one.command is None:
            continue
        other = planned(plan, one.command, parameters, np.zeros(2), min(LONGEST, float(plan.time[-1])))
        if np.ptp(other.angle) > 1.05 * width or one.description.startswith("the command of"):
            continue
        there = _norms(other, parameters, scatter)
        shared = [name for name in now if name in there]
        if not shared:
            continue
        gain = float(np.exp(np.mean([math.log(there[name] / now[name]) for name in shared])))
        if gain > (1.0 if best is None else 1.0 / best.factor):
            best = Played(one.command, one.description, 1.0 / gain)
    return best


def duration_of(command: Command | None, clip_s: float) -> float:
    """Return the length of a planned recording, s: that of its command, or of the clip."""
    whole = clip_s if command is None else float(command.time[-1]) + AFTER
    return min(whole, LONGEST_RECORDING)


def _session(
    plan: Record, parameters: Floats, scatter: float, rng: np.random.Generator
) -> tuple[Fit, Sequence[Record], list[Effect]]:
    """Return a simulated session with the base model fitted to it, and the effects that it can show."""
    count = len(plan.time)
    records = [
        replace(plan, name=f"recording {i + 1}", angle=plan.angle + scatter * rng.standard_normal(count))
        for i in range(RECORDINGS)
    ]
    fastest = max(FASTEST, math.sqrt(max(float(parameters[1]), 0.0)))
    fit = fit_output_error(Plant(driven=plan.command is not None, fastest=fastest), records, [parameters])
    return fit, records, applicable(records, fastest / FASTEST)


def _norms(plan: Record, parameters: Floats, scatter: float) -> dict[str, float]:
    """Return for each effect the mean square change per second that its first start makes beyond the plant, rooted."""
    fit, records, effects = _session(plan, parameters, scatter, np.random.default_rng(0))
    seconds = math.sqrt(float(plan.time[-1]))
    norms: dict[str, float] = {}
    for one in directions(fit, records, changes(fit, records, effects)):
        if one.effect.searched is None and np.array_equal(one.start, one.likeliest):
            norms.setdefault(one.effect.id, one.size / seconds)
    return {name: size for name, size in norms.items() if size > 0.0}
