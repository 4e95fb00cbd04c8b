"""Figures of ``anglecam neck design``: what the identified motion leaves open, and a neck made to a wish."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from anglecam.data.typing import Floats
from anglecam.neck.correlated import CorrelatedQuantities
from anglecam.neck.design import Relations
from anglecam.neck.pd import PdGains
from anglecam.neck.step import linear_step
from anglecam.neck_design.figures.style import save
from anglecam.neck_design.results.design import Design
from anglecam.report.figures import AFTER, BEFORE, COMMAND, FAINT, MEASURED, STYLE


def design_figure(result: Design, path: Path) -> None:
    """Draw what an identified motion leaves open: h against K·L2·L6 by Eq. (34b), c4 against C by Eq. (34a).

    The motion fixes a line in each panel, with its uncertainty; what a route takes as known fixes a point on that line.
    The region that no neck can have is shaded.

    Parameters
    ----------
    result : Design
        With the route `by_inertia` first.
    path : Path
        A PNG file.
    """
    found, routes = result.sources.identified, result.sources.routes
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


def _line(
    axes: Axes, found: CorrelatedQuantities, x: Floats, relation: Callable[[Mapping[str, Any], float], Any]
) -> None:
    """Draw a relation over x with twice its standard uncertainty from a, b, c."""
    drawn = found.derived(lambda q: {str(i): relation(q, value) for i, value in enumerate(x)})
    at = slice(len(found.names), None)
    y, sigma = drawn.values[at], np.sqrt(np.maximum(np.diag(drawn.covariance)[at], 0.0))
    axes.fill_between(x, y - 2.0 * sigma, y + 2.0 * sigma, color=MEASURED, alpha=0.18, lw=0)
    axes.plot(x, y, color=MEASURED, lw=1.3, label="what the motion says, ±2σ")


def _route_label(route: Relations) -> str:
    return {
        "by_inertia": "with J, spring, C",
        "by_inertia_and_motor": "with J, h, motor",
        "by_motor": "with motor, spring",
    }.get(route.route, route.route)


def synthesis_figure(result: Design, path: Path) -> None:
    """Draw the step response before and after a synthesis, each as a share of its steady state."""
    made, before = result.sources.synthesis, result.sources.before
    if made is None:
        raise ValueError("no synthesis to draw: nothing was wished for")
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
