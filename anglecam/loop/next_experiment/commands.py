"""Commands that could be played next: a family of shapes, and the limits that recordings show a rig to stand.

Nothing is asked of a rig that it has not done before: a command stays within the range of commands that were seen,
and within any time goes no further than one of them has gone within that time. That limits steps and rates alike,
and fast chirps, which a limit on single steps would let through.
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
"""s; a servo takes a new position 50 times a second: smooth commands are stairs of this tread."""
REST = 0.5
"""s before anything moves; zero and noise of a recording are read there."""
LONGEST = 12.0
"""s; all candidates are this long, and periodic enough that a beginning of one is an experiment too."""
SWEEP = 3.5
"""s from a chirp's lowest frequency to its highest."""
SLOWEST = 0.3
"""Hz at which chirps begin."""
FASTEST = 0.2 / UPDATE
"""Hz beyond which the stairs of a chirp have fewer than five treads a period."""
WINDOWS = (1, 5, 25, 100)
"""Times, in updates, in which a command's way is compared with what was seen."""
SHORT = 2
"""Of `WINDOWS`, that in which a command may have gone from side to side."""
SHARES = (1.0, 0.3, 0.1)
"""Amplitudes, of what the range allows; an effect that grows with amplitude otherwise than its alias shows in two."""
HOLDS = (0.25, 0.6, 1.75)
"""s that a step is held, on average."""
PERIODS = (2.0, 4.0, 8.0)
"""s, of triangles."""


@dataclass(frozen=True)
class CommandLimits:
    """What commands a rig has been given, rad."""

    home: float
    """Where its recordings begin."""
    lowest: float
    highest: float
    ways: Floats
    """Furthest that a command went within each of `WINDOWS`."""

    def allow(self, command: Command) -> bool:
        """Say whether nothing is asked that was not asked before."""
        slack = 1e-6  # rad; commands are rounded to what their files hold
        inside = self.lowest - slack <= command.angle.min() and command.angle.max() <= self.highest + slack
        return bool(inside and np.all(_ways(command, command.time[-1] + UPDATE) <= self.ways + slack))


@dataclass(frozen=True)
class CandidateExperiment:
    """What could be recorded, `LONGEST` seconds of it."""

    description: str
    command: Command | None
    """``None`` for a free swing."""
    released: float | None = None
    """Angle that a free swing is let go from, rad."""


def limits_of(records: Sequence[Record]) -> CommandLimits:
    """Read the limits off the commands of recordings; at least one must have a command."""
    commands = [(r.command, float(r.time[-1])) for r in records if r.command is not None]
    levels = np.concatenate([c.angle[c.time <= end] if np.any(c.time <= end) else c.angle[:1] for c, end in commands])
    ways = np.max([_ways(c, end) for c, end in commands], axis=0)
    home = float(np.median([c.angle[0] for c, _ in commands]))
    return CommandLimits(home, float(levels.min()), float(levels.max()), ways)


def candidate_commands(records: Sequence[Record], natural_hz: float) -> list[CandidateExperiment]:
    """List what could be played next.

    Parameters
    ----------
    records : sequence of Record
        Of the rig; at least one with a command.
    natural_hz : float
        Undamped natural frequency, Hz; chirps rise to one half, one and two times this.

    Returns
    -------
    list of CandidateExperiment
        Shapes about where recordings begin and about the middle of the range, and what was played already, as far as
        the rig's `CommandLimits` and the camera's frame rate allow. Never empty.
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
    shaped = chain.from_iterable(_about(centre, limits, tops) for centre in centres)
    again = [
        CandidateExperiment(f"the command of {r.name} again", _again(r.command, float(r.time[0])))
        for r in records
        if r.command
    ]
    return [*again, *(c for c in shaped if c.command and limits.allow(c.command))]


def candidate_releases(angles: Floats) -> list[CandidateExperiment]:
    """List free swings from shares of the furthest ``angles`` (rad from equilibrium) that were seen, both ways."""
    return [
        CandidateExperiment(f"release from {np.degrees(share * extreme):.3g}°", None, float(share * extreme))
        for extreme in (angles.max(), angles.min())
        for share in SHARES
    ]


def beginning(command: Command, duration: float) -> Command:
    """Return the rows of a command before ``duration`` (s)."""
    kept = command.time < duration
    return Command(command.time[kept], command.angle[kept])


def _about(centre: float, limits: CommandLimits, tops: Sequence[float]) -> Iterator[CandidateExperiment]:
    """Make all shapes about one level."""
    room = min(limits.highest - centre, centre - limits.lowest)
    if room <= 0.0:
        return

    def made(description: str, rows: tuple[Floats, Floats]) -> CandidateExperiment:
        return CandidateExperiment(description + where, _after_rest(*rows, limits.home))

    where = "" if abs(centre) < 1e-9 else f" about {np.degrees(centre):.3g}°"
    there = np.array([1.0, 0.0, -1.0, 0.0])
    across = min(room, 0.5 * float(limits.ways[SHORT]))  # what swings from side to side goes twice its amplitude
    for share in SHARES:
        height, swing = share * room, share * across
        to, between = f"±{np.degrees(height):.3g}°", f"±{np.degrees(swing):.3g}°"
        for hold in HOLDS:
            held = f"each held about {hold:g} s"
            yield made(f"steps between {between}, {held}", _steps(centre + swing * there[::2], hold))
            yield made(f"steps to {to} and back, {held}", _steps(centre + height * there, hold))
        for period in PERIODS:
            yield made(f"triangle of {to} with a period of {period:g} s", _triangle(centre, height, period))
        for top in tops:
            sweep = f"chirp of {between} from {SLOWEST:g} Hz to {top:.3g} Hz in {SWEEP:g} s, over and over"
            yield made(sweep, _chirp(centre, swing, top))
    both = f"±{np.degrees(room):.3g}° and ±{np.degrees(SHARES[1] * room):.3g}°"
    heights = np.array([1.0, 0.0, SHARES[1], 0.0, -1.0, 0.0, -SHARES[1], 0.0])
    for hold in HOLDS[:2]:
        yield made(
            f"steps to {both} by turns and back, each held about {hold:g} s", _steps(centre + room * heights, hold)
        )
    for share in (0.1, 0.03):
        small = share * np.array([2.0, 1.0, 0.0, -1.0])
        levels = centre + room * np.concatenate([[1.0], small, [-1.0], -small])
        size, far = f"{np.degrees(share * room):.2g}°", f"{np.degrees(room):.3g}°"
        yield made(f"steps of {size} about one level, reached from {far} above and below", _steps(levels, 0.4))


def _steps(levels: Floats, hold: float) -> tuple[Floats, Floats]:
    """Go through ``levels`` again and again; uneven holds let frames fall at all instants after a step."""
    shares = 0.7 + 0.6 * np.modf(0.618 * np.arange(int(2.0 * LONGEST / hold)))[0]
    time = np.concatenate([[0.0], np.cumsum(hold * shares)])
    return time, np.array([level for _, level in zip(time, cycle(levels), strict=False)])


def _smooth(shape: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    time = np.arange(0.0, LONGEST, UPDATE)
    return time, shape(time + 0.5 * UPDATE)  # the middle of each tread, so that the stairs neither lead nor lag


def _triangle(centre: float, amplitude: float, period: float) -> tuple[Floats, Floats]:
    return _smooth(lambda t: centre + amplitude * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * t / period)))


def _chirp(centre: float, amplitude: float, top: float) -> tuple[Floats, Floats]:
    def shape(time: Floats) -> Floats:
        since = np.mod(time, SWEEP)
        phase = (SLOWEST + (top - SLOWEST) * since / (2.0 * SWEEP)) * since
        return centre + amplitude * np.sin(2.0 * np.pi * phase)

    return _smooth(shape)


def _after_rest(time: Floats, level: Floats, home: float) -> Command:
    """Put a rest at home before rows, and round them to what a command file holds."""
    rows = np.column_stack([np.append(0.0, REST + time), np.degrees(np.append(home, level))]).round(6)
    rows = rows[rows[:, 0] < LONGEST]
    return Command(rows[:, 0], np.radians(rows[:, 1]))


def _again(command: Command, start: float) -> Command:
    """Let a command that was played begin with its recording."""
    later = command.time > start
    time, angle = command.time[later] - start, command.angle[later]
    return beginning(Command(np.append(0.0, time), np.append(command.at(np.array([start])), angle)), LONGEST)


def _ways(command: Command, end: float) -> Floats:
    """Return how far, rad, a command goes within each of `WINDOWS`; looked up in the middle of each update."""
    count = max(2, round((end - min(float(command.time[0]), 0.0)) / UPDATE))
    level = command.at(np.asarray(end - UPDATE * (np.arange(count)[::-1] + 0.5)))
    spans = [maximum_filter1d(level, w + 1) - minimum_filter1d(level, w + 1) for w in WINDOWS]
    return np.array([span.max() for span in spans])
