"""What a model runs through: the instants, commands and views of several recordings, joined end to end.

A compiled model runs through all of them in one call. Calls from Python, one for each recording, would take longer than
the integration where the recordings are short.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anglecam.data.camera_evidence import View
from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.typing import Floats


@dataclass(frozen=True)
class Runs:
    """The runs through R recordings with N frames in all."""

    time: Floats
    """(N,) instants, s; those of each run increase."""
    edges: NDArray[np.int64] = field(repr=False)
    """(R + 1,) where each run begins in ``time``, and the end."""
    commands: tuple[Command | None, ...]
    """The command of each run; ``None`` for a free swing."""
    views: tuple[View, ...]
    """How the camera views each run."""

    @property
    def first(self) -> Floats:
        """(R,) first instant of each run, s."""
        return self.time[self.edges[:-1]]

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """The frames of each run."""
        return tuple(slice(i, j) for i, j in pairwise(self.edges.tolist()))

    @cached_property
    def owner(self) -> NDArray[np.int64]:
        """(N,) number of the run that each frame belongs to."""
        return np.repeat(np.arange(len(self.parts)), np.diff(self.edges))

    @cached_property
    def played(self) -> tuple[tuple[Command | None, ...], NDArray[np.int64]]:
        """The different commands, and (R,) the number of each run's among them; windows of a recording share one."""
        different = {id(command): command for command in self.commands}
        numbers = {key: number for number, key in enumerate(different)}
        return tuple(different.values()), np.array([numbers[id(command)] for command in self.commands])

    def each(self, function: Callable[..., Floats], time: Floats, angle: Floats, values: Floats) -> Floats:
        """Return (N,) results of a function of (time, angle, values, view) that is called for each run."""
        return np.concatenate(
            [function(time[part], angle[part], values, view) for part, view in zip(self.parts, self.views, strict=True)]
        )

    def split(self, values: Floats) -> Iterator[Floats]:
        """Return the part of (N,) or (N, k) values that belongs to each run."""
        return (values[part] for part in self.parts)


def runs_of(records: Sequence[Record]) -> Runs:
    """Join recordings; a model runs through each from its first frame to its last."""
    return Runs(
        np.concatenate([r.time for r in records]),
        np.cumsum([0, *(len(r.time) for r in records)]),
        tuple(r.command for r in records),
        tuple(r.view for r in records),
    )


def one_run(time: Floats, command: Command | None, view: View) -> Runs:
    """Return a single run."""
    return Runs(time, np.array([0, len(time)]), (command,), (view,))
