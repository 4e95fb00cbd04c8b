"""Numbers as text in the tables of ``anglecam neck``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from anglecam.neck.correlated import UncertainValue
from anglecam.neck.turning import KGF_CM

_EXACT = 1e-12
"""A relative standard uncertainty below this is rounding of the arithmetic: the value counts as exact."""
_OPTIMISER_ZERO = 1e-9
"""In the units of gains: what an optimiser leaves where the answer is zero."""


def rounded(value: float) -> float:
    """Round to 12 significant digits: further digits are rounding errors of the arithmetic."""
    return float(f"{value:.12g}")


def number(value: float | None, digits: int) -> str:
    """Write a number with a fixed number of decimals.

    Parameters
    ----------
    value : float or None
        To write.
    digits : int
        After the point.

    Returns
    -------
    str
        A dash for None and NaN, and no sign for a value that rounds to zero.
    """
    if value is None or not math.isfinite(value):
        return "∞" if value == math.inf else "–"
    return f"{round(rounded(float(value)), digits) + 0.0:.{digits}f}".replace("-", "−")


def degrees(angle: float, digits: int = 2) -> str:
    """Write an angle, rad, in degrees with its sign °."""
    return f"{number(math.degrees(angle), digits)}°"


def degree_range(ends: Sequence[float], digits: int = 2) -> str:
    """Write a range of angles, rad, in degrees."""
    return f"{degrees(ends[0], digits)} … {degrees(ends[1], digits)}"


def quantity(value: float, unit: str) -> str:
    """Write a quantity of any magnitude with four significant digits and its unit; unit ``"1"`` is left out."""
    return f"{rounded(value):.4g}{'' if unit == '1' else ' ' + unit}".replace("-", "−")


def with_sigma(uncertain: UncertainValue) -> str:
    """Write a value to the second digit of its standard uncertainty, or to four digits where it counts as exact."""
    value, sigma = rounded(uncertain.value), rounded(uncertain.sigma)
    if not _EXACT * abs(value) < sigma < math.inf:
        return f"{value:.4g}".replace("-", "−")
    digits = max(0, 1 - math.floor(math.log10(sigma)))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}".replace("-", "−")


def torque(newton_metres: float) -> str:
    """Write a torque, N·m, in N·m and in the paper's kgf·cm."""
    return f"{rounded(newton_metres):.3g} N·m ({rounded(newton_metres / KGF_CM):.3g} kgf·cm)"


def gain(value: float) -> str:
    """Write a controller gain with three significant digits; zero where an optimiser left almost nothing."""
    return f"{rounded(without_remainder(value)):.3g}"


def without_remainder(value: float) -> float:
    """Return zero for the remainder that an optimiser leaves where the answer is zero."""
    return value if abs(value) > _OPTIMISER_ZERO else 0.0


def cell(value: Any, how: int | str) -> str:
    """Write a table cell: a number of digits for a float, a format specification for anything else."""
    if isinstance(how, int):
        return number(value, how)
    return format(value, how)
