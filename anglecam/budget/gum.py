"""The arithmetic of measurement uncertainty: terms combined by the GUM, and checked by Monte Carlo.

JCGM 100 (the GUM) adds the variances of the inputs, each multiplied by the square of its sensitivity, and widens the
result by Student's t for terms whose uncertainty is itself uncertain. JCGM 101 (its Supplement 1) draws the inputs and
propagates them through the model. If both agree within the stated digits, the GUM's result is validated. This module
does not depend on what is measured.
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
"""Coverage probability of every interval in this module."""
DIGITS = 2
"""Significant digits of a stated uncertainty (JCGM 100, 7.2.6)."""
_BLOCK = 10_000
"""Trials of one round: the larger of 100/(1 − p) and 10⁴ (JCGM 101, 7.9.4 b)."""
_MOST_TRIALS = 4_000_000
"""Largest number of trials. They leave an error of 0.3 % of the standard uncertainty; δ at two digits is never smaller
than 0.5 %."""
_NEAR = 0.008
"""Probability on either side over which an interval's width is smoothed."""
_ROUNDS = 3
"""Iterations that locate the minimum of the width, each around the last result."""
_VALIDATING = 5.0
"""Ratio of δ to the numerical error of the Monte Carlo that a validation requires (JCGM 101, 8.2)."""


@dataclass(frozen=True)
class Term:
    """The contribution of one input to the uncertainty of a result."""

    name: str
    """Name of the input's error."""
    unit: str
    """Unit of the input."""
    estimate: float
    """Best estimate of the input, in ``unit``; 0 for an error that is not corrected."""
    uncertainty: float
    """Standard uncertainty of the input, in ``unit``."""
    distribution: Distribution
    """Distribution that the input is assumed to have; normal with finite ``dof`` means Student's t."""
    sensitivity: float
    """Change of the result per unit of the input."""
    dof: float = math.inf
    """Degrees of freedom of ``uncertainty``; infinite if it is taken as known."""
    known: str = ""
    """What the uncertainty is known from, with its type of evaluation, A or B."""

    @property
    def contribution(self) -> float:
        """Standard uncertainty of the result due to this input, in the result's unit."""
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
    """Share of the variance that each term contributes; their sum is 1."""
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
    """The distribution of a result by Monte Carlo, in the unit of the drawn results."""

    estimate: float
    """Mean."""
    standard: float
    """Standard deviation."""
    low: float
    """Lower end of the shortest interval that contains 95 %."""
    high: float
    """Upper end of that interval."""
    trials: int
    error: float
    """Numerical error: twice the largest standard error of the mean, the standard deviation and both ends."""
    tolerance: float
    """Target for ``error``; ``error`` is larger only if the number of trials reached its limit."""
    density: Floats
    """(b,) probability density in equal bins between ``edges``."""
    edges: Floats
    """(b + 1,) edges of the bins."""


@dataclass(frozen=True)
class Comparison:
    """Comparison of the GUM's interval with the Monte Carlo interval (JCGM 101, clause 8)."""

    tolerance: float
    """δ: half a unit of the last stated digit of the standard uncertainty."""
    low: float
    """Distance between the lower ends."""
    high: float
    """Distance between the upper ends."""

    @property
    def agrees(self) -> bool:
        """Whether no distance is larger than δ, so that the GUM's interval is validated."""
        return max(self.low, self.high) <= self.tolerance


def combine(terms: Sequence[Term]) -> Combined:
    """Combine independent terms: root of the sum of squares, Welch–Satterthwaite, Student's t.

    Parameters
    ----------
    terms : sequence of Term
        Terms of one result, in its unit.

    Returns
    -------
    Combined
        u_c² = Σ (c·u)² (JCGM 100, Eq. 11a), ν = u_c⁴ / Σ (c·u)⁴/ν_i (Eq. G.2b), U = t(0.95, ν)·u_c (Eq. G.1d).
        ν is not truncated to an integer; t is interpolated (G.4.1).

    Examples
    --------
    >>> noise = Term("noise", "px", 0.0, 0.03, "normal", 0.1)
    >>> pivot = Term("pivot", "px", 0.0, 0.05, "normal", 0.08, dof=10.0)
    >>> total = combine([noise, pivot])
    >>> round(total.standard, 6), round(total.dof, 4), round(total.coverage_factor, 3)
    (0.005, 24.4141, 2.062)
    """
    contributions = np.array([t.contribution for t in terms])
    standard = float(np.sqrt((contributions**2).sum()))
    shares = (contributions / standard) ** 2 if standard > 0.0 else np.zeros(len(contributions))
    # Computed from shares, because the fourth power of a small angle would underflow.
    inverse_dof = float((shares**2 / np.array([t.dof for t in terms])).sum())
    dof = 1.0 / inverse_dof if inverse_dof > 0.0 else math.inf
    factor = coverage_factor(dof)
    return Combined(tuple(terms), tuple(map(float, shares)), standard, dof, factor, factor * standard)


def coverage_factor(dof: float) -> float:
    """Return k for 95 %: Student's t, or 1.960 if the degrees of freedom are infinite."""
    upper = (1.0 + COVERAGE) / 2.0
    return float(special.ndtri(upper) if math.isinf(dof) else special.stdtrit(dof, upper))


def widening(rng: np.random.Generator, dof: float, trials: int) -> Floats:
    """Draw factors that turn a normal error into Student's t: √(ν/χ²), or 1 if the degrees of freedom are infinite.

    Errors whose uncertainty was estimated together share one draw of the factor (JCGM 101, 6.4.9).
    """
    return np.ones(trials) if math.isinf(dof) else np.sqrt(dof / rng.chisquare(dof, trials))


def numerical_tolerance(uncertainty: float, digits: int = DIGITS) -> float:
    """Return δ, half a unit of the last significant digit of a standard uncertainty (JCGM 101, 7.9.2).

    Parameters
    ----------
    uncertainty : float
        Standard uncertainty in the unit in which it will be stated, because the digits are decimals of that unit.
    digits : int
        Number of significant digits.

    Returns
    -------
    float
        δ, in the same unit.

    Examples
    --------
    0.0237 is stated with two digits as 24·10⁻³:

    >>> numerical_tolerance(0.0237)
    0.0005
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
    """Draw results until their mean, standard deviation and 95 % interval have converged (JCGM 101, 7.9.4).

    Rounds of 10⁴ trials are added until twice the standard error over the rounds of each of these four numbers is at
    most a fifth of `numerical_tolerance`, as the comparison with the GUM requires (8.2).

    Parameters
    ----------
    draw : callable
        Called with a generator and a number m; returns (m,) results, in the unit in which they will be stated.
    seed : int
        Seed of the generator.
    digits : int
        Significant digits of the standard uncertainty that must converge.
    most : int
        Largest number of trials.

    Returns
    -------
    Propagated
        The distribution of all trials together.
    """
    rng = np.random.default_rng(seed)
    rounds: list[Floats] = []
    statistics: list[tuple[float, float, float, float]] = []
    sums = np.zeros(2)
    tolerance, error = 0.0, math.inf
    while error > tolerance and (len(rounds) + 1) * _BLOCK <= most:
        results = np.sort(draw(rng, _BLOCK))
        rounds.append(results)
        statistics.append((float(results.mean()), float(results.std(ddof=1)), *shortest_interval(results)))
        # Relative to the first result, because the square of a large angle would swamp a small uncertainty.
        difference = results - rounds[0][0]
        sums += difference.sum(), (difference**2).sum()
        if len(rounds) < 2:
            continue
        trials = len(rounds) * _BLOCK
        spread = math.sqrt(max(sums[1] - sums[0] ** 2 / trials, 0.0) / (trials - 1))
        tolerance = numerical_tolerance(spread, digits) / _VALIDATING
        error = 2.0 * float(np.std(statistics, axis=0, ddof=1).max()) / math.sqrt(len(statistics))
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
    """Return the ends of the shortest interval that contains 95 % of sorted values (JCGM 101, 5.3.4 and 7.7).

    The width of an interval hardly changes near the shortest one, so the smallest of many drawn widths is found
    anywhere near the minimum. A parabola fitted to the widths nearby locates the minimum. If there is no such minimum,
    because the distribution ends steeply, the smallest width is used.

    Parameters
    ----------
    values : ndarray
        (m,) in increasing order, m ≥ 100.

    Returns
    -------
    low, high : float
        Two of the values.

    Examples
    --------
    A density that falls from zero: the interval starts at zero and leaves out the upper tail.

    >>> low, high = shortest_interval(np.linspace(0.0, 1.0, 1001) ** 2)
    >>> low, round(high, 2)
    (0.0, 0.9)
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
    """Compare the GUM's 95 % interval with the Monte Carlo interval (JCGM 101, 8.1).

    Parameters
    ----------
    estimate : float
        The result y.
    combined : Combined
        Its uncertainty by the GUM, in the same unit as ``propagated``.
    propagated : Propagated
        Its distribution by Monte Carlo.
    digits : int
        Significant digits of the standard uncertainty, for δ.

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
