"""Figures of the mechanism: Fig. 4, the turning mechanism, and spring against weight."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from anglecam.neck.command_table import STRAIGHT, nod_limits, table_3
from anglecam.neck.fourbar import head_angle
from anglecam.neck.statics import static_curve
from anglecam.neck.transmission import limits, slope, straight_line, transmission_angle
from anglecam.neck.turning import turning_angle, turning_range, turning_servo_angle, turning_slope
from anglecam.neck_design.figures.style import save, signed
from anglecam.neck_design.results.kinematics import Kinematics
from anglecam.neck_design.results.statics import Statics
from anglecam.report.figures import AFTER, BEFORE, COMMAND, FAINT, MEASURED, STYLE


def linkage_figure(result: Kinematics, path: Path) -> None:
    """Draw Fig. 4: θ_f over θ_s with its straight line, and below it slope and transmission angle.

    Parameters
    ----------
    result : Kinematics
        Of the neck to draw.
    path : Path
        A PNG file.
    """
    neck = result.neck
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
        label = f"{signed(line.slope, 3)}·$\\theta_s$ + {math.degrees(line.intercept):.1f}°, R² = {line.r_squared:.4f}"
        angle.plot(np.degrees(along), np.degrees(line.slope * along + line.intercept), "--", color=BEFORE, label=label)
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


def turning_figure(result: Kinematics, path: Path) -> None:
    """Draw head angle and slope of the turning mechanism over the servo angle."""
    mechanism = result.neck.turning
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


def statics_figure(result: Statics, path: Path) -> None:
    """Draw spring and weight over the range of the nod, and the torque left to the servo, Eqs. (23)-(25)."""
    neck = result.neck
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
