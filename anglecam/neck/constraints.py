"""Constrained design: what must hold, how far each limit is, and which cannot be met.

Sequential quadratic programming (Kraft's SLSQP) from several starts, because what a mechanism can do is not convex.
Where no start ends with every constraint met, the design is sought that misses the most missed one by least; and for
each that is still missed, whether it alone stands against the wish: whether all the others can be met without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from anglecam.data.typing import Floats

TOLERANCE = 1e-4
"""Of a constraint's scale, by which it may be missed and still be met, and within which it is active."""
_DRAWN_STARTS = 8
_NEAREST = 3
"""Ends that are taken up again where none is feasible."""
SHOWN = {"rad": (np.degrees(1.0), "°"), "share": (100.0, "%"), "1": (1.0, "")}
"""Units that a person reads otherwise than they are held: factor and unit."""
_NOTHING = 1e-9
"""In the units of constraints: what an optimiser leaves of zero."""
_WORST = 1e3
"""Scales beyond which a miss is no longer told apart; a system that is not stable has no figures at all."""


@dataclass(frozen=True)
class Constraint:
    """One limit and where the design stands to it."""

    name: str
    unit: str
    value: float
    limit: float
    at_least: bool
    """Whether the limit is the least value instead of the largest."""
    scale: float
    """What a miss of it is measured by, in its unit."""

    @property
    def slack(self) -> float:
        """Distance from the limit on the allowed side, in scales; negative where it is missed."""
        way = float((self.value - self.limit) / self.scale)
        way = way if self.at_least else -way
        # asked for tens of thousands of times: NumPy is slow with single numbers
        return -_WORST if math.isnan(way) else min(max(way, -_WORST), _WORST)

    @property
    def met(self) -> bool:
        """Whether it holds."""
        return self.slack >= -TOLERANCE

    @property
    def active(self) -> bool:
        """Whether the design lies on it: it would move if the limit did."""
        return abs(self.slack) <= TOLERANCE

    def __str__(self) -> str:
        sign = "≥" if self.at_least else "≤"
        return f"{self.name} {sign} {shown(self.limit, self.unit)}"


def shown(value: float, unit: str) -> str:
    """Write a constraint's value or limit as a person reads it: degrees, per cent, no sign of a rounding error."""
    factor, spoken = SHOWN.get(unit, (1.0, unit))
    seen = factor * value if abs(value) > _NOTHING else 0.0
    return f"{seen:.4g} {spoken}".strip().replace("-", "−")


@dataclass(frozen=True)
class Optimum:
    """The best design found."""

    at: Floats
    """(n,) variables."""
    constraints: tuple[Constraint, ...]
    """There."""
    unmet: tuple[str, ...]
    """A line for each constraint that is missed there, with the numbers there; empty where the design is feasible."""

    @property
    def feasible(self) -> bool:
        """Whether every constraint is met."""
        return all(c.met for c in self.constraints)


Evaluate = Callable[[Floats], tuple[float, tuple[Constraint, ...]]]


def least(evaluate: Evaluate, lower: Floats, upper: Floats, starts: Sequence[Floats], *, seed: int = 0) -> Optimum:
    """Find the variables of least cost that meet every constraint.

    Parameters
    ----------
    evaluate : callable
        From (n,) variables to a cost and the constraints, always the same ones in the same order.
    lower, upper : (n,) ndarray
        Bounds.
    starts : sequence of (n,) ndarray
        Where to begin; more are drawn between the bounds.
    seed : int
        Of those drawn.

    Returns
    -------
    Optimum
        Of the starts that end with every constraint met the cheapest; where none does, the nearest miss.
    """
    from scipy.stats import qmc  # takes most of a second to load, which who asks for nothing of a wish is spared

    problem = _Problem(evaluate, lower, upper)
    drawn = qmc.scale(qmc.Sobol(len(lower), rng=seed).random(_DRAWN_STARTS), lower, upper)
    begins = [np.clip(s, lower, upper) for s in starts] + list(drawn)
    ends = [problem.cheapest(s) for s in begins]
    good = [x for x in ends if problem.short(x) <= TOLERANCE]
    if good:
        best = min(good, key=lambda x: problem.at(x)[0])
        return Optimum(best, problem.at(best)[1], ())
    ends = sorted(ends, key=problem.short)[:_NEAREST]
    near = min((problem.nearest(s) for s in ends), key=problem.short)
    if problem.short(near) <= TOLERANCE:
        best = min((near, problem.cheapest(near)), key=problem.short)
        return Optimum(best, problem.at(best)[1], ())
    there = problem.at(near)[1]
    missed = [i for i, c in enumerate(there) if c.slack < -TOLERANCE]
    unmet = []
    for i in missed:
        furthest = problem.at(problem.nearest(near, i))[1]
        others = max((-c.slack for j, c in enumerate(furthest) if j != i), default=0.0)
        why = "while all else holds" if others <= 10.0 * TOLERANCE else "together with the others"
        unmet.append(f"{there[i]} cannot be met {why} (nearest found: {shown(there[i].value, there[i].unit)})")
    return Optimum(near, there, tuple(unmet))


class _Problem:
    """The functions that SLSQP asks for, each point evaluated once."""

    def __init__(self, evaluate: Evaluate, lower: Floats, upper: Floats) -> None:
        self._evaluate, self._bounds = evaluate, list(zip(lower, upper, strict=True))
        self._seen: dict[bytes, tuple[float, tuple[Constraint, ...]]] = {}

    def at(self, x: Floats) -> tuple[float, tuple[Constraint, ...]]:
        key = np.asarray(x, dtype=float).tobytes()
        if key not in self._seen:
            self._seen[key] = self._evaluate(np.asarray(x, dtype=float))
        return self._seen[key]

    def slacks(self, x: Floats) -> Floats:
        return np.array([c.slack for c in self.at(x)[1]])

    def short(self, x: Floats) -> float:
        """Return by how much the most missed constraint is missed, in scales."""
        return max(0.0, float(-self.slacks(x).min()))

    def cheapest(self, start: Floats) -> Floats:
        """Minimise the cost where every slack is positive."""
        found = minimize(
            lambda x: self.at(x)[0],
            start,
            method="SLSQP",
            bounds=self._bounds,
            constraints={"type": "ineq", "fun": self.slacks},
            options={"maxiter": 200, "ftol": 1e-10},
        )
        return np.clip(found.x, *np.transpose(self._bounds))

    def nearest(self, start: Floats, only: int | None = None) -> Floats:
        """Minimise the largest miss, or that of one constraint while the others are met."""
        held = np.ones(len(self.slacks(start))) if only is None else np.eye(len(self.slacks(start)))[only]
        first = max(0.0, float(-(self.slacks(start) * held).min()))
        found = minimize(
            lambda xt: xt[-1],
            np.append(start, first),
            method="SLSQP",
            bounds=[*self._bounds, (0.0, None)],
            constraints={"type": "ineq", "fun": lambda xt: self.slacks(xt[:-1]) + held * xt[-1]},
            options={"maxiter": 60, "ftol": 1e-8},
        )
        return np.clip(found.x[:-1], *np.transpose(self._bounds))
