"""What the figures of ``anglecam neck`` share: colours, labels, writing."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anglecam.report.figures import AFTER, BEFORE, MEASURED

SERIES = (MEASURED, BEFORE, AFTER, "#b7791f", "#6b4fa0")
"""Colours of curves that stand side by side."""


def mark_step(axes: Axes, title: str) -> None:
    """Label the axes of a step response in degrees."""
    axes.set(xlabel="time, s", ylabel="angle from neutral, °", title=title)


def save(figure: Figure, path: Path) -> None:
    """Write a figure and close it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def signed(value: float, digits: int) -> str:
    """Write a number with a minus sign instead of a hyphen."""
    return f"{value:.{digits}f}".replace("-", "−")
