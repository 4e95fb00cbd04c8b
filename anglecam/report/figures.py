"""The common style of all figures, and the plot of a measured clip; drawn with matplotlib."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")  # draws without a display

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anglecam.data.series import AngleSeries
from anglecam.errors import printable

MEASURED, BEFORE, AFTER, COMMAND, FAINT = "#1b1f24", "#c4432b", "#1f6f8b", "#9aa3ad", "#d9dee3"
SHADE = "#bcd7e2"
"""Of the interval in which an angle lies."""
PANEL = (5.2, 2.3)
"""Size of one panel of a page, inches; small enough that its text can be read on a narrow screen."""
LEGEND_COLUMNS = 3
NORMAL_95 = 1.96
"""Standard uncertainties from the middle to the end of a 95 % interval."""
STYLE: Any = {
    "font.size": 9,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#eceff2",
    "axes.edgecolor": "#8a939c",
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "anglecam",
}


def plot_series(series: AngleSeries, path: Path) -> None:
    """Draw a measured clip over time: angle, sigma, velocity and acceleration, and the frames without an angle.

    The angle is shaded with the 95 % interval of the random part of its uncertainty. The legend states the common part
    as a scale. Velocity and acceleration are drawn where they are known.

    Parameters
    ----------
    series : AngleSeries
        The measured series.
    path : Path
        A PNG file.
    """
    with plt.rc_context(STYLE):
        rates = [] if series.derivatives is None else [("velocity", "°/s"), ("acceleration", "°/s²")]
        heights = (3, 1, *(1.5 for _ in rates))
        figure, (top, second, *others) = plt.subplots(
            len(heights), 1, figsize=(9, 1.25 * sum(heights)), sharex=True, height_ratios=heights, layout="constrained"
        )
        _draw_angle(top, series)
        top.set_ylabel("angle from neutral, °")
        top.set_title(printable(series.name), parse_math=False)
        _draw_sigma(second, series)
        for axes, (name, unit) in zip(others, rates, strict=True):
            _draw_derivative(axes, series, name)
            axes.set_ylabel(f"{name}, {unit}")
        figure.legend(*_labels(top, second), loc="outside upper right", ncols=3, fontsize=8)
        (top, second, *others)[-1].set_xlabel("time on the clip's clock, s")
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=110, format="png")
        plt.close(figure)


def _labels(*axes: Axes) -> tuple[list[Artist], list[str]]:
    """Return handles and labels of several axes for one legend."""
    each = [one.get_legend_handles_labels() for one in axes]
    return [handle for handles, _ in each for handle in handles], [label for _, labels in each for label in labels]


def angle_panel(series: AngleSeries) -> str:
    """Draw the angle over time with its 95 % interval, as SVG."""
    return panel("angle, °", lambda axes: _draw_angle(axes, series))


def sigma_panel(series: AngleSeries) -> str:
    """Draw the standard uncertainty over time, as SVG."""
    return panel("σ, °", lambda axes: _draw_sigma(axes, series))


def derivative_panel(series: AngleSeries, name: str, unit: str) -> str:
    """Draw ``velocity`` or ``acceleration`` over time with its 95 % interval, as SVG; ``unit`` is °/s or °/s²."""
    return panel(f"{name}, {unit}", lambda axes: _draw_derivative(axes, series, name))


def panel(ylabel: str, draw: Callable[[Axes], None], xlabel: str = "time, s") -> str:
    """Return one panel of a page as SVG, with the legend that its curves need."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=PANEL)
        draw(axes)
        axes.set(xlabel=xlabel, ylabel=ylabel)
        handles, texts = axes.get_legend_handles_labels()
        rows = -(-len(handles) // LEGEND_COLUMNS) if len(handles) > 1 else 0
        if rows:
            figure.legend(handles, texts, loc="upper left", ncols=LEGEND_COLUMNS, fontsize=8)
        # fixed margins, because working out a layout takes as long as drawing
        figure.subplots_adjust(left=0.15, right=0.98, bottom=0.2, top=0.95 - 0.08 * rows)
        return _svg(figure)


def _draw_angle(axes: Axes, series: AngleSeries) -> None:
    parted = series.sigma_random is not None
    shaded = series.sigma if series.sigma_random is None else series.sigma_random
    degrees, half = np.degrees(series.angle), NORMAL_95 * np.degrees(shaded)
    if np.isfinite(half).any():
        share = series.common_share
        common = f"; scale uncertain by {100.0 * share:.2g} %" if np.isfinite(share) else ""
        label = f"95 % interval of the random part{common}" if parted else "95 % interval (1.96 σ)"
        axes.fill_between(series.time, degrees - half, degrees + half, color=SHADE, label=label)
    axes.plot(series.time, degrees, color=MEASURED, lw=1.0, marker=".", ms=2, label="angle")
    lost = ~series.ok
    for t in series.time[lost]:
        axes.axvline(t, color=BEFORE, lw=0.6, alpha=0.5)
    if lost.any():
        axes.plot([], [], color=BEFORE, lw=0.6, label=f"no angle: {lost.sum()} of {len(lost)} frames")


def _draw_sigma(axes: Axes, series: AngleSeries) -> None:
    if series.sigma_random is None:
        axes.plot(series.time, np.degrees(series.sigma), color=AFTER, lw=1.0)
    else:
        axes.plot(series.time, np.degrees(series.sigma_common), color=COMMAND, lw=1.0, label="common part")
        axes.plot(series.time, np.degrees(series.sigma_random), color=AFTER, lw=1.0, label="random part")
    axes.set(ylabel="σ, °", ylim=(0.0, None))


def _draw_derivative(axes: Axes, series: AngleSeries, name: str) -> None:
    value, sigma = (np.degrees(getattr(series.derivatives, field)) for field in (name, f"{name}_sigma"))
    half = NORMAL_95 * sigma
    axes.fill_between(series.time, value - half, value + half, color=SHADE)
    axes.plot(series.time, value, color=MEASURED, lw=1.0)


def _svg(figure: Figure) -> str:
    """Return a figure as an ``<svg>`` element whose text is reproducible, and close the figure."""
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    plt.close(figure)
    return text.getvalue()[text.getvalue().index("<svg") :]
