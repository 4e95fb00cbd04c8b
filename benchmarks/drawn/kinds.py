"""All kinds of mechanism, by name."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.drawn import arms, levers, sticks, swinging, turning
from benchmarks.drawn.mechanism import Mechanism, Stage

KINDS: dict[str, Callable[[Stage], Mechanism]] = {
    **swinging.KINDS,
    **sticks.KINDS,
    **turning.KINDS,
    **levers.KINDS,
    **arms.KINDS,
}
