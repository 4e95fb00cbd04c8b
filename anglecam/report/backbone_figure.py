"""The figure of free swings: period and decay over the amplitude, cycle by cycle."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from anglecam.data.typing import Floats
from anglecam.errors import printable
from anglecam.identification.backbone import Backbone
from anglecam.report.figures import NORMAL_95, panel

AMPLITUDE = "amplitude, °"


def backbone_figures(swings: Sequence[Backbone]) -> list[str]:
    """Draw period and decay of every cycle with 95 % bars, each recording in a colour of its own."""

    def draw(axes: Axes, columns: Sequence[tuple[Floats, Floats]]) -> None:
        for n, (one, (value, sigma)) in enumerate(zip(swings, columns, strict=True)):
            axes.errorbar(
                np.degrees(one.amplitude),
                value,
                NORMAL_95 * sigma,
                NORMAL_95 * np.degrees(one.amplitude_sigma),
                fmt=".",
                color=f"C{n}",
                lw=0.8,
                ms=3.5,
                label=printable(one.name),
            )

    if not swings:
        return []
    return [
        panel("period, s", partial(draw, columns=[(one.period, one.period_sigma) for one in swings]), AMPLITUDE),
        panel("decay, 1/s", partial(draw, columns=[(one.decay, one.decay_sigma) for one in swings]), AMPLITUDE),
    ]
