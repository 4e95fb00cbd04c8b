"""``NAME.budget.html`` and ``NAME.budget.json``: every term of the angle's uncertainty, checked by Monte Carlo."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from rich.table import Table

from anglecam.budget.clip import PAPER, Budget, FrameBudget, budget_as_dict, budget_of, implied_lever, pixel_bound
from anglecam.budget.collect import error_sources
from anglecam.budget.gum import Propagated
from anglecam.data.typing import Floats
from anglecam.errors import printable
from anglecam.io.files import write_json
from anglecam.io.rig import Rig
from anglecam.measurement.clip import Measurement
from anglecam.report.curves import Columns, Curve, Plot, curves_as_dict
from anglecam.report.document import html_of, write_html
from anglecam.report.figure8 import Scene, figure8
from anglecam.report.figures import AFTER, BEFORE, FAINT, MEASURED, panel
from anglecam.report.origin import Origin
from anglecam.video.film import Film

_HUES = ("#1f6f8b", "#c4432b", "#d39b23", "#6a4c93", "#3d7a4a", "#8a939c", "#b5651d", "#2b6cff", "#444b53")
ANGLE, TERMS = "angle", "standard uncertainty, term by term"
"""Titles of the plots over time."""
CONTENTS = {
    "terms": "1 · Term by term",
    "time": "2 · Over the clip",
    "montecarlo": "3 · Check by Monte Carlo",
    "bounds": "4 · If the mark is 6 px or 10 px off",
    "figure8": "5 · Fig. 8 on this clip",
    "missing": "6 · What is not in the budget",
}
_MANY = 1000
"""Degrees of freedom beyond which Student's t equals the normal distribution to three digits."""
_GAP = 1.5
"""Gap between frames, in median frame intervals, at which a curve is interrupted."""


def write_budget(film: Film, measured: Measurement, rig: Rig, out: Path, made: Origin | None = None) -> Budget:
    """Write ``NAME.budget.json`` and ``NAME.budget.html`` of a measured clip.

    Parameters
    ----------
    film : Film
        The clip; the page shows one frame of it.
    measured : Measurement
        The measured clip.
    rig : Rig
        The rig that it was measured with.
    out : Path
        A folder; created if missing.
    made : Origin, optional
        How the budget was made.

    Returns
    -------
    Budget
        The content of the files.

    Raises
    ------
    InputError
        If the film can no longer be read.
    """
    budget = budget_of(measured.series.name, error_sources(measured, rig), rig.pixel_error_px)
    row = budget.typical.frame - film.first_frame
    write_json(out / f"{budget.name}.budget.json", budget_as_dict(budget))
    write_page(out / f"{budget.name}.budget.html", budget, _scene(film, measured, row), made)
    return budget


def write_page(path: Path, budget: Budget, scene: Scene | None, made: Origin | None = None) -> None:
    """Write the page of a budget as one HTML file without external resources.

    Parameters
    ----------
    path : Path
        The HTML file.
    budget : Budget
        A clip's budget.
    scene : Scene, optional
        The frame for Fig. 8; without it the figure is left out.
    made : Origin, optional
        How the budget was made.
    """
    content = budget_as_dict(budget)
    frames = (("typical frame", budget.typical), ("worst frame", budget.worst))
    figures = {
        "over_time": [_panel(svg, plot, plot) for plot, svg in _over_time(budget).items()],
        "distributions": [_panel(_distribution(one), f"{title}: number {one.frame}") for title, one in frames],
        "figure8": [] if scene is None else [_panel(figure8(scene))],
    }
    recording = Columns(budget.name, 0, _columns(budget))
    text = html_of(
        "budget.html",
        contents=CONTENTS,
        made=made,
        curves=curves_as_dict([recording], _plots(budget)),
        filters={"g": lambda value: f"{value:.3g}", "nu": _nu},
        name=printable(budget.name),
        content=content,
        lever=budget.lever_px,
        pivot_sigma=np.sqrt(np.diag(budget.sources.pivot_covariance_px2)),
        median_sigma=math.degrees(float(np.median(budget.sigma))),
        registered=budget.sources.registration is not None,
        timed=not all(term.in_sigma for term in budget.terms_over_time),
        frames=[_frame_content(title, one, content[title.split()[0]]) for title, one in frames],
        decimals=_decimals(budget.typical.combined.standard, 3),
        paper=[
            {
                "radius": radius,
                "stated": stated,
                "lever": implied_lever(radius, stated),
                "here": math.degrees(pixel_bound(radius, budget.lever_px).worst),
            }
            for radius, stated in PAPER
        ],
        at_paper=[math.degrees(pixel_bound(r, implied_lever(*PAPER[1])).worst) for r, _ in PAPER],
        figures=figures,
    )
    write_html(path, text)


def budget_table(budget: Budget) -> Table:
    """Return a budget as a table for the terminal: the typical frame term by term, the clip and the pixel bounds."""
    one = budget.typical
    combined, digits = one.combined, _decimals(one.combined.standard, 3)
    table = Table(
        "term",
        "standard uncertainty",
        "distribution",
        "ν",
        "sensitivity",
        "contribution, °",
        "share",
        title=f"{budget.name}: typical frame {one.frame}, lever arm {one.lever_px:.1f} px\n{stated(one)}",
        title_justify="left",
    )
    for i in (1, 3, 4, 5, 6):
        table.columns[i].justify = "right"
    for t, share in zip(combined.terms, combined.shares, strict=True):
        table.add_row(
            t.name,
            f"{t.uncertainty:.3g} {t.unit}",
            t.shape,
            _nu(t.dof),
            f"{t.sensitivity:.3g} °/{t.unit}",
            f"{t.contribution:.{digits}f}",
            f"{share:.1%}",
        )
    table.add_section()
    table.add_row("combined", "", "", _nu(combined.dof), "", f"{combined.standard:.{digits}f}", "")
    table.add_row(
        "expanded, 95 %", "", "", "", f"k = {combined.coverage_factor:.2f}", f"{combined.expanded:.{digits}f}"
    )
    drawn = _interval(one, one.drawn.low, one.drawn.high, digits)
    table.add_row("by Monte Carlo, 95 %", "", "", "", f"{one.drawn.trials} trials", drawn)
    table.add_section()
    rms, worst = math.sqrt(float((budget.total**2).mean())), float(budget.total.max())
    table.add_row("combined, RMS of the clip", "", "", "", "", f"{math.degrees(rms):.{digits}f}")
    table.add_row(f"combined, worst: frame {budget.worst.frame}", "", "", "", "", f"{math.degrees(worst):.{digits}f}")
    table.add_section()
    for b in budget.bounds:
        table.add_row(
            f"{b.radius_px:g} px, worst case", "", "", "", f"R = {b.lever_px:.1f} px", f"{math.degrees(b.worst):.3f}"
        )
        table.add_row(f"{b.radius_px:g} px, standard", "", "uniform disc", "", "", f"{math.degrees(b.standard):.3f}")
    return table


def stated(one: FrameBudget) -> str:
    """Return a frame's angle with its 95 % interval, as the page's head and the terminal state it.

    The interval is ± U, or that by Monte Carlo if the linear budget is not validated (JCGM 101, 5.8). The last digit
    of U sets the last digit of all (GUM 7.2.6).
    """
    angle, expanded = one.angle_deg, one.combined.expanded
    low, middle, high = (
        f"{x:.{_decimals(expanded, 2)}f}°".replace("-", "−") for x in (one.drawn.low, angle, one.drawn.high)
    )
    if one.comparison.agrees:
        return (
            f"angle = {middle} ± {expanded:.{_decimals(expanded, 2)}f}° (95 %, k = {one.combined.coverage_factor:.2f})"
        )
    return f"angle = {middle}, between {low} and {high} (95 %, by Monte Carlo: the linear budget is not validated)"


def _interval(one: FrameBudget, low: float, high: float, digits: int) -> str:
    """Return an interval relative to a frame's angle, °."""
    return f"{low - one.angle_deg:+.{digits}f} … {high - one.angle_deg:+.{digits}f}".replace("-", "−")


def _scene(film: Film, measured: Measurement, row: int) -> Scene | None:
    contour = measured.contours_px[row]
    mark, pivot = measured.series.mark_px, measured.series.pivot_px
    image = next((f.image for f in film.frames() if f.index == row), None)
    if image is None or contour is None or mark is None or pivot is None:
        return None
    return Scene(image, contour, mark[row], pivot[row])


def _frame_content(title: str, one: FrameBudget, content: dict[str, Any]) -> dict[str, Any]:
    """Return the page's content for one frame."""
    fine = _decimals(one.combined.standard, 4)

    known = 1.959964 * one.combined.standard
    low, high = one.angle_deg - one.combined.expanded, one.angle_deg + one.combined.expanded
    return {
        "title": title,
        "content": content,
        "stated": stated(one),
        "decimals": _decimals(one.combined.standard, 3),
        "fine": fine,
        "gum": _interval(one, low, high, fine),
        "gum_known": _interval(one, one.angle_deg - known, one.angle_deg + known, fine),
        "drawn": _interval(one, one.drawn.low, one.drawn.high, fine),
        "drawn_known": _interval(one, one.drawn_as_known.low, one.drawn_as_known.high, fine),
        "agrees": one.comparison.agrees,
        "linear": one.linearity.agrees,
        "apart": max(one.comparison.low, one.comparison.high),
        "linear_apart": max(one.linearity.low, one.linearity.high),
        "tolerance": one.comparison.tolerance,
        "error": max(one.drawn.error, one.drawn_as_known.error),
        "trials": one.drawn.trials,
    }


def _panel(svg: str, title: str = "", plot: str = "") -> dict[str, Any]:
    """Return a panel as the template shows it; ``plot`` is what the scripts draw in its place."""
    return {"svg": svg, "title": title, "plot": plot, "number": 0 if plot else None}


def _columns(budget: Budget) -> dict[str, Floats]:
    """Return the columns of the plots over time, with a row without values in every gap between frames."""
    time = budget.sources.time
    step = np.diff(time)
    breaks = np.flatnonzero(step > _GAP * np.median(step)) + 1 if len(step) else np.array([], int)
    found = {"time": np.insert(time, breaks, 0.5 * (time[breaks - 1] + time[breaks]))}
    values = {"angle": budget.sources.angle, "combined": budget.total, "sigma": budget.sigma}
    values |= {f"term{k}": term.contribution for k, term in enumerate(budget.terms_over_time)}
    return found | {name: np.insert(np.degrees(one), breaks, np.nan) for name, one in values.items()}


def _plots(budget: Budget) -> dict[str, Plot]:
    """Return the plots over time by their titles."""
    curves = [Curve("combined", "combined", MEASURED)]
    if not np.allclose(budget.sigma, budget.total):
        curves.append(Curve("sigma", "sigma of the series", "#7a858f"))
    terms = zip(budget.terms_over_time, _HUES, strict=False)
    curves += [Curve(f"term{k}", term.name, hue) for k, (term, hue) in enumerate(terms)]
    return {
        ANGLE: Plot("angle, °", (Curve("angle", "angle", MEASURED),)),
        TERMS: Plot("standard uncertainty, °", tuple(curves), from_zero=True),
    }


def _over_time(budget: Budget) -> dict[str, str]:
    """Draw the same plots as SVG, with the typical and the worst frame marked."""
    columns = _columns(budget)

    def draw(axes: Axes, plot: Plot) -> None:
        for one in (budget.typical, budget.worst):
            axes.axvline(one.time, color=FAINT, lw=4, zorder=0)
        for curve in plot.curves:
            axes.plot(columns["time"], columns[curve.column], color=curve.colour, lw=1.0, label=curve.label)
        if plot.from_zero:
            axes.set_ylim(0.0, None)

    return {title: panel(plot.label, partial(draw, plot=plot)) for title, plot in _plots(budget).items()}


def _distribution(one: FrameBudget) -> str:
    """Draw the Monte Carlo density with the density that the GUM assumes and both 95 % intervals, as SVG."""

    def draw(ax: Axes) -> None:
        _draw_density(ax, one, one.drawn)
        ax.set_yticks([])

    return panel("density", draw, "error of the angle, °")


def _draw_density(ax: Any, one: FrameBudget, drawn: Propagated) -> None:
    from scipy import stats  # loading takes most of a second, which other pages do not need

    c = one.combined
    ax.stairs(drawn.density, drawn.edges - one.angle_deg, fill=True, color=FAINT, label="Monte Carlo")
    x = np.linspace(drawn.edges[0], drawn.edges[-1], 400) - one.angle_deg
    pdf = stats.norm.pdf(x / c.standard) if math.isinf(c.dof) else stats.t.pdf(x / c.standard, c.dof)
    ax.plot(
        x, pdf / c.standard, color=AFTER, lw=1.2, label="GUM: Student's t" if math.isfinite(c.dof) else "GUM: normal"
    )
    for ends, colour, style, label in (
        ((drawn.low - one.angle_deg, drawn.high - one.angle_deg), MEASURED, "-", "95 % Monte Carlo"),
        ((-c.expanded, c.expanded), BEFORE, "--", "95 % GUM"),
    ):
        for k, end in enumerate(ends):
            ax.axvline(end, color=colour, ls=style, lw=1.1, label=label if k == 0 else None)


def _nu(dof: float | None) -> str:
    return "∞" if dof is None or math.isinf(dof) else f"{dof:.0f}" if dof < _MANY else f"> {_MANY}"


def _decimals(value: float, digits: int) -> int:
    """Return the number of decimals that show a number of significant digits."""
    return 3 if value <= 0.0 else max(digits - 1 - math.floor(math.log10(value)), 0)
