"""Constrained optimisation of a design: constraints, distance to each limit, and constraints that cannot be met.

Sequential quadratic programming (Kraft's SLSQP) runs from several starts, because the feasible set of a mechanism is
not convex. Where no start ends with every constraint met, the largest violation is minimised instead. For each
constraint that is still violated, a further run determines whether all the others can be met without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from anglecam.data.typing import Floats

TOLERANCE = 1e-4
"""Share of a constraint's scale: a smaller violation counts as met, a smaller distance from the limit as active."""
_DRAWN_STARTS = 8
"""Starts drawn between the bounds, a power of two for the Sobol sequence."""
_NEAREST = 3
"""Number of end points from which the violation is minimised where none is feasible."""
SHOWN = {"rad": (np.degrees(1.0), "°"), "share": (100.0, "%"), "1": (1.0, "")}
"""Units that are printed differently: factor and printed unit."""
_NOTHING = 1e-9
"""Values below this are printed as zero: the optimiser's remainder, in the units of the constraints."""
_WORST = 1e3
"""Largest slack, in scales; an unstable system, which has no step figures, gets this violation."""


@dataclass(frozen=True)
class Constraint:
    """A limit and the design's value for it."""

    name: str
    unit: str
    value: float
    limit: float
    at_least: bool
    """True if the limit is a minimum, false if it is a maximum."""
    scale: float
    """Unit in which a violation is measured, in the constraint's unit."""

    @property
    def slack(self) -> float:
        """Distance from the limit, in scales; positive on the allowed side."""
        above = float((self.value - self.limit) / self.scale)
        slack = above if self.at_least else -above
        # evaluated tens of thousands of times, and NumPy is slow with single numbers
        return -_WORST if math.isnan(slack) else min(max(slack, -_WORST), _WORST)

    @property
    def met(self) -> bool:
        """Whether the constraint holds."""
        return self.slack >= -TOLERANCE

    @property
    def active(self) -> bool:
        """Whether the design lies on the limit, so that it would move with the limit."""
        return abs(self.slack) <= TOLERANCE

    def __str__(self) -> str:
        sign = "≥" if self.at_least else "≤"
        return f"{self.name} {sign} {shown(self.limit, self.unit)}"


def shown(value: float, unit: str) -> str:
    """Write a constraint's value or limit for a reader: in degrees or per cent, and zero without a sign."""
    factor, printed = SHOWN.get(unit, (1.0, unit))
    cleaned = factor * value if abs(value) > _NOTHING else 0.0
    return f"{cleaned:.4g} {printed}".strip().replace("-", "−")


@dataclass(frozen=True)
class Optimum:
    """The best design found."""

    at: Floats
    """(n,) variables."""
    constraints: tuple[Constraint, ...]
    """At these variables."""
    unmet: tuple[str, ...]
    """A line for each constraint that is violated there, with its numbers; empty if the design is feasible."""

    @property
    def feasible(self) -> bool:
        """Whether every constraint is met."""
        return all(c.met for c in self.constraints)


Evaluate = Callable[[Floats], tuple[float, tuple[Constraint, ...]]]


def least(evaluate: Evaluate, lower: Floats, upper: Floats, starts: Sequence[Floats], *, seed: int = 0) -> Optimum:
    """Return the variables of least cost that meet every constraint.

    Parameters
    ----------
    evaluate : callable
        From (n,) variables to the cost and the constraints, always the same constraints in the same order.
    lower, upper : (n,) ndarray
        Bounds.
    starts : sequence of (n,) ndarray
        Initial values; more are drawn between the bounds.
    seed : int
        Seed of the drawn starts.

    Returns
    -------
    Optimum
        The cheapest of the results that meet every constraint; if none does, the result with the smallest violation.
    """
    from scipy.stats import qmc  # takes most of a second to load, which only a synthesis needs

    problem = _Problem(evaluate, lower, upper)
    drawn = qmc.scale(qmc.Sobol(len(lower), rng=seed).random(_DRAWN_STARTS), lower, upper)
    begins = [np.clip(s, lower, upper) for s in starts] + list(drawn)
    ends = [problem.cheapest(s) for s in begins]
    good = [x for x in ends if problem.violation(x) <= TOLERANCE]
    if good:
        best = min(good, key=lambda x: problem.at(x)[0])
        return Optimum(best, problem.at(best)[1], ())
    ends = sorted(ends, key=problem.violation)[:_NEAREST]
    near = min((problem.nearest(s) for s in ends), key=problem.violation)
    if problem.violation(near) <= TOLERANCE:
        best = min((near, problem.cheapest(near)), key=problem.violation)
        return Optimum(best, problem.at(best)[1], ())
    there = problem.at(near)[1]
    violated = [i for i, c in enumerate(there) if c.slack < -TOLERANCE]
    unmet = []
    for i in violated:
        furthest = problem.at(problem.nearest(near, i))[1]
        others = max((-c.slack for j, c in enumerate(furthest) if j != i), default=0.0)
        why = "while all else holds" if others <= 10.0 * TOLERANCE else "together with the others"
        unmet.append(f"{there[i]} cannot be met {why} (nearest found: {shown(there[i].value, there[i].unit)})")
    return Optimum(near, there, tuple(unmet))


class _Problem:
    """Cost and slacks for SLSQP; each point is evaluated once."""

    def __init__(self, evaluate: Evaluate, lower: Floats, upper: Floats) -> None:
        self._evaluate, self._bounds = evaluate, list(zip(lower, upper, strict=True))
        self._cache: dict[bytes, tuple[float, tuple[Constraint, ...]]] = {}

    def at(self, x: Floats) -> tuple[float, tuple[Constraint, ...]]:
        key = np.asarray(x, dtype=float).tobytes()
        if key not in self._cache:
            self._cache[key] = self._evaluate(np.asarray(x, dtype=float))
        return self._cache[key]

    def slacks(self, x: Floats) -> Floats:
        return np.array([c.slack for c in self.at(x)[1]])

    def violation(self, x: Floats) -> float:
        """Return the largest violation, in scales; 0 where every constraint is met."""
        return max(0.0, float(-self.slacks(x).min()))

    def cheapest(self, start: Floats) -> Floats:
        """Minimise the cost subject to every slack being positive."""
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
        """Minimise the largest violation, or that of one constraint while the others are met."""
        relaxed = np.ones(len(self.slacks(start))) if only is None else np.eye(len(self.slacks(start)))[only]
        first = max(0.0, float(-(self.slacks(start) * relaxed).min()))
        found = minimize(
            lambda xt: xt[-1],
            np.append(start, first),
            method="SLSQP",
            bounds=[*self._bounds, (0.0, None)],
            constraints={"type": "ineq", "fun": lambda xt: self.slacks(xt[:-1]) + relaxed * xt[-1]},
            options={"maxiter": 60, "ftol": 1e-8},
        )
        return np.clip(found.x[:-1], *np.transpose(self._bounds))
