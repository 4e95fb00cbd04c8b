"""The figure of a torque of free form: the function with its band, and how often its quantities were visited."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from anglecam.data.typing import Floats
from anglecam.loop.free_form.result import FreeForm
from anglecam.loop.verdict_json import FACTORS
from anglecam.report.figures import AFTER, COMMAND, FAINT, NORMAL_95, PANEL, STYLE, _svg

LABELS = {
    "angle": "angle, °",
    "velocity": "velocity, °/s",
    "command": "command, °",
    "phase": "phase, share of the period",
    "time": "time, s",
}

COLOURED = 0.98
"""Share of the time in which the torque is within the scale of colours."""


def free_form_figures(found: FreeForm) -> list[str]:
    """Draw the function as a curve over one quantity, or as colours over two and the width of its band beside it."""
    band = found.band
    points = [x * FACTORS[name] for name, x in zip(band.over, band.points, strict=True)]
    value, half = np.degrees(band.acceleration), NORMAL_95 * np.degrees(band.sigma)
    labels = [LABELS[name] for name in band.over]
    if len(points) == 1:
        return [_curve(points[0], value, half, band.visited, labels[0])]
    return [
        _colours(points, value, band.visited, labels, "missing torque, °/s²", "RdBu_r"),
        _colours(points, half, band.visited, labels, "half of the 95 % band, °/s²", "Greys"),
    ]


def _curve(x: Floats, value: Floats, half: Floats, visited: Floats, label: str) -> str:
    with plt.rc_context(STYLE):
        figure, (top, bottom) = plt.subplots(
            2, 1, figsize=(PANEL[0], 3.6), sharex=True, height_ratios=(4, 1), layout="constrained"
        )
        top.fill_between(x, value - half, value + half, color=FAINT, label="95 % band")
        top.plot(x, value, color=AFTER, lw=1.4, label="missing torque")
        top.set_ylabel("torque, °/s²")
        bottom.fill_between(x, 100.0 * visited, step="mid", color=COMMAND)
        bottom.set(xlabel=label, ylabel="% of time")
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=2, fontsize=8)
        return _svg(figure)


def _colours(
    points: Sequence[Floats], shown: Floats, visited: Floats, labels: Sequence[str], title: str, colours: str
) -> str:
    """Draw values as colours, with zero in the middle of a scale of two colours.

    The scale ends where `COLOURED` of the time is spent below; a single far value would make all others pale.
    """
    order = np.argsort(np.abs(shown))
    below = np.cumsum(visited[order]) / np.sum(visited)
    most = float(np.abs(shown)[order][min(int(np.searchsorted(below, COLOURED)), len(order) - 1)])
    with plt.rc_context(STYLE):
        figure, ax = plt.subplots(figsize=(PANEL[0], 3.6), layout="constrained")
        least = -most if colours == "RdBu_r" else 0.0
        size = 20.0 + 600.0 * np.sqrt(visited)
        drawn = ax.scatter(
            points[0], points[1], c=shown, s=size, cmap=colours, vmin=least, vmax=most, edgecolors=FAINT, linewidths=0.5
        )
        beyond = bool(np.max(np.abs(shown)) > most)
        ends = ("both" if least else "max") if beyond else "neither"
        label = f"scale of {100.0 * COLOURED:g} % of the time" if beyond else None
        figure.colorbar(drawn, ax=ax, extend=ends, label=label)
        ax.set_title(title + "; larger where visited longer", loc="left", fontsize=8)
        ax.set(xlabel=labels[0], ylabel=labels[1])
        return _svg(figure)
