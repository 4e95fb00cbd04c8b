"""The figure of a torque of free form: the function with its band, and how often its quantities were visited."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from anglecam.loop.free_form.result import FreeForm
from anglecam.loop.verdict_json import FACTORS
from anglecam.report.figures import AFTER, COMMAND, FAINT, NORMAL_95, STYLE, _svg

LABELS = {
    "angle": "angle, °",
    "velocity": "velocity, °/s",
    "command": "command, °",
    "phase": "phase, share of the period",
    "time": "time, s",
}


def free_form_figure(found: FreeForm) -> str:
    """Draw the function as a curve over one quantity, or as colours over two."""
    band = found.band
    points = [x * FACTORS[name] for name, x in zip(band.over, band.points, strict=True)]
    value, half = np.degrees(band.acceleration), NORMAL_95 * np.degrees(band.sigma)
    labels = [LABELS[name] for name in band.over]
    with plt.rc_context(STYLE):
        if len(points) == 1:
            figure, (top, bottom) = plt.subplots(
                2, 1, figsize=(7.6, 4.0), sharex=True, height_ratios=(4, 1), layout="constrained"
            )
            top.fill_between(points[0], value - half, value + half, color=FAINT, label="95 % band")
            top.plot(points[0], value, color=AFTER, lw=1.4, label="missing torque")
            top.set_ylabel("torque, °/s²")
            bottom.fill_between(points[0], 100.0 * band.visited, step="mid", color=COMMAND)
            bottom.set(xlabel=labels[0], ylabel="% of time")
            figure.legend(*top.get_legend_handles_labels(), loc="outside upper right", ncols=2, fontsize=8)
            return _svg(figure)
        figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.8), sharey=True, layout="constrained")
        size = 20.0 + 600.0 * np.sqrt(band.visited)
        for ax, shown, title in zip(
            axes, (value, half), ("missing torque, °/s²", "half of the 95 % band"), strict=True
        ):
            colours = "RdBu_r" if shown is value else "Greys"
            most = float(np.max(np.abs(shown)))
            drawn = ax.scatter(*points, c=shown, s=size, cmap=colours, vmin=-most if shown is value else 0.0, vmax=most)
            figure.colorbar(drawn, ax=ax)
            ax.set_title(title + "; larger where visited longer", loc="left", fontsize=8)
            ax.set_xlabel(labels[0])
        axes[0].set_ylabel(labels[1])
        return _svg(figure)
