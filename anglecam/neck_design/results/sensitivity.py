"""``anglecam neck sensitivity``: normalised sensitivities and the figures of Fig. 9's curves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from anglecam.neck.sensitivity import Figure9, Sensitivity, StepCurve
from anglecam.neck.variation import PARAMETERS
from anglecam.neck_design.render import Layout, Lines, Rows
from anglecam.neck_design.results.step import Step, step_of
from anglecam.neck_design.text import number, quantity
from anglecam.neck_design.units import INLINE, INTERNAL, Column, Unit

Percentage = Annotated[float, Unit("percent_per_percent", "%/%")]


@dataclass(frozen=True)
class SensitivityRow:
    """By how many per cent each figure changes when a quantity grows by one per cent; NaN where it has no slope."""

    symbol: Annotated[str, Column("% for 1 % of")]
    name: Annotated[str, Column("")]
    value: Annotated[float, Column("value", _value_text)]
    unit: str
    rise_time: Annotated[Percentage, Column("rise", 3)]
    overshoot: Annotated[Percentage, Column("overshoot", 3)]
    settling_time: Annotated[Percentage, Column("settling", 3)]
    steady_state: Annotated[Percentage, Column("gain", 3)]


def _value_text(row: SensitivityRow) -> str:
    return quantity(row.value, row.unit)


@dataclass(frozen=True)
class CurveRow:
    """A curve of Fig. 9."""

    value: float
    """Of the varied quantity, SI."""
    gamma: float
    stable: bool
    step: Annotated[Step, INLINE]
    steady_state: Annotated[float, Unit("deg_per_V", "°/V", math.degrees)]


@dataclass(frozen=True)
class PanelRows:
    """A panel of Fig. 9."""

    symbol: str
    unit: str
    curves: tuple[CurveRow, ...]


@dataclass(frozen=True)
class Sensitivities:
    """Result of ``anglecam neck sensitivity``."""

    sensitivities: tuple[SensitivityRow, ...]
    figure_9: tuple[PanelRows, ...]
    drawn: Annotated[Figure9, INTERNAL]
    """The curves of Fig. 9."""

    def tables(self) -> list[Layout]:
        """Return the sensitivities and a line for each curve of Fig. 9."""
        curves = [
            (
                f"{panel.symbol} = {quantity(curve.value, panel.unit)}",
                number(curve.gamma, 3),
                *curve.step.cells(),
                number(math.degrees(curve.steady_state), 2),
            )
            for panel in self.figure_9
            for curve in panel.curves
        ]
        headings = ("Fig. 9", "γ", "rise, s", "overshoot, %", "settling, s", "gain, °/V")
        return [Rows(self.sensitivities, words=2), Lines(headings, curves)]

    def remarks(self) -> tuple[str, ...]:
        """Return nothing: there is nothing to remark."""
        return ()


def sensitivities_of(rows: Sequence[Sensitivity], figure: Figure9) -> Sensitivities:
    """Return the results of `anglecam.neck.sensitivity` for the renderer.

    Parameters
    ----------
    rows : sequence of Sensitivity
        One for each quantity.
    figure : Figure9
        Curves of Fig. 9.

    Returns
    -------
    Sensitivities
        For the renderer and the figure.
    """
    return Sensitivities(
        sensitivities=tuple(
            SensitivityRow(
                row.symbol,
                PARAMETERS[row.symbol].name,
                row.value,
                PARAMETERS[row.symbol].unit,
                row.rise_time,
                row.overshoot,
                row.settling_time,
                row.steady_state,
            )
            for row in rows
        ),
        figure_9=tuple(
            PanelRows(panel.symbol, panel.unit, tuple(_curve_row(curve) for curve in panel.curves))
            for panel in figure.panels
        ),
        drawn=figure,
    )


def _curve_row(curve: StepCurve) -> CurveRow:
    return CurveRow(curve.value, curve.neck.gamma, curve.stable, step_of(curve.figures), curve.figures.steady_state)
