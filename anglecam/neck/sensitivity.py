"""Sensitivity of the neck's step response to its quantities: Fig. 9, and normalised sensitivities.

Each panel steps the input of Eq. (28) with one quantity changed and the others from Table 5. The text varies h by
0.4 V/rad, K_m by 0.7 mN·m/A, R_a by 0.5 Ω, G_a from 5 to 1000 ("a five order of magnitude difference", though it is
2.3), and L6 with L3 and γ following. Eq. (35) fails within the range of G_a: with the paper's spring and h = 1.4 V/rad
the neck is unstable from G_a = 113, so that the curve for 1000 diverges and has no figures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.step_figures import StepFigures
from anglecam.data.typing import Floats
from anglecam.neck.fourbar import FourBar, crank_reach, head_angle
from anglecam.neck.linear import LinearNeck, linear_neck
from anglecam.neck.parameters import PAPER, NeckParameters
from anglecam.neck.step import linear_step, linear_step_figures
from anglecam.neck.variation import PARAMETERS, NeckQuantity

FIG_9: dict[str, tuple[float, ...]] = {
    "h": (1.0, 1.4, 1.8),
    "K_m": (2.6e-3, 3.3e-3, 4.0e-3),
    "G_a": (5.0, 37.0, 100.0, 1000.0),
    "R_a": (0.5, 1.0, 1.5),
    "L_6": (0.053, 0.056, 0.059, 0.062, 0.065),
}
"""Values of panels a to e, SI. The steps are from the text, except those of L6, which the paper does not print."""
FIGURES = ("rise_time", "overshoot", "settling_time", "steady_state")
"""Step figures whose sensitivity is computed."""
_STEP = 1e-4
"""Step of the logarithm of a quantity in central differences."""
_KINK = 0.01
"""Largest difference of the one-sided slopes, relative to the slope or to 1; beyond it there is no derivative."""
_SMALL_OVERSHOOT = 1e-9
"""A figure below this counts as zero and has no logarithm."""


@dataclass(frozen=True)
class StepCurve:
    """The step response for one value of the quantity."""

    value: float
    """Of the quantity, SI."""
    neck: NeckParameters
    linear: LinearNeck
    angle: Floats
    """(n,) Δθ, rad."""
    figures: StepFigures
    """With the steady state in rad/V; NaN if the neck is unstable."""

    @property
    def stable(self) -> bool:
        """Whether the neck comes to rest: Eq. (35) holds and the damping is positive."""
        return min(self.linear.stiffness, self.linear.damping) > 0.0


@dataclass(frozen=True)
class Panel:
    """One quantity varied: a panel of Fig. 9."""

    symbol: str
    name: str
    unit: str
    time: Floats
    """(n,) s from the step."""
    curves: tuple[StepCurve, ...]
    """In the order of the values."""


@dataclass(frozen=True)
class LinkageCurve:
    """θ_f(θ_s) of one linkage, Fig. 9 (f)."""

    linkage: FourBar
    gamma: float
    """Slope of the fitted line."""
    theta_s: Floats
    """(m,) rad."""
    theta_f: Floats
    """(m,) rad; NaN where the links do not close."""


@dataclass(frozen=True)
class Figure9:
    """All six panels."""

    panels: tuple[Panel, ...]
    """a to e: h, K_m, G_a, R_a, L6."""
    linkages: tuple[LinkageCurve, ...]
    """f: a curve for each L6 of panel e."""
    height: float
    """Of the step, V."""


@dataclass(frozen=True)
class Sensitivity:
    """∂ln(figure)/∂ln(quantity): change of a figure in per cent when the quantity grows by one per cent."""

    symbol: str
    value: float
    """Of the quantity, SI."""
    rise_time: float
    overshoot: float
    settling_time: float
    steady_state: float
    """NaN where a figure is zero or has a kink, as for L6 where the nod meets the end of the links' reach."""


def figure_9(neck: NeckParameters = PAPER, *, duration: float = 0.6, height: float = 1.0) -> Figure9:
    """Return the step responses of Fig. 9.

    Parameters
    ----------
    neck : NeckParameters
        The neck whose quantities are varied.
    duration : float
        s.
    height : float
        Of the step, V.

    Returns
    -------
    Figure9
        Ready to plot.
    """
    time = np.linspace(0.0, duration, 601)
    panels = tuple(vary(neck, symbol, values, time, height) for symbol, values in FIG_9.items())
    servo = np.radians(np.arange(50.0, 250.0 + 0.25, 0.5))  # Fig. 4's range
    linkages = tuple(
        LinkageCurve(c.neck.linkage, c.neck.gamma, servo, _where_closed(c.neck.linkage, servo))
        for c in panels[-1].curves
    )
    return Figure9(panels, linkages, height)


def vary(neck: NeckParameters, symbol: str, values: Sequence[float], time: ArrayLike, height: float = 1.0) -> Panel:
    """Return the step responses for several values of one quantity.

    Parameters
    ----------
    neck : NeckParameters
        With the values of the other quantities.
    symbol : str
        In `anglecam.neck.variation.PARAMETERS`.
    values : sequence of float
        SI.
    time : (n,) array_like
        Instants from the step, s.
    height : float
        Of the step, V.

    Returns
    -------
    Panel
        A curve for each value.

    Raises
    ------
    ValueError
        For an unknown symbol, or a link that cannot be closed.
    """
    parameter, instants = _parameter(symbol), np.asarray(time, dtype=float)
    curves = []
    for value in values:
        made = parameter.changed(neck, value)
        linear = linear_neck(made)
        above, below = [linear.c], [1.0, linear.a, linear.b]
        angle = height * linear_step(above, below, instants)
        curves.append(StepCurve(value, made, linear, angle, linear_step_figures(above, below)))
    return Panel(symbol, parameter.name, parameter.unit, instants, tuple(curves))


def sensitivities(neck: NeckParameters = PAPER, symbols: Sequence[str] = tuple(PARAMETERS)) -> tuple[Sensitivity, ...]:
    """Return the normalised sensitivity of each figure to each quantity.

    Parameters
    ----------
    neck : NeckParameters
        A stable neck, at which the derivatives are taken.
    symbols : sequence of str
        In `anglecam.neck.variation.PARAMETERS`.

    Returns
    -------
    tuple of Sensitivity
        In the order of the symbols, by central differences of exact figures.

    Raises
    ------
    ValueError
        For an unknown symbol or a neck that is not stable.
    """
    if math.isnan(_figures(neck)[0]):
        raise ValueError("the neck is unstable, Eq. (35): its response has no figures")
    rows = []
    for symbol in symbols:
        parameter = _parameter(symbol)
        value = parameter.read(neck)
        # the unchanged value goes through `changed` too, because an L6 that is set replaces γ by the fitted one
        low, middle, high = (_figures(parameter.changed(neck, value * math.exp(s))) for s in (-_STEP, 0.0, _STEP))
        rows.append(Sensitivity(symbol, value, *(_slope(*v) for v in zip(low, middle, high, strict=True))))
    return tuple(rows)


def _slope(low: float, middle: float, high: float) -> float:
    """Return the logarithmic derivative; NaN where there is none."""
    if not min(low, middle, high) > _SMALL_OVERSHOOT:
        return math.nan
    before, after = math.log(middle / low) / _STEP, math.log(high / middle) / _STEP
    slope = (before + after) / 2.0
    return slope if abs(after - before) <= _KINK * max(1.0, abs(slope)) else math.nan


def _figures(neck: NeckParameters) -> tuple[float, ...]:
    linear = linear_neck(neck)
    figures = linear_step_figures([linear.c], [1.0, linear.a, linear.b])
    return tuple(float(getattr(figures, name)) for name in FIGURES)


def _parameter(symbol: str) -> NeckQuantity:
    if symbol not in PARAMETERS:
        raise ValueError(f"no parameter {symbol}; there are {', '.join(PARAMETERS)}")
    return PARAMETERS[symbol]


def _where_closed(linkage: FourBar, theta_s: Floats) -> Floats:
    """Return θ_f; NaN where the links do not close."""
    low, high = crank_reach(linkage)
    from_line = np.abs(np.arctan2(np.sin(theta_s), np.cos(theta_s)))
    closed = (from_line >= low) & (from_line <= high)
    theta_f = np.full(len(theta_s), np.nan)
    theta_f[closed] = head_angle(linkage, theta_s[closed])
    return theta_f
