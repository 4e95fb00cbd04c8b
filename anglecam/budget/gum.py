"""The arithmetic of measurement uncertainty: terms joined by the GUM, and checked by drawing.

JCGM 100 (the GUM) adds the variances of the inputs, each times the square of its sensitivity, and widens the result
by Student's t for what its terms are not sure of. JCGM 101 (its Supplement 1) draws the inputs and looks at what the
model makes of them; where both agree within the digits that are stated, the shorter way is valid. Nothing here knows
what is measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import special

from anglecam.data.typing import Floats

Distribution = Literal["normal", "uniform"]

COVERAGE = 0.95
"""Probability of every coverage interval here."""
DIGITS = 2
"""Significant digits of a stated uncertainty (JCGM 100, 7.2.6)."""
_BLOCK = 10_000
"""Trials of one round: the larger of 100/(1 − p) and 10⁴ (JCGM 101, 7.9.4 b)."""
_MOST_TRIALS = 4_000_000
"""Leaves an error of 0.3 % of the standard uncertainty; δ at two digits is never smaller than 0.5 %."""
_NEAR = 0.008
"""Probability on either side over which an interval's width is smoothed."""
_ROUNDS = 3
"""In which the trough's middle is looked for about the one before."""
_VALIDATING = 5.0
"""To validate, the drawing must be this many times surer than the tolerance (JCGM 101, 8.2)."""


@dataclass(frozen=True)
class Term:
    """One input's part in the uncertainty of a result."""

    name: str
    """What errs."""
    unit: str
    """Of the input."""
    estimate: float
    """Best estimate of the input, in ``unit``; 0 for an error that is not corrected."""
    uncertainty: float
    """Standard uncertainty of the input, in ``unit``."""
    distribution: Distribution
    """What the input is taken to be distributed like; normal with finite ``dof`` means Student's t."""
    sensitivity: float
    """Change of the result for a unit of the input."""
    dof: float = math.inf
    """Degrees of freedom of ``uncertainty``; infinite where it is taken as known."""
    known: str = ""
    """How the uncertainty is known."""

    @property
    def contribution(self) -> float:
        """Standard uncertainty that the input brings to the result, in the result's unit."""
        return abs(self.sensitivity) * self.uncertainty

    @property
    def shape(self) -> str:
        """The distribution's name as a budget states it."""
        return self.distribution if self.distribution != "normal" or math.isinf(self.dof) else "Student's t"


@dataclass(frozen=True)
class Combined:
    """The uncertainty of a result by the GUM, in the result's unit."""

    terms: tuple[Term, ...]
    shares: tuple[float, ...]
    """Part of the variance that each term brings; 1 in sum."""
    standard: float
    """Combined standard uncertainty."""
    dof: float
    """Effective degrees of freedom."""
    coverage_factor: float
    """k."""
    expanded: float
    """Expanded uncertainty U = k·u for 95 %."""


@dataclass(frozen=True)
class Propagated:
    """The distribution of a result as drawn, in the unit that it was drawn in."""

    estimate: float
    """Mean."""
    standard: float
    """Standard deviation."""
    low: float
    """Lower end of the shortest interval that holds 95 %."""
    high: float
    """Upper end."""
    trials: int
    error: float
    """Twice the largest standard error of mean, standard deviation and both ends, as more trials would move them."""
    tolerance: float
    """What ``error`` was to reach; it is larger only where the trials came to an end before."""
    density: Floats
    """(b,) density in equal bins between ``edges``."""
    edges: Floats
    """(b + 1,)."""


@dataclass(frozen=True)
class Comparison:
    """Whether the GUM's interval is the drawn one (JCGM 101, clause 8)."""

    tolerance: float
    """δ: half a unit of the last stated digit of the standard uncertainty."""
    low: float
    """Distance of the lower ends."""
    high: float
    """Distance of the upper ends."""

    @property
    def agrees(self) -> bool:
        """Whether neither distance is larger than δ."""
        return max(self.low, self.high) <= self.tolerance


def combine(terms: Sequence[Term]) -> Combined:
    """Join independent terms: root of the sum of squares, Welch–Satterthwaite, Student's t.

    Parameters
    ----------
    terms : sequence of Term
        Of one result, in its unit.

    Returns
    -------
    Combined
        u_c² = Σ (c·u)² (JCGM 100, Eq. 11a), ν = u_c⁴ / Σ (c·u)⁴/ν_i (Eq. G.2b), U = t(0.95, ν)·u_c (Eq. G.1d).
        ν is not cut to an integer; t is interpolated (G.4.1).
    """
    parts = np.array([t.contribution for t in terms])
    standard = float(np.sqrt((parts**2).sum()))
    shares = (parts / standard) ** 2 if standard > 0.0 else np.zeros(len(parts))
    # Through shares, because fourth powers of small angles leave the range of numbers in which they can be divided.
    doubt = float((shares**2 / np.array([t.dof for t in terms])).sum())
    dof = 1.0 / doubt if doubt > 0.0 else math.inf
    factor = coverage_factor(dof)
    return Combined(tuple(terms), tuple(map(float, shares)), standard, dof, factor, factor * standard)


def coverage_factor(dof: float) -> float:
    """Return k for 95 %: Student's t, 1.960 where the degrees of freedom are infinite."""
    upper = (1.0 + COVERAGE) / 2.0
    return float(special.ndtri(upper) if math.isinf(dof) else special.stdtrit(dof, upper))


def widening(rng: np.random.Generator, dof: float, trials: int) -> Floats:
    """Draw what turns a normal error into Student's t: √(ν/χ²), 1 where the degrees of freedom are infinite.

    Errors whose uncertainty was estimated together share one draw of it (JCGM 101, 6.4.9).
    """
    return np.ones(trials) if math.isinf(dof) else np.sqrt(dof / rng.chisquare(dof, trials))


def numerical_tolerance(uncertainty: float, digits: int = DIGITS) -> float:
    """Return δ, half a unit of the last significant digit of a standard uncertainty (JCGM 101, 7.9.2).

    Parameters
    ----------
    uncertainty : float
        In the unit in which it will be stated: the digits counted are decimal ones of that unit.
    digits : int
        Significant ones.

    Returns
    -------
    float
        For 0.0237 and two digits, 24·10⁻³, it is 0.0005.
    """
    if uncertainty <= 0.0:
        return 0.0
    place = math.floor(math.log10(uncertainty)) - digits + 1
    if round(uncertainty / 10.0**place) == 10**digits:  # 0.0999 is stated as 0.10
        place += 1
    return 0.5 * 10.0**place


def propagate(
    draw: Callable[[np.random.Generator, int], Floats], *, seed: int = 0, digits: int = DIGITS, most: int = _MOST_TRIALS
) -> Propagated:
    """Draw results until their mean, standard deviation and 95 % interval stand still (JCGM 101, 7.9.4).

    Rounds of 10⁴ trials are added until twice the standard error of all four over the rounds is at most a fifth of
    `numerical_tolerance`, which is what the comparison with the GUM asks for (8.2).

    Parameters
    ----------
    draw : callable
        Called with a generator and a number m; returns (m,) results, in the unit in which they will be stated.
    seed : int
        Of the generator.
    digits : int
        Significant digits of the standard uncertainty that count.
    most : int
        Trials after which it ends in any case.

    Returns
    -------
    Propagated
        From all trials together.
    """
    rng = np.random.default_rng(seed)
    rounds: list[Floats] = []
    told: list[tuple[float, float, float, float]] = []
    sums = np.zeros(2)
    tolerance, error = 0.0, math.inf
    while error > tolerance and (len(rounds) + 1) * _BLOCK <= most:
        results = np.sort(draw(rng, _BLOCK))
        rounds.append(results)
        told.append((float(results.mean()), float(results.std(ddof=1)), *shortest_interval(results)))
        # About the first result, lest the squares of a large angle swallow a small uncertainty.
        off = results - rounds[0][0]
        sums += off.sum(), (off**2).sum()
        if len(rounds) < 2:
            continue
        trials = len(rounds) * _BLOCK
        spread = math.sqrt(max(sums[1] - sums[0] ** 2 / trials, 0.0) / (trials - 1))
        tolerance = numerical_tolerance(spread, digits) / _VALIDATING
        error = 2.0 * float(np.std(told, axis=0, ddof=1).max()) / math.sqrt(len(told))
    values = np.sort(np.concatenate(rounds))
    low, high = shortest_interval(values)
    reach = np.quantile(values, [0.0005, 0.9995])
    density, edges = np.histogram(values, bins=80, range=(reach[0], max(reach[1], np.nextafter(reach[0], np.inf))))
    return Propagated(
        estimate=float(values.mean()),
        standard=float(values.std(ddof=1)),
        low=low,
        high=high,
        trials=len(values),
        error=error,
        tolerance=tolerance,
        density=density / (len(values) * np.diff(edges)),
        edges=edges,
    )


def shortest_interval(values: Floats) -> tuple[float, float]:
    """Return the ends of the shortest interval that holds 95 % of sorted values (JCGM 101, 5.3.4 and 7.7).

    The width of an interval hardly changes near the shortest one, so the least of many drawn widths lies anywhere
    about it. A parabola through the widths nearby finds the middle of the trough; where there is none, because the
    distribution ends steeply, the least width stands.

    Parameters
    ----------
    values : ndarray
        (m,) in increasing order, m ≥ 100.

    Returns
    -------
    low, high : float
        Two of the values.
    """
    held = round(COVERAGE * len(values))
    width = values[held:] - values[:-held]
    first, near = int(np.argmin(width)), round(_NEAR * len(values))
    for _ in range(_ROUNDS):
        start, stop = first - near, first + near + 1
        if start < 0 or stop > len(width):
            break
        at = np.linspace(-1.0, 1.0, 2 * near + 1)
        bend, slope, _ = np.polynomial.Polynomial.fit(at, width[start:stop], 2, domain=[-1, 1]).coef[::-1]
        if bend <= 0.0:
            break
        first += round(near * float(np.clip(-slope / (2.0 * bend), -1.0, 1.0)))
    first = min(max(first, 0), len(width) - 1)
    return float(values[first]), float(values[first + held])


def compare(estimate: float, combined: Combined, propagated: Propagated, digits: int = DIGITS) -> Comparison:
    """Compare the GUM's 95 % interval with the drawn one (JCGM 101, 8.1).

    Parameters
    ----------
    estimate : float
        The result y.
    combined : Combined
        Its uncertainty by the GUM, in the same unit as ``propagated``.
    propagated : Propagated
        Its distribution as drawn.
    digits : int
        Significant digits of the standard uncertainty that count.

    Returns
    -------
    Comparison
        The distances |y − U − low| and |y + U − high|, and δ.
    """
    return Comparison(
        numerical_tolerance(combined.standard, digits),
        abs(estimate - combined.expanded - propagated.low),
        abs(estimate + combined.expanded - propagated.high),
    )
