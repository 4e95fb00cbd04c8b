"""The common style of all figures, and the plot of a measured clip; drawn with matplotlib."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")  # draws without a display

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from anglecam.data.series import AngleSeries
from anglecam.errors import printable

MEASURED, BEFORE, AFTER, COMMAND, FAINT = "#1b1f24", "#c4432b", "#1f6f8b", "#9aa3ad", "#d9dee3"
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
    """Draw a measured clip: the angle over time with its 6 px bound, its sigma, and the frames without an angle.

    Parameters
    ----------
    series : AngleSeries
        The measured series.
    path : Path
        A PNG file.
    """
    with plt.rc_context(STYLE):
        figure, (top, bottom) = plt.subplots(
            2, 1, figsize=(9, 5), sharex=True, height_ratios=(3, 1), layout="constrained"
        )
        degrees = np.degrees(series.angle)
        bound = np.degrees(series.bounds.get(6.0, np.full(len(degrees), np.nan)))
        top.fill_between(series.time, degrees - bound, degrees + bound, color=FAINT, label="6 px bound, worst case")
        top.plot(series.time, degrees, color=MEASURED, lw=1.0, marker=".", ms=3, label="angle")
        lost = ~series.ok
        if lost.any():
            for t in series.time[lost]:
                top.axvline(t, color=BEFORE, lw=0.6, alpha=0.5)
            top.plot([], [], color=BEFORE, lw=0.6, label=f"no angle: {lost.sum()} of {len(lost)} frames")
        top.set(ylabel="angle from neutral, °")
        top.set_title(printable(series.name), parse_math=False)
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper right", ncols=3, fontsize=8)
        bottom.plot(series.time, np.degrees(series.sigma), color=AFTER, lw=1.0)
        bottom.set(xlabel="time on the clip's clock, s", ylabel="sigma, °", ylim=(0.0, None))
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=110, format="png")
        plt.close(figure)


def _svg(figure: Figure) -> str:
    """Return a figure as an ``<svg>`` element whose text is reproducible, and close the figure."""
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    plt.close(figure)
    return text.getvalue()[text.getvalue().index("<svg") :]
