"""The figures of `anglecam neck` about the moving neck: responses, what a motion leaves open, control."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from anglecam.data.command import Command
from anglecam.data.typing import Floats
from anglecam.neck.design import Relations
from anglecam.neck.joint import Joint
from anglecam.neck.linear import LinearNeck
from anglecam.neck.pd import ClosedLoop, PdGains, PdMotion, loop_response
from anglecam.neck.pd_tuning import Tuned
from anglecam.neck.step import linear_step
from anglecam.neck.synthesis import Synthesis
from anglecam.neck_design.figures import SERIES, mark_step, save
from anglecam.neck_design.procedure import Plant
from anglecam.neck_design.systems import SideBySide, System
from anglecam.report.figures import AFTER, BEFORE, COMMAND, FAINT, MEASURED, STYLE

_COLOURS = {"SYS1": BEFORE, "small angles": "#b7791f", "SYS2": AFTER, "large angles": "#6b4fa0", "fitted": "#2f855a"}
_WIDEST = 2.5
"""Times the largest command, beyond which a curve is not shown."""
_DASHES = {"small angles": "--", "large angles": "-.", "fitted": ":"}


def step_figure(systems: Sequence[System], height: float, measured: tuple[Floats, Floats] | None, path: Path) -> None:
    """Draw models' answers to one step side by side, Figs. 10 and 14.

    Parameters
    ----------
    systems : sequence of System
        To step.
    height : float
        rad.
    measured : (time, angle) or None
        s from the step and rad, laid over.
    path : Path
        A PNG file.
    """
    time = np.linspace(0.0, 1.2, 1201)
    command = Command(np.zeros(1), np.array([height]))
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8, 4.6), layout="constrained")
        axes.axhline(math.degrees(height), color=COMMAND, lw=0.8, label="command")
        for system in systems:
            _curve(axes, time, system.run(time, command), system)
        if measured is not None:
            axes.plot(measured[0], np.degrees(measured[1]), ".", color=MEASURED, ms=4, label="measured")
            axes.set_xlim(-0.1, 1.2)
        _within(axes, np.array([height]))
        mark_step(axes, "Models of the neck, a step as in Figs. 10 and 14")
        axes.legend(loc="lower right")
        save(figure, path)


def series_figure(runs: SideBySide, path: Path) -> None:
    """Draw models beside each other, and beside a measurement, in a series of steps, Figs. 11 and 15."""
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


def _curve(axes: Axes, time: Floats, angle: Floats, system: System) -> None:
    label = f"{system.name}, {system.equation}"
    dashes = _DASHES.get(system.name, "-")
    axes.plot(time, np.degrees(angle), lw=1.3, label=label, color=_COLOURS[system.name], ls=dashes)


def _within(axes: Axes, commanded: Floats) -> None:
    """Cut off a curve that runs away."""
    widest = _WIDEST * math.degrees(float(np.abs(commanded).max()))
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, -widest), min(high, widest))


def design_figure(found: Joint, routes: Sequence[Relations], path: Path) -> None:
    """Draw what an identified motion leaves open: h against K·L2·L6 by Eq. (34b), c4 against C by Eq. (34a).

    The motion fixes a line in each, with its uncertainty, and each route's knowledge a point on it. What no neck can
    have is shaded.

    Parameters
    ----------
    found : Joint
        a, b, c.
    routes : sequence of Relations
        `by_inertia` first.
    path : Path
        A PNG file.
    """
    first = routes[0].quantities
    inertia, gamma, weight = (first[name].value for name in ("inertia", "gamma", "weight"))
    with plt.rc_context(STYLE):
        figure, (feedback, motor) = plt.subplots(1, 2, figsize=(9, 4.4), layout="constrained")
        springs = [r["spring"].value for r in routes]
        reach = np.linspace(0.0, 1.5 * max(*springs, first["spring_bound"].value), 201)
        _line(feedback, found, reach, lambda q, k: (q["b"] / q["c"] - (k - weight) / (q["c"] * inertia)) / gamma)
        bound = -(reach - weight) / (first["c"].value * inertia * gamma)
        feedback.plot(reach, bound, ls="--", color=BEFORE, label="bound of Eq. (35)")
        unstable = bound + math.copysign(1e3, -gamma)
        feedback.fill_between(reach, bound, unstable, color=BEFORE, alpha=0.12, lw=0, label="unstable")
        top = 1.3 * max(float(np.abs(bound).max()), *(r["sensor_gain"].value for r in routes))
        feedback.set(xlabel="spring K·L2·L6, N·m/rad", ylabel="sensor gain h, V/rad", xlim=reach[[0, -1]])
        feedback.set(title="Stiffness, Eq. (34b)", ylim=(-0.35 * top, top))
        dampings = [r["damping"].value for r in routes]
        reach = np.linspace(0.0, 1.5 * max(*dampings, first["damping_bound"].value), 201)
        _line(motor, found, reach, lambda q, c: (q["a"] / q["c"] - c / (q["c"] * inertia)) / gamma)
        ratios = [r["back_emf_ratio"].value for r in routes]
        top = 1.4 * max(abs(first["a"].value / first["c"].value / gamma), *map(abs, ratios))
        motor.set(xlabel="damping C, N·m·s", ylabel="back-emf ratio c4, V·s/rad", xlim=reach[[0, -1]])
        motor.set(title="Damping, Eq. (34a)", ylim=(-top, top))
        points = (("spring", "sensor_gain", feedback), ("damping", "back_emf_ratio", motor))
        for x, y, axes in points:
            axes.axhspan(axes.get_ylim()[0], 0.0, color=FAINT, zorder=0, label="impossible")
            for route, colour, mark, size in zip(routes, (MEASURED, AFTER, "#e0b04c"), "oso", (11, 8, 4), strict=False):
                axes.errorbar(
                    route[x].value, route[y].value, xerr=2.0 * route[x].sigma, yerr=2.0 * route[y].sigma, fmt=mark,
                    color=colour, ms=size, capsize=2, label=_route_label(route),
                )  # fmt: skip
        handles, labels = feedback.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8, markerscale=0.6)
        save(figure, path)


def _line(axes: Axes, found: Joint, x: Floats, relation) -> None:  # type: ignore[no-untyped-def]
    """Draw a relation over x with twice its standard uncertainty from a, b, c."""
    told = found.derived(lambda q: {str(i): relation(q, value) for i, value in enumerate(x)})
    at = slice(len(found.names), None)
    y, sigma = told.values[at], np.sqrt(np.maximum(np.diag(told.covariance)[at], 0.0))
    axes.fill_between(x, y - 2.0 * sigma, y + 2.0 * sigma, color=MEASURED, alpha=0.18, lw=0)
    axes.plot(x, y, color=MEASURED, lw=1.3, label="what the motion says, ±2σ")


def _route_label(route: Relations) -> str:
    return {
        "by_inertia": "with J, spring, C",
        "by_inertia_and_motor": "with J, h, motor",
        "by_motor": "with motor, spring",
    }.get(route.route, route.route)


def synthesis_figure(made: Synthesis, before: LinearNeck, path: Path) -> None:
    """Draw the step of the neck as it was and as it was made to the wish, each as a share of its rest."""
    nod = made.figures
    rises = [nod.rise_time] if math.isfinite(nod.rise_time) else []
    end = max(0.6, *(4.0 * rise for rise in rises)) if rises else 0.6
    time = np.linspace(0.0, end, 1001)
    after = made.linear
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8, 4.2), layout="constrained")
        axes.axhline(100.0, color=COMMAND, lw=0.8)
        for linear, gains, colour, label in (
            (before, PdGains(), BEFORE, "as it was"),
            (after, made.gains, AFTER, "made to the wish" if made.feasible else "nearest to the wish"),
        ):
            damping = linear.a + linear.c * gains.derivative
            share = linear_step([linear.b], [1.0, damping, linear.b], time)
            axes.plot(time, 100.0 * share, color=colour, label=label)
        axes.set(xlabel="time, s", ylabel="share of the way, %", title="Step response before and after the design")
        axes.legend(loc="lower right")
        save(figure, path)


def pd_figure(loops: Sequence[ClosedLoop], plant: Plant, path: Path) -> None:
    """Draw closed loops as Fig. 16 does: a panel for each K_p, a curve for each K_d.

    Parameters
    ----------
    loops : sequence of ClosedLoop
        All pairs of gains.
    plant : Plant
        For the title and the units.
    path : Path
        A PNG file.
    """
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
            axes.set_ylabel(f"answer to a unit step, {plant.output}")
        figure.suptitle(f"PD control of {plant.name}, as in Fig. 16", fontsize=10)
        figure.legend(*grid.flat[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=8)
        save(figure, path)


def tuning_figure(free: ClosedLoop, tuned: Tuned, simulated: PdMotion | None, path: Path) -> None:
    """Draw the step without control and with the tuned gains, and these at large angles, as shares of the rest."""
    ends = [f.settling_time for f in (free.figures, tuned.loop.figures) if math.isfinite(f.settling_time)]
    time = np.linspace(0.0, max([1.4 * max(ends, default=1.0), 2.0 * tuned.wanted.rise_time]), 1001)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8, 4.2), layout="constrained")
        axes.axhline(100.0, color=COMMAND, lw=0.8)
        pairs = ((free, BEFORE, "without control"), (tuned.loop, AFTER, "tuned"))
        for loop, colour, label in pairs:
            axes.plot(time, 100.0 * loop_response(loop, time) / loop.figures.steady_state, color=colour, label=label)
        if simulated is not None and math.isfinite(simulated.figures.steady_state):
            share = 100.0 * simulated.angle / simulated.figures.steady_state
            within = simulated.time <= time[-1]
            axes.plot(simulated.time[within], share[within], "-.", color="#6b4fa0", label="tuned, at large angles")
        told = f"Nod wanted: rise {tuned.wanted.rise_time:g} s, overshoot {100.0 * tuned.wanted.overshoot:.3g} %"
        axes.set(xlabel="time, s", ylabel="share of the way, %", title=told)
        axes.legend(loc="lower right")
        save(figure, path)
