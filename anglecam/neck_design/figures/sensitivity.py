"""Figure of ``anglecam neck sensitivity``: Fig. 9."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from anglecam.neck_design.figures.style import SERIES, save, signed
from anglecam.neck_design.results.sensitivity import Sensitivities
from anglecam.report.figures import STYLE

_DECADES = 30.0
"""Ratio of the highest to the lowest curve of a panel from which on the axis is logarithmic."""


def sensitivity_figure(result: Sensitivities, path: Path) -> None:
    """Draw Fig. 9 a-f: step responses with one quantity varied, and θ_f over θ_s for each L6."""
    figure_9 = result.drawn
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(3, 2, figsize=(9, 9.5), layout="constrained")
        for letter, axes, panel in zip("abcde", grid.flat, figure_9.panels, strict=False):
            scale, unit = _readable(panel.unit)
            for curve, colour in zip(panel.curves, SERIES, strict=False):
                label = f"{scale * curve.value:g}{unit}" + ("" if curve.stable else ", unstable")
                if panel.symbol == "L_6":
                    label += f", γ = {signed(curve.neck.gamma, 2)}"
                axes.plot(panel.time, np.degrees(curve.angle), color=colour, lw=1.3, label=label)
            axes.set(xlabel="time, s", ylabel="Δθ, °", title=f"({letter}) {panel.name} {_symbol(panel.symbol)}")
            tops = [float(np.degrees(c.angle.max())) for c in panel.curves if c.stable]
            if max(tops) > _DECADES * min(tops):
                axes.set(yscale="log", ylim=(0.2 * min(tops), 30.0 * max(tops)))
            else:
                axes.set_ylim(0.0, 1.5 * max(tops))  # the legend stands above the curves
            axes.legend(loc="upper left" if axes.get_yscale() == "linear" else "upper right", ncols=2, fontsize=7.5)
        axes = grid.flat[5]
        for curve, link, colour in zip(figure_9.panels[-1].curves, figure_9.linkages, SERIES, strict=False):
            label = f"$L_6$ = {1e3 * curve.value:g} mm, γ = {signed(link.gamma, 2)}"
            axes.plot(np.degrees(link.theta_s), np.degrees(link.theta_f), color=colour, lw=1.3, label=label)
        axes.set(
            xlabel="servo angle $\\theta_s$, °", ylabel="head angle $\\theta_f$, °", title="(f) links that go with (e)"
        )
        axes.legend(loc="upper right", fontsize=7.5)
        figure.suptitle(f"Step of {figure_9.height:g} V, one quantity varied (Fig. 9)")
        save(figure, path)


def _readable(unit: str) -> tuple[float, str]:
    """Return the factor and the unit with which a quantity of Fig. 9 has few digits."""
    if unit in ("m", "N·m/A"):
        return 1e3, f" m{unit}"
    return 1.0, "" if unit == "1" else f" {unit}"


def _symbol(symbol: str) -> str:
    """Write a symbol with its index as a subscript."""
    letter, _, index = symbol.partition("_")
    return f"${letter}_{{{index}}}$" if index else f"${letter}$"
