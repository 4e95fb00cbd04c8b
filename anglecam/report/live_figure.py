"""The figure of a measurement while filming: the angle as it was shown, its latency, and how a, b and c converge."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from anglecam.data.series import OK
from anglecam.errors import printable
from anglecam.io.live_csv import LiveRow
from anglecam.report.figures import AFTER, BEFORE, FAINT, MEASURED, STYLE

_PARAMETERS = ("a, 1/s", "b, 1/s²", "c, 1/s²")


def plot_live(rows: Sequence[LiveRow], path: Path, name: str) -> None:
    """Draw what was shown while filming.

    Parameters
    ----------
    rows : sequence of LiveRow
        A row a frame.
    path : Path
        A PNG file.
    name : str
        The recording's name.
    """
    time = np.array([row.time for row in rows])
    angle = np.degrees([row.angle for row in rows])
    parameters = np.array([row.parameters for row in rows]).reshape(-1, 3)
    spread = 2.0 * np.array([row.parameter_sigmas for row in rows]).reshape(-1, 3)
    shown = [k for k in range(3) if np.isfinite(parameters[:, k]).any() and np.nanmax(np.abs(parameters[:, k])) > 0.0]
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            2 + len(shown),
            1,
            figsize=(9, 4 + 1.4 * len(shown)),
            sharex=True,
            height_ratios=(2, 1, *[1] * len(shown)),
            layout="constrained",
        )
        top, middle = panels[:2]
        top.plot(time, angle, color=MEASURED, lw=1.0, marker=".", ms=3)
        top.set(ylabel="angle, °")
        top.set_title(printable(f"{name}: as it was shown"), parse_math=False)
        left = np.array([row.status != OK for row in rows])
        middle.plot(time, [1e3 * row.latency for row in rows], color=AFTER, lw=1.0)
        middle.plot(time[left], np.zeros(left.sum()), color=BEFORE, ls="", marker="|", label="not measured at once")
        middle.set(ylabel="latency, ms", ylim=(0.0, None))
        middle.legend(loc="upper left", fontsize=8)
        for k, panel in zip(shown, panels[2:], strict=True):
            low, high = parameters[:, k] - spread[:, k], parameters[:, k] + spread[:, k]
            panel.fill_between(time, low, high, color=FAINT, label="±2σ that the filter states")
            panel.plot(time, parameters[:, k], color=MEASURED, lw=1.0)
            last = parameters[np.isfinite(parameters[:, k]), k][-1]
            panel.set(ylabel=_PARAMETERS[k], ylim=(last - 0.5 * abs(last), last + 0.5 * abs(last)))
        panels[-1].set(xlabel="time, s")
        figure.savefig(path, dpi=110, format="png")
        plt.close(figure)
