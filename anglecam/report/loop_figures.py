"""The figures of the loop's report: panels, each an ``<svg>`` element that can be read on a narrow screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats
from anglecam.errors import printable
from anglecam.identification.fit import Fit
from anglecam.loop.candidates import Candidate
from anglecam.loop.cross_validation import Prediction
from anglecam.loop.next_experiment.design import SETTLE, Experiment
from anglecam.loop.residual_torque import ResidualTorque
from anglecam.loop.verdict import Verdict
from anglecam.models.plant import Plant
from anglecam.report.figures import AFTER, BEFORE, COMMAND, FAINT, MEASURED, PANEL, STYLE, _svg, panel
from anglecam.report.wording import plain

MOST_RECORDINGS = 8
"""Largest number of recordings in a figure; those with the largest errors are drawn."""
BINS, FEWEST_FRAMES = 16, 5
"""Bins of a mean, and the smallest number of frames in a bin that is drawn."""
MOST_LOSS = 0.3
"""Largest loss in a figure of gains, as a share of the largest gain; the bar of a larger one reaches to the edge."""
COLOURS = {"base model": BEFORE, "before": BEFORE, "after": AFTER}


@dataclass(frozen=True)
class Panel:
    """One panel of a figure."""

    svg: str
    title: str = ""
    record: Record | None = None
    """The recording that it shows over time."""
    plot: str = ""
    """The plot that the scripts draw in its place; empty for a panel that stays."""


def measured_panel(series: AngleSeries, command: Command | None) -> str:
    """Draw angle and command of a recording over time, and mark frames without an angle."""

    def draw(axes: Axes) -> None:
        if command is not None:
            _draw_command(axes, command, series.time)
        axes.plot(series.time, np.degrees(series.angle), color=MEASURED, lw=1.1, label="measured angle")
        for t in series.time[~series.ok]:
            axes.axvline(t, color=BEFORE, lw=0.6, alpha=0.5)

    return panel("angle, °", draw)


def prediction_panels(records: Sequence[Record], residuals: Sequence[Floats]) -> list[Panel]:
    """Draw the measured angle, and the angle that the base model predicts."""
    names = labels(records)

    def draw(axes: Axes, i: int) -> None:
        axes.plot(records[i].time, np.degrees(records[i].angle), ".", color=MEASURED, ms=2.5, label="measured")
        path = np.degrees(records[i].angle - residuals[i])
        axes.plot(records[i].time, path, color=BEFORE, lw=1.0, label="base model")

    drawn = [(i, panel("angle, °", partial(draw, i=i))) for i in worst(residuals)]
    return [Panel(svg, names[i], records[i], "prediction") for i, svg in drawn]


def residual_panels(records: Sequence[Record], fit: Fit, floor: float) -> list[Panel]:
    """Draw the residual of a model, and the band of the noise with standard deviation ``floor``, rad."""
    curves = [{"measured − model": (BEFORE, residual)} for residual in fit.residuals]
    return _error_panels(records, curves, worst(fit.residuals), floor, "residual, °", "residual")


def error_panels(before: Prediction, after: Prediction | None, floor: float) -> list[Panel]:
    """Draw the prediction errors: before and after, and then after alone, on a finer scale."""
    first = "error" if after is None else "error before"
    curves: list[dict[str, tuple[str, Floats]]] = [{first: (BEFORE, one)} for one in before.residuals]
    shown = worst(before.residuals)
    if after is None:
        return _error_panels(before.records, curves, shown, floor, "error, °", "error")
    alone: list[dict[str, tuple[str, Floats]]] = [{"error after": (AFTER, one)} for one in after.residuals]
    both = [one | more for one, more in zip(curves, alone, strict=True)]
    wide = _error_panels(before.records, both, shown, floor, "error, °", "error")
    fine = _error_panels(before.records, alone, shown, floor, "error, °", "error_after")
    return [one for pair in zip(wide, fine, strict=True) for one in pair]


def candidate_figure(candidates: Sequence[Candidate], found: Sequence[str]) -> str:
    """Draw the log-likelihood gain of every candidate; the names of attributed effects are bold."""
    with plt.rc_context(STYLE):
        ordered = candidates[::-1]
        figure, ax = plt.subplots(figsize=(PANEL[0], 0.9 + 0.36 * len(ordered)), layout="constrained")
        rows = np.arange(len(ordered))
        fitted = [c.log_likelihood_gain if np.isfinite(c.log_likelihood_gain) else 0.0 for c in ordered]
        predicted = [c.predictive_gain if np.isfinite(c.predictive_gain) else 0.0 for c in ordered]
        ax.barh(rows + 0.19, fitted, 0.36, color=COMMAND, label="on fitted frames")
        ax.barh(rows - 0.19, predicted, 0.36, color=AFTER, label="on predicted frames")
        for row, candidate in zip(rows, ordered, strict=True):
            if candidate.cross_validated is None:
                ax.annotate(
                    "not validated", (0.0, row - 0.19), (4, 0), textcoords="offset points", va="center", fontsize=7
                )
        ax.set_yticks(rows, [plain(c.effect.id) for c in ordered])
        for tick, candidate in zip(ax.get_yticklabels(), ordered, strict=True):
            tick.set_fontweight("bold" if candidate.effect.id in found else "normal")
        least, most = min([*fitted, *predicted], default=0.0), max([*fitted, *predicted], default=0.0)
        if least < -MOST_LOSS * most < 0.0:  # a candidate that predicts very badly would make all gains look alike
            ax.set_xlim(left=-MOST_LOSS * most)
        ax.axvline(0.0, color=MEASURED, lw=0.8)
        ax.grid(axis="y", visible=False)
        ax.set_xlabel("log-likelihood gain over the base model")
        figure.legend(loc="outside upper left", ncols=2, fontsize=8)
        return _svg(figure)


def held_out_panels(before: Prediction, after: Prediction | None) -> list[Panel]:
    """Draw the recording with the largest prediction error, as predicted by the base model and by the final model.

    ``after`` is ``None`` if no effect was added.
    """
    i = worst(before.residuals, 1)[0]
    record, name = before.records[i], labels(before.records)[i]
    shown = {"base model": before} if after is None else {"before": before, "after": after}

    def draw(axes: Axes, label: str) -> None:
        axes.plot(record.time, np.degrees(record.angle), ".", color=MEASURED, ms=3, label="measured")
        path = record.angle - shown[label].residuals[i]
        axes.plot(record.time, np.degrees(path), color=COLOURS[label], lw=1.2, label="predicted")

    drawn = {label: panel("angle, °", partial(draw, label=label)) for label in shown}
    return [Panel(svg, f"{name}, {label}") for label, svg in drawn.items()]


def residual_torque_panels(torques: Sequence[ResidualTorque]) -> list[Panel]:
    """Draw the residual torque against angle, velocity and command, as means over bins, and over time."""
    torque = np.degrees(np.concatenate([r.torque for r in torques]))
    noise = 2.0 * np.degrees(float(np.median(np.concatenate([r.sigma for r in torques]))))
    against = {
        "angle of the model, °": np.degrees(np.concatenate([r.angle for r in torques])),
        "velocity of the model, °/s": np.degrees(np.concatenate([r.velocity for r in torques])),
    }
    if any(r.command is not None for r in torques):
        commands = [np.zeros(len(r.time)) if r.command is None else r.command for r in torques]
        against["command, °"] = np.degrees(np.concatenate(commands))

    def band(axes: Axes) -> None:
        axes.axhspan(-noise, noise, color=FAINT, zorder=0, label="noise alone, ±2σ")

    def draw(axes: Axes, x: Floats) -> None:
        band(axes)
        middle, mean, low, high = _binned(x, torque)
        axes.fill_between(middle, low, high, color=AFTER, alpha=0.3, lw=0.0, label="middle 80 % of the frames")
        axes.plot(middle, mean, "o-", color=MEASURED, ms=4, lw=1.2, label="mean")

    def over_time(axes: Axes) -> None:
        band(axes)
        for one in torques:
            label = printable(one.name) if len(torques) <= MOST_RECORDINGS else None
            axes.plot(one.time, np.degrees(one.torque), lw=0.8, label=label)

    unit = "residual torque, °/s²"
    drawn = [panel(unit, partial(draw, x=x), label) for label, x in against.items()]
    return [Panel(svg) for svg in [*drawn, panel(unit, over_time)]]


def experiment_panels(experiment: Experiment, verdict: Verdict) -> list[Panel]:
    """Draw the next command, and the differences between the predictions of the rivals and of the final model."""
    command = experiment.command
    if command is None:
        raise ValueError("a free swing has no command to draw")
    time = np.arange(0.0, experiment.duration, verdict.fitted[0].interval)
    expected = _predict_from_rest(verdict.after, command, time, verdict.fitted[0])
    found = " + ".join(plain(a.effect.id) for a in verdict.accepted)

    def draw_command(axes: Axes) -> None:
        _draw_command(axes, command, time)
        axes.plot(time, np.degrees(expected), color=AFTER, lw=1.2, label=f"angle expected with {found}")

    def draw_differences(axes: Axes) -> None:
        _draw_band(axes, verdict.noise.sigma)
        for accepted in verdict.accepted:
            for name, fit in accepted.rivals.items():
                difference = _predict_from_rest(fit, command, time, verdict.fitted[0]) - expected
                label = f"{plain(name)} instead of {plain(accepted.effect.id)}"
                axes.plot(time, np.degrees(difference), lw=1.0, label=label)

    return [
        Panel(panel("angle, °", draw_command), "the command to play"),
        Panel(panel("difference, °", draw_differences), "what it would show"),
    ]


def labels(records: Sequence[Record]) -> list[str]:
    """Return the names of recordings; parts of one recording are named with their times."""
    names = [printable(r.name) for r in records]
    return [
        name if names.count(name) == 1 else f"{name}, {r.time[0]:.1f} … {r.time[-1]:.1f} s"
        for name, r in zip(names, records, strict=True)
    ]


def _predict_from_rest(fit: Fit, command: Command, time: Floats, like: Record) -> Floats:
    """Predict the angle from rest, (n,), as the camera of recording ``like`` shows it, rad."""
    if not isinstance(fit.model, Plant):
        raise TypeError("only a Plant has rivals")
    held = Command(np.zeros(1), command.angle[:1])
    state = fit.model.run(fit.parameters, np.array([0.0, SETTLE]), held, np.zeros(2))[-1]
    return fit.model.predict(fit.parameters, time, command, state, like.view)


def _binned(x: Floats, y: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the means of x and y, and the ends of the middle 80 % of y, over bins of equal width.

    Bins with fewer than `FEWEST_FRAMES` frames are left out.
    """
    edges = np.linspace(x.min(), np.nextafter(x.max(), np.inf), BINS + 1)
    inside = [(x >= low) & (x < high) for low, high in pairwise(edges)]
    full = [i for i in inside if i.sum() >= FEWEST_FRAMES]
    low, high = np.array([np.quantile(y[i], (0.1, 0.9)) for i in full]).reshape(-1, 2).T
    return np.array([x[i].mean() for i in full]), np.array([y[i].mean() for i in full]), low, high


def worst(residuals: Sequence[Floats], most: int = MOST_RECORDINGS) -> list[int]:
    """Return the indices of the recordings with the largest errors, in ascending order."""
    size = [float(np.sqrt(np.mean(r**2))) for r in residuals]
    return sorted(sorted(range(len(size)), key=lambda i: -size[i])[:most])


def _draw_command(axes: Axes, command: Command, time: Floats) -> None:
    inside = (command.time > time[0]) & (command.time < time[-1])
    knots = np.concatenate([time[:1], command.time[inside], time[-1:]])
    style = "steps-post" if command.slope is None else "default"
    axes.plot(knots, np.degrees(command.at(knots)), drawstyle=style, color=COMMAND, lw=0.9, label="command")


def _draw_band(axes: Axes, floor: float) -> None:
    axes.axhspan(-2.0 * np.degrees(floor), 2.0 * np.degrees(floor), color=FAINT, zorder=0, label="noise, ±2σ")


def _error_panels(
    records: Sequence[Record],
    curves: Sequence[dict[str, tuple[str, Floats]]],
    shown: Sequence[int],
    floor: float,
    ylabel: str,
    plot: str,
) -> list[Panel]:
    """Draw errors over time, (colour, rad) by name, for those of the recordings that are ``shown``."""
    names = labels(records)

    def draw(axes: Axes, i: int) -> None:
        _draw_band(axes, floor)
        for label, (colour, error) in curves[i].items():
            axes.plot(records[i].time, np.degrees(error), color=colour, lw=0.9, label=label)

    drawn = [(i, panel(ylabel, partial(draw, i=i))) for i in shown]
    finer = ", on a finer scale" if plot == "error_after" else ""
    return [Panel(svg, names[i] + finer, records[i], plot) for i, svg in drawn]
