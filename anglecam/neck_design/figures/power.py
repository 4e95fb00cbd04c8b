"""Figure of ``anglecam neck power``: voltage, current and nods, and the sag of the voltage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from anglecam.neck_design.figures.style import save
from anglecam.neck_design.results.power import Power
from anglecam.report.figures import AFTER, BEFORE, COMMAND, FAINT, STYLE


def power_figure(result: Power, path: Path) -> None:
    """Draw voltage and current over time with the nods, and the sag as a curve, as in Figs. 12 and 13."""
    log, use = result.log, result.use
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(9, 6.6), layout="constrained")
        halves: Any = figure.subfigures(2, 1, height_ratios=(1.5, 1))
        upper, lower = halves
        volts, amperes = upper.subplots(2, 1, sharex=True)
        volts.plot(log.time, log.voltage, color=AFTER, lw=1.0)
        volts.set(ylabel="voltage, V", ylim=(0.0, 1.08 * float(log.voltage.max())))
        amperes.plot(log.time, log.current, color=BEFORE, lw=1.0)
        amperes.set(ylabel="current, A", xlabel="time, s")
        for axes in (volts, amperes):
            for i, nod in enumerate(use.nods):
                axes.axvspan(nod.start, nod.end, color=FAINT, zorder=0, lw=0, label=None if i else "nods")
        upper.legend(*volts.get_legend_handles_labels(), loc="outside upper right", fontsize=8)
        upper.suptitle("Voltage and current, Figs. 12 and 13", fontsize=10)
        sag, energy = lower.subplots(1, 2)
        source = use.source
        current = np.linspace(*source.range, 101)
        line, sigma = source.voltage(current), source.sigma(current)
        sag.plot(log.current, log.voltage, ".", ms=2.5, color=COMMAND, label="measured")
        sag.fill_between(current, line - 2.0 * sigma, line + 2.0 * sigma, color=BEFORE, alpha=0.25, lw=0)
        label = f"{source.open_voltage:.2f} V − {source.resistance:.2f} Ω·I"
        sag.plot(current, line, color=BEFORE, label=label)
        sag.set(xlabel="current, A", ylabel="voltage, V", title="Sag")
        sag.legend(loc="lower left")
        numbers = np.arange(1, len(use.nods) + 1)
        energy.bar(numbers, [nod.mean_power for nod in use.nods], 0.6, color=AFTER)
        energy.set(xlabel="nod", ylabel="mean power, W", title="Power of each nod")
        energy.xaxis.get_major_locator().set_params(integer=True)
        energy.grid(axis="x", visible=False)
        save(figure, path)
