"""Figures of ``anglecam neck response``: one step as in Figs. 10 and 14, a series as in Figs. 11 and 15."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from anglecam.data.command import Command
from anglecam.data.typing import Floats
from anglecam.neck_design.figures.style import mark_step, save
from anglecam.neck_design.results.response import Response
from anglecam.neck_design.systems import ComparedModel
from anglecam.report.figures import AFTER, BEFORE, COMMAND, MEASURED, STYLE

_COLOURS = {"SYS1": BEFORE, "small angles": "#b7791f", "SYS2": AFTER, "large angles": "#6b4fa0", "fitted": "#2f855a"}
_DASHES = {"small angles": "--", "large angles": "-.", "fitted": ":"}
_WIDEST = 2.5
"""Times the largest command, beyond which a curve is not shown."""


def step_figure(result: Response, path: Path) -> None:
    """Draw the models' responses to one step, with a measured response if there is one, Figs. 10 and 14."""
    height, measured = result.step, result.measured_step
    time = np.linspace(0.0, 1.2, 1201)
    command = Command(np.zeros(1), np.array([height]))
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8, 4.6), layout="constrained")
        axes.axhline(math.degrees(height), color=COMMAND, lw=0.8, label="command")
        for system in result.systems:
            _curve(axes, time, system.run(time, command), system)
        if measured is not None:
            axes.plot(measured[0], np.degrees(measured[1]), ".", color=MEASURED, ms=4, label="measured")
            axes.set_xlim(-0.1, 1.2)
        _within(axes, np.array([height]))
        mark_step(axes, "Models of the neck, a step as in Figs. 10 and 14")
        axes.legend(loc="lower right")
        save(figure, path)


def series_figure(result: Response, path: Path) -> None:
    """Draw the models, and a measurement if there is one, in a series of steps, Figs. 11 and 15."""
    runs = result.runs
    time, command = runs.time, runs.command
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(9, 4.8), layout="constrained")
        inside = command.time[(command.time > time[0]) & (command.time < time[-1])]
        knots = np.concatenate([time[:1], inside, time[-1:]])
        axes.step(knots, np.degrees(command.at(knots)), where="post", color=COMMAND, lw=0.8, label="command")
        for system, angle in zip(runs.systems, runs.angles, strict=True):
            _curve(axes, time, angle, system)
        if runs.measured is not None:
            axes.plot(time, np.degrees(runs.measured), ".", color=MEASURED, ms=3, label="measured")
        _within(axes, command.angle)
        mark_step(axes, "Models of the neck, a series of steps as in Figs. 11 and 15")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8)
        save(figure, path)


def _curve(axes: Axes, time: Floats, angle: Floats, system: ComparedModel) -> None:
    label = f"{system.name}, {system.equation}"
    dashes = _DASHES.get(system.name, "-")
    axes.plot(time, np.degrees(angle), lw=1.3, label=label, color=_COLOURS[system.name], ls=dashes)


def _within(axes: Axes, commanded: Floats) -> None:
    """Limit the axis so that a diverging curve does not flatten the others."""
    widest = _WIDEST * math.degrees(float(np.abs(commanded).max()))
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, -widest), min(high, widest))
