"""What a long computation is doing, for whoever waits for it.

A function that takes long receives a `Progress` and calls it with each `Stage` as it begins, and where it can count,
again as it advances. Whoever shows the stages (command line, page) need not know the computation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Stage:
    """A part of a computation that has begun, and how far it is."""

    name: str
    """What is being done, in words such as ``measuring``."""
    done: int = 0
    """Frames, or whatever is counted, that are done."""
    total: int | None = None
    """Their number in all; ``None`` where it is not known, or nothing is counted."""
    of: str = ""
    """The recording that it is done with; empty where it is done with all."""

    @property
    def title(self) -> str:
        """What is done, and with which recording."""
        return f"{self.of}: {self.name}" if self.of else self.name


Progress: TypeAlias = Callable[[Stage], None]


def unseen(stage: Stage) -> None:
    """Take a stage, for a computation that nobody watches."""


def counted(progress: Progress, name: str, total: int | None) -> Callable[[int], None]:
    """Begin a stage, and return what is called with the number of frames done.

    Examples
    --------
    >>> seen = []
    >>> done = counted(seen.append, "measuring", 40)
    >>> done(25)
    >>> [(stage.name, stage.done, stage.total) for stage in seen]
    [('measuring', 0, 40), ('measuring', 25, 40)]
    """
    progress(Stage(name, 0, total))
    return lambda done: progress(Stage(name, done, total))


def within(progress: Progress, recording: str) -> Progress:
    """Return a `Progress` whose stages are those of one recording."""
    return lambda stage: progress(replace(stage, of=recording))


def watched(items: Iterable[T], progress: Progress, name: str, total: int | None) -> Iterator[T]:
    """Yield items, such as the frames of a film, and report how many of them are done."""
    done = counted(progress, name, total)
    for number, item in enumerate(items, start=1):
        yield item
        done(number)
