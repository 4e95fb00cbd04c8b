"""The figures of the report and the plot beside every measured clip, drawn with matplotlib."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")  # no screen

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anglecam.estimate.output_error import Fit
from anglecam.estimate.record import Record
from anglecam.loop.close import Verdict
from anglecam.series import AngleSeries

Floats = NDArray[np.float64]

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
    """Draw a measured clip: angle over time with its 6 px bound, its sigma, and the frames without an angle.

    Parameters
    ----------
    series : AngleSeries
        What was measured.
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
        top.set(ylabel="angle from neutral, °", title=series.name)
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper right", ncols=3, fontsize=8)
        bottom.plot(series.time, np.degrees(series.sigma), color=AFTER, lw=1.0)
        bottom.set(xlabel="time on the clip's clock, s", ylabel="sigma, °", ylim=(0.0, None))
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=110)
        plt.close(figure)


def prediction_figure(records: Sequence[Record], fit: Fit, label: str) -> str:
    """Draw measured against predicted angle, a panel for each recording, as SVG."""
    paths = [r.angle - e for r, e in zip(records, fit.residuals, strict=True)]

    def draw(axes: Axes, i: int) -> None:
        record = records[i]
        if record.command is not None:
            inside = (record.command.time > record.time[0]) & (record.command.time < record.time[-1])
            knots = np.concatenate([record.time[:1], record.command.time[inside], record.time[-1:]])
            held = np.degrees(record.command.at(knots))
            axes.step(knots, held, where="post", color=COMMAND, lw=0.8, label="command")
        axes.plot(record.time, np.degrees(record.angle), ".", color=MEASURED, ms=2.5, label="measured")
        axes.plot(record.time, np.degrees(paths[i]), color=BEFORE, lw=1.0, label=label)
        axes.set_ylabel("angle, °")

    return _panels(records, draw, 1.7)


def residual_figure(records: Sequence[Record], fits: dict[str, Fit], floor: float) -> str:
    """Draw what models leave over, a panel for each recording, with the band of the noise (rad), as SVG.

    Parameters
    ----------
    records : sequence of Record
        What was fitted or predicted.
    fits : dict of str to Fit
        By label, ``before`` or ``after``.
    floor : float
        Standard deviation of the noise, rad.

    Returns
    -------
    str
        An ``<svg>`` element.
    """
    colours = {"before": BEFORE, "after": AFTER}

    def draw(axes: Axes, i: int) -> None:
        axes.axhspan(-2 * np.degrees(floor), 2 * np.degrees(floor), color=FAINT, zorder=0, label="noise, ±2σ")
        for label, fit in fits.items():
            axes.plot(records[i].time, np.degrees(fit.residuals[i]), color=colours[label], lw=0.9, label=label)
        axes.set_ylabel("residual, °")

    return _panels(records, draw, 1.5)


def shape_figure(verdict: Verdict) -> str:
    """Draw the final model's residual against angle, velocity, command and time, as SVG."""
    records, fit = verdict.fitted, verdict.after
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 4, figsize=(10, 2.6), sharey=True, layout="constrained")
        for record, error in zip(records, fit.residuals, strict=True):
            path = record.angle - error
            against = (
                np.degrees(path),
                np.degrees(np.gradient(path, record.time)),
                np.zeros(len(path)) if record.command is None else np.degrees(record.command.at(record.time)),
                record.time,
            )
            for ax, x in zip(axes, against, strict=True):
                ax.plot(x, np.degrees(error), ".", ms=2, color=AFTER, alpha=0.5)
        for ax, name in zip(axes, ("angle, °", "velocity, °/s", "command, °", "time, s"), strict=True):
            ax.set_xlabel(name)
        axes[0].set_ylabel("residual, °")
        return _svg(figure)


def candidate_figure(verdict: Verdict) -> str:
    """Draw the evidence for every candidate, as SVG."""
    with plt.rc_context(STYLE):
        names = [c.effect.id for c in verdict.candidates][::-1]
        gains = [max(c.log_likelihood_gain, 0.0) for c in verdict.candidates][::-1]
        held = [max(c.held_out_gain, 0.0) for c in verdict.candidates][::-1]
        figure, ax = plt.subplots(figsize=(7, 0.5 + 0.45 * len(names)), layout="constrained")
        rows = np.arange(len(names))
        ax.barh(rows + 0.18, gains, 0.34, color=AFTER, label="on fitted recordings")
        ax.barh(rows - 0.18, held, 0.34, color=MEASURED, label="on held-out recordings")
        ax.set_yticks(rows, names)
        if max(gains + held, default=0.0) > 30.0:
            ax.set_xscale("symlog", linthresh=10)
        ax.set_xlabel("log-likelihood gained over the model without it")
        ax.legend(fontsize=8)
        return _svg(figure)


def _panels(records: Sequence[Record], draw: Callable[[Axes, int], None], height: float) -> str:
    with plt.rc_context(STYLE):
        n = len(records)
        figure, axes = plt.subplots(n, 1, figsize=(9, 0.6 + height * n), squeeze=False, layout="constrained")
        for i, ax in enumerate(axes[:, 0]):
            draw(ax, i)
            ax.set_title(records[i].name, loc="left", fontsize=9)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=3, fontsize=8)
        axes[-1, 0].set_xlabel("time, s")
        return _svg(figure)


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    plt.close(figure)
    return text.getvalue()[text.getvalue().index("<svg") :]
