"""Commands that could be played next: a family of shapes, within the limits that the recordings show.

A proposed command demands no more of a rig than the recorded ones: it stays within their range, and within any time
window it changes by no more than one of them changed in a window of that length. This limits steps and rates, and also
fast chirps, which a limit on single steps would allow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, cycle

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.typing import Floats

UPDATE = 0.02
"""Time between two positions of a smooth command, s; a servo accepts 50 positions a second."""
REST = 0.5
"""Rest at the beginning, from which zero and noise of a recording are estimated, s."""
LONGEST = 12.0
"""Length of every candidate, s; commands repeat, so that the beginning of one is an experiment, too."""
SWEEP = 3.5
"""Time from the lowest frequency of a chirp to its highest, s."""
SLOWEST = 0.3
"""Lowest frequency of a chirp, Hz."""
FASTEST = 0.2 / UPDATE
"""Frequency above which a chirp has fewer than five positions in a period, Hz."""
WINDOWS = (1, 5, 25, 100)
"""Lengths, in updates, of the time windows in which the change of a command is limited."""
SHORT = 2
"""Index in `WINDOWS` of the window that limits commands which alternate between two sides."""
SHARES = (1.0, 0.3, 0.1)
"""Amplitudes as shares of the range; two amplitudes distinguish effects that grow differently with amplitude."""
HOLDS = (0.25, 0.6, 1.75)
"""Mean times for which a step is held, s."""
PERIODS = (2.0, 4.0, 8.0)
"""Periods of triangles, s."""


@dataclass(frozen=True)
class CommandLimits:
    """Range and changes of the recorded commands, rad."""

    home: float
    """Command at which recordings begin."""
    lowest: float
    highest: float
    changes: Floats
    """Largest change of a command within each of `WINDOWS`."""

    def allow(self, command: Command) -> bool:
        """Return whether a command stays within the limits."""
        slack = 1e-6  # rad; commands are rounded as in their files
        inside = self.lowest - slack <= command.angle.min() and command.angle.max() <= self.highest + slack
        return bool(inside and np.all(_largest_changes(command, command.time[-1] + UPDATE) <= self.changes + slack))


@dataclass(frozen=True)
class CandidateExperiment:
    """A recording of `LONGEST` seconds that could be made."""

    description: str
    command: Command | None
    """``None`` for a free swing."""
    released: float | None = None
    """Angle from which a free swing is released, rad."""


def limits_of(records: Sequence[Record]) -> CommandLimits:
    """Return the limits that the commands of recordings show; at least one recording must have a command."""
    commands = [(r.command, float(r.time[-1])) for r in records if r.command is not None]
    levels = np.concatenate([c.angle[c.time <= end] if np.any(c.time <= end) else c.angle[:1] for c, end in commands])
    changes = np.max([_largest_changes(c, end) for c, end in commands], axis=0)
    home = float(np.median([c.angle[0] for c, _ in commands]))
    return CommandLimits(home, float(levels.min()), float(levels.max()), changes)


def candidate_commands(records: Sequence[Record], natural_hz: float) -> list[CandidateExperiment]:
    """List the commands that could be played next.

    Parameters
    ----------
    records : sequence of Record
        Of the rig; at least one with a command.
    natural_hz : float
        Undamped natural frequency, Hz; chirps rise to one half, one and two times this.

    Returns
    -------
    list of CandidateExperiment
        The recorded commands, and shapes around the command at which recordings begin and around the middle of the
        range, as far as the `CommandLimits` and the camera's frame rate allow. Never empty.
    """
    limits = limits_of(records)
    interval = float(np.median([r.interval for r in records]))
    tops = [
        hz for hz in (0.5 * natural_hz, natural_hz, 2.0 * natural_hz) if SLOWEST < hz < min(FASTEST, 0.4 / interval)
    ]
    centres = [limits.home]
    middle = 0.5 * (limits.lowest + limits.highest)
    if abs(middle - limits.home) > 0.1 * (limits.highest - limits.lowest):
        centres.append(middle)
    shaped = chain.from_iterable(_shapes_around(centre, limits, tops) for centre in centres)
    again = [
        CandidateExperiment(f"the command of {r.name} again", _again(r.command, float(r.time[0])))
        for r in records
        if r.command
    ]
    return [*again, *(c for c in shaped if c.command and limits.allow(c.command))]


def candidate_releases(angles: Floats) -> list[CandidateExperiment]:
    """List free swings from shares of the largest and smallest of ``angles``, rad from equilibrium."""
    return [
        CandidateExperiment(f"release from {np.degrees(share * extreme):.3g}°", None, float(share * extreme))
        for extreme in (angles.max(), angles.min())
        for share in SHARES
    ]


def beginning(command: Command, duration: float) -> Command:
    """Return the rows of a command before ``duration`` (s)."""
    kept = command.time < duration
    return Command(command.time[kept], command.angle[kept])


def _shapes_around(centre: float, limits: CommandLimits, tops: Sequence[float]) -> Iterator[CandidateExperiment]:
    """Yield all shapes around one level."""
    room = min(limits.highest - centre, centre - limits.lowest)
    if room <= 0.0:
        return

    def made(description: str, rows: tuple[Floats, Floats]) -> CandidateExperiment:
        return CandidateExperiment(description + where, _after_rest(*rows, limits.home))

    where = "" if abs(centre) < 1e-9 else f" around {np.degrees(centre):.3g}°"
    there = np.array([1.0, 0.0, -1.0, 0.0])
    across = min(room, 0.5 * float(limits.changes[SHORT]))  # from side to side is twice the amplitude
    for share in SHARES:
        height, swing = share * room, share * across
        to, between = f"±{np.degrees(height):.3g}°", f"±{np.degrees(swing):.3g}°"
        for hold in HOLDS:
            held = f"each held for {hold:g} s on average"
            yield made(f"steps between {between}, {held}", _steps(centre + swing * there[::2], hold))
            yield made(f"steps to {to} and back, {held}", _steps(centre + height * there, hold))
        for period in PERIODS:
            yield made(f"triangle of {to} with a period of {period:g} s", _triangle(centre, height, period))
        for top in tops:
            sweep = f"chirp of {between} from {SLOWEST:g} Hz to {top:.3g} Hz in {SWEEP:g} s, repeated"
            yield made(sweep, _chirp(centre, swing, top))
    both = f"±{np.degrees(room):.3g}° and ±{np.degrees(SHARES[1] * room):.3g}°"
    heights = np.array([1.0, 0.0, SHARES[1], 0.0, -1.0, 0.0, -SHARES[1], 0.0])
    for hold in HOLDS[:2]:
        yield made(
            f"steps alternately to {both} and back, each held for {hold:g} s on average",
            _steps(centre + room * heights, hold),
        )
    for share in (0.1, 0.03):
        small = share * np.array([2.0, 1.0, 0.0, -1.0])
        levels = centre + room * np.concatenate([[1.0], small, [-1.0], -small])
        size, far = f"{np.degrees(share * room):.2g}°", f"{np.degrees(room):.3g}°"
        yield made(f"steps of {size} around one level, approached from {far} above and below", _steps(levels, 0.4))


def _steps(levels: Floats, hold: float) -> tuple[Floats, Floats]:
    """Repeat ``levels``; uneven holds make frames fall at all instants after a step."""
    shares = 0.7 + 0.6 * np.modf(0.618 * np.arange(int(2.0 * LONGEST / hold)))[0]
    time = np.concatenate([[0.0], np.cumsum(hold * shares)])
    return time, np.array([level for _, level in zip(time, cycle(levels), strict=False)])


def _smooth(shape: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    time = np.arange(0.0, LONGEST, UPDATE)
    return time, shape(time + 0.5 * UPDATE)  # at the middle of each update, so that the command neither leads nor lags


def _triangle(centre: float, amplitude: float, period: float) -> tuple[Floats, Floats]:
    return _smooth(lambda t: centre + amplitude * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * t / period)))


def _chirp(centre: float, amplitude: float, top: float) -> tuple[Floats, Floats]:
    def shape(time: Floats) -> Floats:
        since = np.mod(time, SWEEP)
        phase = (SLOWEST + (top - SLOWEST) * since / (2.0 * SWEEP)) * since
        return centre + amplitude * np.sin(2.0 * np.pi * phase)

    return _smooth(shape)


def _after_rest(time: Floats, level: Floats, home: float) -> Command:
    """Prepend a rest at home to a command, and round it as its file does."""
    rows = np.column_stack([np.append(0.0, REST + time), np.degrees(np.append(home, level))]).round(6)
    rows = rows[rows[:, 0] < LONGEST]
    return Command(rows[:, 0], np.radians(rows[:, 1]))


def _again(command: Command, start: float) -> Command:
    """Return the part of a recorded command from the start of its recording, s, on."""
    later = command.time > start
    time, angle = command.time[later] - start, command.angle[later]
    return beginning(Command(np.append(0.0, time), np.append(command.at(np.array([start])), angle)), LONGEST)


def _largest_changes(command: Command, end: float) -> Floats:
    """Return the largest change, rad, of a command within each of `WINDOWS`, sampled at the middle of each update."""
    count = max(2, round((end - min(float(command.time[0]), 0.0)) / UPDATE))
    level = command.at(np.asarray(end - UPDATE * (np.arange(count)[::-1] + 0.5)))
    spans = [maximum_filter1d(level, w + 1) - minimum_filter1d(level, w + 1) for w in WINDOWS]
    return np.array([span.max() for span in spans])
