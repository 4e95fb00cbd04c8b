"""``NAME.budget.html`` and ``NAME.budget.json``: every term of the angle's uncertainty, checked by Monte Carlo."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from rich.table import Table

from anglecam import __version__
from anglecam.budget.clip import PAPER, Budget, FrameBudget, budget_as_dict, budget_of, implied_lever, pixel_bound
from anglecam.budget.collect import error_sources
from anglecam.budget.gum import Propagated
from anglecam.io.files import write_atomically, write_json
from anglecam.io.rig import Rig
from anglecam.measurement.clip import Measurement
from anglecam.report.figure8 import Scene, figure8
from anglecam.report.figures import AFTER, BEFORE, FAINT, MEASURED, STYLE, _svg
from anglecam.video.film import Film

_HUES = ("#1f6f8b", "#c4432b", "#d39b23", "#6a4c93", "#3d7a4a", "#8a939c", "#b5651d", "#2b6cff", "#444b53")
_MANY = 1000
"""Degrees of freedom beyond which Student's t equals the normal distribution to three digits."""
_GAP = 1.5
"""Gap between frames, in median frame intervals, at which a curve is interrupted."""


def write_budget(film: Film, measured: Measurement, rig: Rig, out: Path) -> Budget:
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
    write_page(out / f"{budget.name}.budget.html", budget, _scene(film, measured, row))
    return budget


def write_page(path: Path, budget: Budget, scene: Scene | None) -> None:
    """Write the page of a budget as one HTML file without external resources.

    Parameters
    ----------
    path : Path
        The HTML file.
    budget : Budget
        A clip's budget.
    scene : Scene, optional
        The frame for Fig. 8; without it the figure is left out.
    """
    environment = Environment(loader=PackageLoader("anglecam.report", "."), autoescape=True, undefined=StrictUndefined)
    environment.filters["g"] = lambda value: f"{value:.3g}"
    environment.filters["nu"] = _nu
    content = budget_as_dict(budget)
    frames = (("typical frame", budget.typical), ("worst frame", budget.worst))
    drawings = {
        "over_time": _figure_over_time(budget),
        "distributions": _distribution_figure(budget),
        "figure8": None if scene is None else figure8(scene),
    }
    text = environment.get_template("budget.html").render(
        name=budget.name,
        version=__version__,
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
        figures={k: None if svg is None else environment.filters["safe"](svg) for k, svg in drawings.items()},
    )
    with write_atomically(path) as stream:
        stream.write(text)


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
        title=f"{budget.name}: frame {one.frame}, {one.angle_deg:.{digits}f}°, lever arm {one.lever_px:.1f} px",
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
    half = (one.drawn.high - one.drawn.low) / 2.0
    table.add_row("by Monte Carlo, 95 %", "", "", "", f"{one.drawn.trials} trials", f"{half:.{digits}f}")
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


def _scene(film: Film, measured: Measurement, row: int) -> Scene | None:
    contour = measured.contours_px[row]
    mark, pivot = measured.series.mark_px, measured.series.pivot_px
    image = next((f.image for f in film.frames() if f.index == row), None)
    if image is None or contour is None or mark is None or pivot is None:
        return None
    return Scene(image, contour, mark[row], pivot[row])


def _frame_content(title: str, one: FrameBudget, content: dict[str, Any]) -> dict[str, Any]:
    """Return the page's content for one frame; the last digit of U sets the last digit of the angle (GUM 7.2.6)."""
    stated = _decimals(one.combined.expanded, 2)
    fine = _decimals(one.combined.standard, 4)

    def interval(low: float, high: float) -> str:
        return f"{low - one.angle_deg:+.{fine}f} … {high - one.angle_deg:+.{fine}f}"

    known = 1.959964 * one.combined.standard
    low, high = one.angle_deg - one.combined.expanded, one.angle_deg + one.combined.expanded
    # if the linear budget is not validated, the Monte Carlo interval is stated (JCGM 101, 5.8)
    ends = (one.drawn.low, one.drawn.high)
    half = one.combined.expanded if one.comparison.agrees else max(abs(end - one.angle_deg) for end in ends)
    return {
        "title": title,
        "content": content,
        "angle": f"{one.angle_deg:.{stated}f}",
        "expanded": f"{half:.{stated}f}",
        "decimals": _decimals(one.combined.standard, 3),
        "fine": fine,
        "gum": interval(low, high),
        "gum_known": interval(one.angle_deg - known, one.angle_deg + known),
        "drawn": interval(one.drawn.low, one.drawn.high),
        "drawn_known": interval(one.drawn_as_known.low, one.drawn_as_known.high),
        "agrees": one.comparison.agrees,
        "linear": one.linearity.agrees,
        "apart": max(one.comparison.low, one.comparison.high),
        "linear_apart": max(one.linearity.low, one.linearity.high),
        "tolerance": one.comparison.tolerance,
        "error": max(one.drawn.error, one.drawn_as_known.error),
        "trials": one.drawn.trials,
    }


def _figure_over_time(budget: Budget) -> str:
    """Draw the angle, its uncertainty and every term's contribution over time, as SVG."""
    s = budget.sources
    with plt.rc_context(STYLE):
        figure, (top, bottom) = plt.subplots(
            2, 1, figsize=(9, 5), sharex=True, height_ratios=(1, 2), layout="constrained"
        )
        step = np.diff(s.time)
        breaks = np.flatnonzero(step > _GAP * np.median(step)) + 1 if len(step) else np.array([], int)
        time = np.insert(s.time, breaks, np.nan)

        def plot(ax: Any, values: Any, **how: Any) -> None:
            ax.plot(time, np.insert(np.degrees(values), breaks, np.nan), **how)

        plot(top, s.angle, color=MEASURED, lw=1.0)
        top.set_ylabel("angle, °")
        plot(bottom, budget.total, color=MEASURED, lw=1.8, label="combined")
        if not np.allclose(budget.sigma, budget.total):
            plot(bottom, budget.sigma, color=MEASURED, lw=1.0, ls=":", label="sigma of the series")
        for term, hue in zip(budget.terms_over_time, _HUES, strict=False):
            plot(bottom, term.contribution, color=hue, lw=1.0, label=term.name)
        for one, name in ((budget.typical, "typical"), (budget.worst, "worst")):
            for ax in (top, bottom):
                ax.axvline(one.time, color=FAINT, lw=4, zorder=0)
            top.annotate(
                name, (one.time, 1.0), xycoords=("data", "axes fraction"), fontsize=8, ha="center", va="bottom"
            )
        bottom.set(xlabel="time on the clip's clock, s", ylabel="standard uncertainty, °", ylim=(0.0, None))
        figure.legend(*bottom.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
        return _svg(figure)


def _distribution_figure(budget: Budget) -> str:
    """Draw the Monte Carlo densities with the densities that the GUM assumes and both 95 % intervals, as SVG."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 2, figsize=(9, 2.9), layout="constrained")
        for ax, one, name in zip(axes, (budget.typical, budget.worst), ("typical frame", "worst frame"), strict=True):
            _draw_density(ax, one, one.drawn)
            ax.set_title(f"{name}: {one.frame}", loc="left", fontsize=9)
            ax.set_xlabel("error of the angle, °")
            ax.set_yticks([])
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
        return _svg(figure)


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
