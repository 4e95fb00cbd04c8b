"""The figures of `anglecam neck`, in the paper's order: linkage, statics, sensitivities, power."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anglecam.io.neck_file import Neck
from anglecam.neck.command_table import STRAIGHT, nod_limits, table_3
from anglecam.neck.fourbar import head_angle
from anglecam.neck.power import PowerLog, PowerUse
from anglecam.neck.sensitivity import Figure9
from anglecam.neck.statics import static_curve
from anglecam.neck.transmission import limits, slope, straight_line, transmission_angle
from anglecam.neck.turning import turning_angle, turning_range, turning_servo_angle, turning_slope
from anglecam.report.figures import AFTER, BEFORE, COMMAND, FAINT, MEASURED, STYLE

SERIES = (MEASURED, BEFORE, AFTER, "#b7791f", "#6b4fa0")
"""Colours of curves that stand side by side."""
_DECADES = 30.0
"""Between the highest and the lowest curve of a panel from which on it is drawn over a logarithm."""


def kinematics_figure(neck: Neck, path: Path) -> None:
    """Draw Fig. 4, θ_f over θ_s with its line, and below it slope and transmission angle.

    Parameters
    ----------
    neck : Neck
        Its links and command scale.
    path : Path
        A PNG file.
    """
    linkage = neck.parameters.linkage
    low, high = limits(linkage).crank
    servo = np.linspace(max(low, math.radians(50.0)) + 1e-6, min(high, math.radians(250.0)) - 1e-6, 801)
    line = straight_line(linkage, *STRAIGHT)
    along = np.array(STRAIGHT)
    rows = table_3(linkage, neck.scale)
    with plt.rc_context(STYLE):
        figure, (angle, gamma, mu) = plt.subplots(
            3, 1, figsize=(8, 7), sharex=True, height_ratios=(3, 1.4, 1.4), layout="constrained"
        )
        angle.plot(np.degrees(servo), np.degrees(head_angle(linkage, servo)), color=MEASURED, label="links, exact")
        told = f"{_signed(line.slope, 3)}·$\\theta_s$ + {math.degrees(line.intercept):.1f}°, R² = {line.r_squared:.4f}"
        angle.plot(np.degrees(along), np.degrees(line.slope * along + line.intercept), "--", color=BEFORE, label=told)
        for row in rows:
            at = math.degrees(row.theta_s), math.degrees(row.theta_f)
            angle.plot(*at, "o", color=AFTER, ms=5, label="Table 3" if row is rows[0] else None)
            angle.annotate(row.position, at, xytext=(7, 7), textcoords="offset points", fontsize=8, color=AFTER)
        angle.set(ylabel="head angle $\\theta_f$, °", title="Head over servo, Fig. 4")
        angle.legend(loc="upper right")
        gamma.plot(np.degrees(servo), slope(linkage, servo), color=MEASURED, label="exact")
        gamma.axhline(neck.parameters.gamma, ls="--", color=BEFORE, label="constant")
        gamma.set(ylabel="slope γ")
        gamma.legend(loc="upper center", ncols=2)
        mu.axhspan(40.0, 140.0, color=FAINT, zorder=0)
        mu.text(0.99, 0.22, "40° … 140°: links do not jam", ha="right", fontsize=8, transform=mu.transAxes)
        mu.plot(np.degrees(servo), np.degrees(transmission_angle(linkage, servo)), color=MEASURED)
        mu.set(
            ylabel="transmission\nangle μ, °", xlabel="servo angle $\\theta_s$, °", ylim=(20, 160), yticks=(40, 90, 140)
        )
        save(figure, path)


def turning_figure(neck: Neck, path: Path) -> None:
    """Draw the turning mechanism's head angle and slope over the servo's; see `kinematics_figure`."""
    mechanism = neck.turning
    low, high = turning_servo_angle(mechanism, turning_range(mechanism))
    servo = np.linspace(low, high, 361)
    with plt.rc_context(STYLE):
        figure, (angle, gain) = plt.subplots(
            2, 1, figsize=(8, 4.6), sharex=True, height_ratios=(2, 1), layout="constrained"
        )
        angle.plot(np.degrees(servo), np.degrees(turning_angle(mechanism, servo)), color=MEASURED)
        for wanted in (-60.0, 60.0):
            angle.axhline(wanted, ls="--", lw=0.8, color=BEFORE, label="wanted: ±60°" if wanted > 0 else None)
        angle.set(ylabel="head angle φ, °", title="Turning")
        angle.legend(loc="center right")
        gain.plot(np.degrees(servo), turning_slope(mechanism, servo), color=MEASURED)
        gain.set(ylabel="slope dφ/ds", xlabel="servo angle s, °")
        save(figure, path)


def statics_figure(neck: Neck, path: Path) -> None:
    """Draw spring against weight over the range, and what is left to the servo, Eqs. (23)-(25)."""
    low, high = nod_limits(neck.parameters.linkage, neck.scale)
    curve = static_curve(neck.parameters, neck.large_angle.preload, np.linspace(low, high, 301))
    nod = np.degrees(curve.delta)
    with plt.rc_context(STYLE):
        figure, (both, left) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
        both.plot(nod, curve.spring, color=AFTER, label="spring")
        both.plot(nod, curve.weight, color=MEASURED, label="weight")
        both.set(xlabel="nod Δθ, °", ylabel="torque, N·m", title="Spring against weight")
        left.plot(nod, curve.residual, color=MEASURED, label="exact, Eq. (23)")
        left.plot(nod, curve.small_angle, "--", color=BEFORE, label="small angles, Eq. (25)")
        left.set(xlabel="nod Δθ, °", title="What the servo has to hold")
        for axes in (both, left):
            axes.axvline(0.0, color=COMMAND, lw=0.8)
            axes.axhline(0.0, color=COMMAND, lw=0.8)
            axes.legend(loc="upper left")
        save(figure, path)


def sensitivity_figure(figure_9: Figure9, path: Path) -> None:
    """Draw Fig. 9 a-f: step responses with one quantity varied, and θ_f over θ_s for each L6."""
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(3, 2, figsize=(9, 9.5), layout="constrained")
        for letter, axes, panel in zip("abcde", grid.flat, figure_9.panels, strict=False):
            scale, unit = _readable(panel.unit)
            for curve, colour in zip(panel.curves, SERIES, strict=False):
                label = f"{scale * curve.value:g}{unit}" + ("" if curve.stable else ", unstable")
                if panel.symbol == "L_6":
                    label += f", γ = {_signed(curve.neck.gamma, 2)}"
                axes.plot(panel.time, np.degrees(curve.angle), color=colour, lw=1.3, label=label)
            axes.set(xlabel="time, s", ylabel="Δθ, °", title=f"({letter}) {panel.name} {_symbol(panel.symbol)}")
            tops = [float(np.degrees(c.angle.max())) for c in panel.curves if c.stable]
            if max(tops) > _DECADES * min(tops):
                axes.set(yscale="log", ylim=(0.2 * min(tops), 30.0 * max(tops)))
            else:
                axes.set_ylim(0.0, 1.5 * max(tops))  # the legend stands above the curves
            axes.legend(loc="upper left" if axes.get_yscale() == "linear" else "upper right", ncols=2, fontsize=7.5)
        axes = grid.flat[5]
        for curve, link, colour in zip(figure_9.panels[-1].curves, figure_9.linkages, SERIES, strict=False):
            label = f"$L_6$ = {1e3 * curve.value:g} mm, γ = {_signed(link.gamma, 2)}"
            axes.plot(np.degrees(link.theta_s), np.degrees(link.theta_f), color=colour, lw=1.3, label=label)
        axes.set(
            xlabel="servo angle $\\theta_s$, °", ylabel="head angle $\\theta_f$, °", title="(f) links that go with (e)"
        )
        axes.legend(loc="upper right", fontsize=7.5)
        figure.suptitle(f"Step of {figure_9.height:g} V, one quantity varied (Fig. 9)")
        save(figure, path)


def power_figure(log: PowerLog, use: PowerUse, path: Path) -> None:
    """Draw voltage and current over time with the nods, and the sag as a curve, as in Figs. 12 and 13."""
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
        told = f"{source.open_voltage:.2f} V − {source.resistance:.2f} Ω·I"
        sag.plot(current, line, color=BEFORE, label=told)
        sag.set(xlabel="current, A", ylabel="voltage, V", title="Sag")
        sag.legend(loc="lower left")
        numbers = np.arange(1, len(use.nods) + 1)
        energy.bar(numbers, [nod.mean_power for nod in use.nods], 0.6, color=AFTER)
        energy.set(xlabel="nod", ylabel="mean power, W", title="Power of each nod")
        energy.xaxis.get_major_locator().set_params(integer=True)
        energy.grid(axis="x", visible=False)
        save(figure, path)


def mark_step(axes: Axes, title: str) -> None:
    """Label the axes of a step response in degrees."""
    axes.set(xlabel="time, s", ylabel="angle from neutral, °", title=title)


def save(figure: Figure, path: Path) -> None:
    """Write a figure and close it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _signed(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−")


def _readable(unit: str) -> tuple[float, str]:
    """Return a factor and a unit in which a quantity of Fig. 9 has few digits."""
    if unit in ("m", "N·m/A"):
        return 1e3, f" m{unit}"
    return 1.0, "" if unit == "1" else f" {unit}"


def _symbol(symbol: str) -> str:
    """Write a symbol with its index set low."""
    head, _, index = symbol.partition("_")
    return f"${head}_{{{index}}}$" if index else f"${head}$"
