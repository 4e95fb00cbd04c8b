"""Figures of ``anglecam neck pd``: Fig. 16, and the step with tuned gains."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from anglecam.neck.pd import loop_response
from anglecam.neck_design.figures.style import SERIES, save
from anglecam.neck_design.results.pd import Pd
from anglecam.report.figures import AFTER, BEFORE, COMMAND, STYLE


def pd_figure(result: Pd, path: Path) -> None:
    """Draw closed loops as Fig. 16 does: a panel for each K_p, a curve for each K_d."""
    loops, plant = result.curves.loops, result.curves.plant
    proportional = list(dict.fromkeys(loop.gains.proportional for loop in loops))
    slowest = max((loop.figures.settling_time for loop in loops), key=lambda s: s if math.isfinite(s) else 0.0)
    time = np.linspace(0.0, 1.4 * slowest if math.isfinite(slowest) else 1.5, 801)
    columns = min(2, len(proportional))
    lines = math.ceil(len(proportional) / columns)
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(
            lines, columns, figsize=(9, 0.8 + 3.0 * lines), sharex=True, sharey=True, squeeze=False,
            layout="constrained",
        )  # fmt: skip
        for letter, axes, K_p in zip("abcdefghijklmnop", grid.flat, proportional, strict=False):
            members = [loop for loop in loops if loop.gains.proportional == K_p]
            for loop, colour in zip(members, SERIES * len(members), strict=False):
                label = f"$K_d$ = {loop.gains.derivative:.4g} {plant.rate_unit}"
                axes.plot(time, loop_response(loop, time), color=colour, lw=1.3, label=label)
            axes.set_title(f"({letter}) $K_p$ = {K_p:.4g} {plant.gain_unit}")
        for axes in grid[-1]:
            axes.set_xlabel("time, s")
        for axes in grid[:, 0]:
            axes.set_ylabel(f"answer to a unit step, {plant.output.symbol}")
        figure.suptitle(f"PD control of {plant.name}, as in Fig. 16", fontsize=10)
        figure.legend(*grid.flat[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=8)
        save(figure, path)


def tuning_figure(result: Pd, path: Path) -> None:
    """Draw the step without control and with the tuned gains, also at large angles, as shares of the steady state."""
    uncontrolled, tuned, simulated = result.curves.uncontrolled, result.curves.tuned, result.curves.simulated
    if tuned is None:
        raise ValueError("no tuned gains to draw: no nod was wanted")
    ends = [f.settling_time for f in (uncontrolled.figures, tuned.loop.figures) if math.isfinite(f.settling_time)]
    time = np.linspace(0.0, max([1.4 * max(ends, default=1.0), 2.0 * tuned.wanted.rise_time]), 1001)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8, 4.2), layout="constrained")
        axes.axhline(100.0, color=COMMAND, lw=0.8)
        pairs = ((uncontrolled, BEFORE, "without control"), (tuned.loop, AFTER, "tuned"))
        for loop, colour, label in pairs:
            axes.plot(time, 100.0 * loop_response(loop, time) / loop.figures.steady_state, color=colour, label=label)
        if simulated is not None and math.isfinite(simulated.figures.steady_state):
            share = 100.0 * simulated.angle / simulated.figures.steady_state
            within = simulated.time <= time[-1]
            axes.plot(simulated.time[within], share[within], "-.", color="#6b4fa0", label="tuned, at large angles")
        title = f"Nod wanted: rise {tuned.wanted.rise_time:g} s, overshoot {100.0 * tuned.wanted.overshoot:.3g} %"
        axes.set(xlabel="time, s", ylabel="share of the way, %", title=title)
        axes.legend(loc="lower right")
        save(figure, path)
