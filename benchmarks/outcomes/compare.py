"""What changed between stored rows and new ones, worse first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from benchmarks.outcomes.case import Row

GRADES = (
    "right", "fewer frames", "vague", "refused", "sigma small", "wrong", "internal error", "timeout", "died",
)  # fmt: skip
"""From the best to the worst."""
WORSE = ("outcome", "error", "error/sigma", "rows ok", "CPU")
"""Kinds of change that can be worse, the most serious first."""
COST = frozenset({"cpu_s", "yardstick_s", "peak_mib", "kernels_compiled", "commit", "date"})
"""What may differ although the result is the same."""


@dataclass(frozen=True)
class Factors:
    """Changes smaller than these factors are not reported."""

    figure: float
    """Of errors, of error/sigma, of the share of rows and of the size of an effect."""
    cpu: float
    """Of CPU time, as a multiple of the yardstick's in the same process."""


@dataclass(frozen=True)
class Change:
    """One figure of one film or session."""

    name: str
    kind: str
    before: str
    after: str
    growth: float
    """How much worse, from 0 on: grades, or the logarithm of a factor; below 0 it is better, 0 where neither."""

    @property
    def worse(self) -> bool:
        """Whether it is a loss."""
        return self.growth > 0.0


def grade(row: Row) -> str:
    """Return how good an outcome is: the verdict where the truth decides it, else whether there is a result."""
    return row.get("verdict") or ("right" if row["status"] == "ok" else row["status"])


def same(before: Row, after: Row) -> bool:
    """Return whether two rows state the same result, to the last digit."""
    return {k: v for k, v in before.items() if k not in COST} == {k: v for k, v in after.items() if k not in COST}


def changes(stored: Mapping[str, Row], measured: Mapping[str, Row], factors: Factors) -> list[Change]:
    """Return what differs by more than the factors in rows that both have, worse first, the better last."""
    found = [
        change
        for name, after in measured.items()
        if name in stored
        for change in _of_row(name, stored[name], after, factors)
    ]
    return sorted(found, key=_place)


def _place(change: Change) -> tuple[int, int, float]:
    kind = WORSE.index(change.kind) if change.kind in WORSE else len(WORSE)
    return (0 if change.worse else 1 if change.growth == 0.0 else 2, kind, -change.growth)


def _of_row(name: str, before: Row, after: Row, factors: Factors) -> Iterator[Change]:
    if grade(before) != grade(after):
        shown = (": ".join(filter(None, (grade(row), row.get("message")))) for row in (before, after))
        yield Change(name, "outcome", *shown, float(GRADES.index(grade(after)) - GRADES.index(grade(before))))
    least = math.log(factors.figure)
    for kind, key, worse in (
        ("error", "error_deg", lambda a, b: math.log(b / a)),
        ("error/sigma", "error_over_sigma", lambda a, b: abs(math.log(b)) - abs(math.log(a))),
        ("rows ok", "ok_share", lambda a, b: math.log(a / b)),
    ):
        a, b = before.get(key), after.get(key)
        if a and b and abs(growth := worse(a, b)) > least:
            yield Change(name, kind, f"{a:.4g}", f"{b:.4g}", growth)
    a, b = (row["cpu_s"] / row["yardstick_s"] if row.get("cpu_s") else None for row in (before, after))
    if a and b and abs(growth := math.log(b / a)) > math.log(factors.cpu):
        yield Change(
            name, "CPU", *(f"{row['cpu_s']:.3g} s at {row['yardstick_s']:.2g} s" for row in (before, after)), growth
        )
    for kind, key in (
        ("verdict of the loop", "loop_verdict"),
        ("message", "message"),
        ("hash of the film", "film"),
        ("hash of the session", "session"),
    ):
        a, b = before.get(key), after.get(key)
        if a != b and a is not None and b is not None and not (kind == "message" and grade(before) != grade(after)):
            yield Change(name, kind, str(a), str(b), 0.0)
    yield from _of_effects(name, before, after, least)


def _of_effects(name: str, before: Row, after: Row, least: float) -> Iterator[Change]:
    """Yield other effects, or other sizes of the same ones; whether that is worse the error decides."""
    a, b = before.get("effects"), after.get("effects")
    if a is None or b is None or a == b:
        return
    if list(a) != list(b):
        yield Change(name, "effects", " + ".join(a) or "none", " + ".join(b) or "none", 0.0)
        return
    for effect in a:
        first = next(iter(a[effect]))
        was, now = a[effect][first]["value"], b[effect][first]["value"]
        if not (was * now > 0.0 and abs(math.log(now / was)) <= least):
            yield Change(name, f"{effect}, {first}", f"{was:.4g}", f"{now:.4g}", 0.0)


def table(found: list[Change]) -> str:
    """Return the changes as a table in Markdown."""
    rows = ["| | film | what | before | now |", "| --- | --- | --- | --- | --- |"]
    for one in found:
        cells = ("worse" if one.worse else "better" if one.growth < 0.0 else "", one.name, one.kind)
        rows.append(f"| {' | '.join((*cells, one.before, one.after))} |")
    return "\n".join(rows)


def summary(name: str, stored: Mapping[str, Row], measured: Mapping[str, Row], found: list[Change]) -> str:
    """Return the counts of one set in a line."""
    both = [one for one in stored if one in measured]
    equal = sum(same(stored[one], measured[one]) for one in both)
    worse = len({change.name for change in found if change.worse})
    better = len({change.name for change in found if change.growth < 0.0} - {c.name for c in found if c.worse})
    return (
        f"{name}: {len(both)} of {len(stored)} stored rows measured again, {equal} with the same result to the last "
        f"digit, {worse} worse, {better} better"
    )
