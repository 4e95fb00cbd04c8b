"""Constraints of an optimised design, with value, limit and whether they are met."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from anglecam.neck.constraints import Constraint, shown
from anglecam.neck_design.render import Lines
from anglecam.neck_design.text import rounded
from anglecam.neck_design.units import INTERNAL


@dataclass(frozen=True)
class ConstraintRow:
    """One constraint."""

    name: str
    unit: str
    value: float
    limit: float
    """Infinite where the constraint was not required."""
    sense: str
    """``≥`` or ``≤``."""
    met: bool
    active: bool
    """Whether the design lies on the limit."""
    cells: Annotated[tuple[str, str, str, str], INTERNAL]
    """As a table shows it."""


def constraint_row(constraint: Constraint) -> ConstraintRow:
    """Return a constraint with its text."""
    sense = "≥" if constraint.at_least else "≤"
    value, limit = (shown(rounded(number), constraint.unit) for number in (constraint.value, constraint.limit))
    state = "missed" if not constraint.met else "met, binds" if constraint.active else "met"
    required = math.isfinite(constraint.limit)
    return ConstraintRow(
        name=constraint.name,
        unit=constraint.unit,
        value=constraint.value,
        limit=constraint.limit,
        sense=sense,
        met=constraint.met,
        active=constraint.active,
        cells=(constraint.name, value, f"{sense} {limit}" if required else "–", state if required else "not asked"),
    )


def constraint_table(rows: Sequence[ConstraintRow]) -> Lines:
    """Return the table of constraints."""
    return Lines(("constraint", "here", "limit", ""), [row.cells for row in rows])
