"""The figures of the loop's report, each an ``<svg>`` element."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

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
from anglecam.report.figures import AFTER, BEFORE, COMMAND, FAINT, MEASURED, STYLE, _svg
from anglecam.report.wording import plain

WIDTH = 9.6
MOST_RECORDINGS = 8
"""Largest number of recordings in a figure; those with the largest errors are drawn."""
BINS, FEWEST_FRAMES = 16, 5
"""Bins of a mean, and the smallest number of frames in a bin that is drawn."""
COLOURS = {"base model": BEFORE, "before": BEFORE, "after": AFTER}


def measured_figure(series: Sequence[AngleSeries], commands: dict[str, Command]) -> str:
    """Draw angle and command of every recording over time, and mark frames without an angle."""

    def draw(axes: Axes, i: int) -> None:
        one = series[i]
        if one.name in commands:
            _draw_command(axes, commands[one.name], one.time)
        axes.plot(one.time, np.degrees(one.angle), color=MEASURED, lw=1.1, label="measured angle")
        for t in one.time[~one.ok]:
            axes.axvline(t, color=BEFORE, lw=0.6, alpha=0.5)

    return _panels([s.name for s in series], draw, "angle, °")


def prediction_figure(records: Sequence[Record], residuals: Sequence[Floats]) -> str:
    """Draw the measured angle, and the angle that the base model predicts."""
    names = labels(records)
    worst = _worst(residuals)

    def draw(axes: Axes, i: int) -> None:
        record, error = records[worst[i]], residuals[worst[i]]
        axes.plot(record.time, np.degrees(record.angle), ".", color=MEASURED, ms=2.5, label="measured")
        axes.plot(record.time, np.degrees(record.angle - error), color=BEFORE, lw=1.0, label="base model")

    return _panels([names[i] for i in worst], draw, "angle, °")


def residual_figure(records: Sequence[Record], fit: Fit, floor: float) -> str:
    """Draw the residual of a model, and the band of the noise with standard deviation ``floor``, rad."""
    names, worst = labels(records), _worst(fit.residuals)

    def draw(axes: Axes, i: int) -> None:
        _draw_band(axes, floor)
        axes.plot(
            records[worst[i]].time, np.degrees(fit.residuals[worst[i]]), color=BEFORE, lw=0.9, label="measured − model"
        )

    return _panels([names[i] for i in worst], draw, "residual, °")


def candidate_figure(candidates: Sequence[Candidate], found: Sequence[str]) -> str:
    """Draw the log-likelihood gain of every candidate; the names of attributed effects are bold."""
    with plt.rc_context(STYLE):
        ordered = candidates[::-1]
        figure, ax = plt.subplots(figsize=(7.6, 0.9 + 0.42 * len(ordered)), layout="constrained")
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
        if max(np.abs([*fitted, *predicted]), default=0.0) > 100.0:
            ax.set_xscale("symlog", linthresh=10.0)
        ax.axvline(0.0, color=MEASURED, lw=0.8)
        ax.grid(axis="y", visible=False)
        ax.set_xlabel("log-likelihood gain over the base model")
        figure.legend(loc="outside upper left", ncols=2, fontsize=8)
        return _svg(figure)


def held_out_figure(before: Prediction, after: Prediction | None) -> str:
    """Draw the recording with the largest prediction error, as predicted by the base model and by the final model.

    ``after`` is ``None`` if no effect was added.
    """
    i = _worst(before.residuals, 1)[0]
    record = before.records[i]
    shown = {"base model": before} if after is None else {"before": before, "after": after}
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            1, len(shown), figsize=(WIDTH, 2.7), sharex=True, sharey=True, squeeze=False, layout="constrained"
        )
        for ax, (label, prediction) in zip(axes[0], shown.items(), strict=True):
            ax.plot(record.time, np.degrees(record.angle), ".", color=MEASURED, ms=3, label="measured")
            path = record.angle - prediction.residuals[i]
            ax.plot(record.time, np.degrees(path), color=COLOURS[label], lw=1.2, label="predicted")
            ax.set_title(f"{labels(before.records)[i]}, {label}", loc="left", fontsize=9, parse_math=False)
            ax.set_xlabel("time, s")
            ax.legend(fontsize=8)
        axes[0, 0].set_ylabel("angle, °")
        return _svg(figure)


def error_figure(before: Prediction, after: Prediction | None, floor: float) -> str:
    """Draw the prediction errors: before and after on the left, and after alone, on a finer scale, on the right."""
    worst = _worst(before.residuals)
    names = labels(before.records)
    columns = 1 if after is None else 2
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            len(worst),
            columns,
            figsize=(WIDTH, 0.6 + 1.25 * len(worst)),
            squeeze=False,
            layout="constrained",
            sharex="row",
        )
        for row, i in zip(axes, worst, strict=True):
            time = before.records[i].time
            for ax in row:
                _draw_band(ax, floor)
            row[0].plot(
                time,
                np.degrees(before.residuals[i]),
                color=BEFORE,
                lw=0.9,
                label="error" if after is None else "error before",
            )
            if after is not None:
                for ax in row:
                    ax.plot(time, np.degrees(after.residuals[i]), color=AFTER, lw=0.9, label="error after")
                row[1].set_title("after, on a finer scale", loc="left", fontsize=8, color="#5c6670")
            row[0].set_title(names[i], loc="left", fontsize=9, parse_math=False)
            row[0].set_ylabel("error, °")
        for ax in axes[-1]:
            ax.set_xlabel("time, s")
        handles, texts = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, texts, loc="outside upper right", ncols=3, fontsize=8)
        return _svg(figure)


def residual_torque_figure(torques: Sequence[ResidualTorque]) -> str:
    """Draw the residual torque against angle, velocity, command and time, with means over bins."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 5.4), sharey=True, layout="constrained")
        torque = np.degrees(np.concatenate([r.torque for r in torques]))
        noise = 2.0 * np.degrees(float(np.median(np.concatenate([r.sigma for r in torques]))))
        against = {
            "angle of the model, °": np.degrees(np.concatenate([r.angle for r in torques])),
            "velocity of the model, °/s": np.degrees(np.concatenate([r.velocity for r in torques])),
        }
        if any(r.command is not None for r in torques):
            commands = [np.zeros(len(r.time)) if r.command is None else r.command for r in torques]
            against["command, °"] = np.degrees(np.concatenate(commands))
        else:
            axes[1, 1].set_axis_off()
        for ax in axes.flat[: len(against) + 1]:
            ax.axhspan(-noise, noise, color=FAINT, zorder=0, label="noise alone, ±2σ")
        for ax, (label, x) in zip(axes.flat, against.items(), strict=False):
            ax.plot(x, torque, ".", color=AFTER, ms=2.5, alpha=0.35, label="frame")
            ax.plot(*_means(x, torque), "o-", color=MEASURED, ms=4, lw=1.2, label="mean")
            ax.set_xlabel(label)
        last = axes.flat[len(against)]
        for one in torques:
            last.plot(one.time, np.degrees(one.torque), lw=0.8, label=one.name)
        last.set_xlabel("time, s")
        if len(torques) <= MOST_RECORDINGS:
            handles, names = last.get_legend_handles_labels()
            last.legend(handles[1:], names[1:], fontsize=7, ncols=2)
        for ax in axes[:, 0]:
            ax.set_ylabel("residual torque, °/s²")
        handles, names = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper right", ncols=3, fontsize=8)
        return _svg(figure)


def experiment_figure(experiment: Experiment, verdict: Verdict) -> str:
    """Draw the next command, and the differences between the predictions of the rivals and of the final model."""
    command = experiment.command
    if command is None:
        raise ValueError("a free swing has no command to draw")
    time = np.arange(0.0, experiment.duration, verdict.fitted[0].interval)
    expected = _predict_from_rest(verdict.after, command, time, verdict.fitted[0])
    with plt.rc_context(STYLE):
        figure, (top, bottom) = plt.subplots(
            2, 1, figsize=(WIDTH, 3.6), sharex=True, height_ratios=(3, 2), layout="constrained"
        )
        _draw_command(top, command, time)
        found = " + ".join(plain(a.effect.id) for a in verdict.accepted)
        top.plot(time, np.degrees(expected), color=AFTER, lw=1.2, label=f"angle expected with {found}")
        top.set_ylabel("angle, °")
        _draw_band(bottom, verdict.noise.sigma)
        for accepted in verdict.accepted:
            for name, fit in accepted.rivals.items():
                difference = _predict_from_rest(fit, command, time, verdict.fitted[0]) - expected
                bottom.plot(
                    time,
                    np.degrees(difference),
                    lw=1.0,
                    label=f"{plain(name)} instead of {plain(accepted.effect.id)}",
                )
        bottom.set(xlabel="time, s", ylabel="difference, °")
        handles, names = top.get_legend_handles_labels()
        more, others = bottom.get_legend_handles_labels()
        figure.legend([*handles, *more], [*names, *others], loc="outside upper left", ncols=2, fontsize=8)
        return _svg(figure)


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


def _means(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return means of x and y over bins of equal width with at least `FEWEST_FRAMES` frames."""
    edges = np.linspace(x.min(), np.nextafter(x.max(), np.inf), BINS + 1)
    inside = [(x >= low) & (x < high) for low, high in pairwise(edges)]
    full = [i for i in inside if i.sum() >= FEWEST_FRAMES]
    return np.array([x[i].mean() for i in full]), np.array([y[i].mean() for i in full])


def _worst(residuals: Sequence[Floats], most: int = MOST_RECORDINGS) -> list[int]:
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


def _panels(names: Sequence[str], draw: Callable[[Axes, int], None], ylabel: str) -> str:
    """Draw one panel for each recording, in two columns if there are several."""
    n = len(names)
    columns = 1 if n == 1 else 2
    rows = -(-n // columns)
    settings: dict[str, Any] = {"squeeze": False, "layout": "constrained", "sharey": True}
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(rows, columns, figsize=(WIDTH, 0.6 + 1.45 * rows), **settings)
        for i, ax in enumerate(axes.flat):
            if i >= n:
                ax.set_axis_off()
                continue
            draw(ax, i)
            ax.set_title(names[i], loc="left", fontsize=9, parse_math=False)
            if i % columns == 0:
                ax.set_ylabel(ylabel)
            if i >= n - columns:
                ax.set_xlabel("time, s")
        handles, texts = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, texts, loc="outside upper right", ncols=3, fontsize=8)
        return _svg(figure)
