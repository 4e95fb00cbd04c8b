"""``certificate.html``: a servo's quantities with intervals, likelihoods and conditions, on one page."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.ticker import MaxNLocator
from rich.table import Table

from anglecam import __version__
from anglecam.certificate.certificate_json import certificate_as_dict
from anglecam.certificate.certify import Certificate, Certified
from anglecam.data.rounding import with_uncertainty
from anglecam.io.files import write_atomically
from anglecam.loop.profile import THRESHOLD
from anglecam.report.figures import AFTER, BEFORE, FAINT, MEASURED, STYLE, _svg

COLOURS = {True: "#1f6f8b", False: "#b5651d"}
STATES = {
    "measured": "measured",
    "bounded": "bound",
    "not_determined": "not determined",
    "not_certified": "not certified",
}
FIGURE = (2.9, 2.1)
"""Size of the figure of one quantity, inches; three stand side by side, or one on a narrow screen."""
TALLEST = 12.0
"""Largest deviance that a figure shows; beyond it the value is excluded without any doubt."""


def write_certificate_page(
    path: Path, title: str, certificate: Certificate, inputs: Sequence[tuple[str, str]], problems: Sequence[str]
) -> None:
    """Write the page of a certificate as one HTML file without external resources.

    Parameters
    ----------
    path : Path
        The HTML file.
    title : str
        The session's name.
    certificate : Certificate
        From `anglecam.certificate.certify.certify`.
    inputs : sequence of (str, str)
        Names and SHA-256 sums of the files that were certified.
    problems : sequence of str
        Recordings that could not be used and parts that failed, with the cause.
    """
    environment = Environment(loader=PackageLoader("anglecam.report", "."), autoescape=True, undefined=StrictUndefined)
    content = certificate_as_dict(certificate)
    rows = [_row(one, shown) for one, shown in zip(certificate.quantities, content["quantities"], strict=True)]
    certified = [one for one in certificate.quantities if certificate.certifies(one)]
    drawn = [one for one in certified if one.profile is not None and len(one.profile.values) > 2]
    text = environment.get_template("certificate.html").render(
        title=title,
        version=__version__,
        day=f"{date.today():%d %B %Y}".lstrip("0"),
        colour=COLOURS[certificate.holds],
        content=content,
        rows=rows,
        figures=[Markup(_figure(one)) for one in drawn],
        with_uncertainty=with_uncertainty,
        inputs=inputs,
        problems=problems,
    )
    with write_atomically(path) as stream:
        stream.write(text)


def certificate_table(certificate: Certificate) -> Table:
    """Tabulate a certificate for the terminal."""
    content = certificate_as_dict(certificate)
    table = Table("quantity, 95 %", "")
    for one in content["quantities"]:
        lines = list(one["aliases"])
        if one["determined_by"]:
            file = f" ({one['command_file']})" if one["command_file"] else ""
            lines.append(f"play this to determine it: {one['determined_by']}{file}")
        table.add_row(one["statement"], "\n".join(lines))
    return table


def _row(one: Certified, content: dict[str, Any]) -> dict[str, Any]:
    """Return a quantity's row; a torque also in degrees of command."""
    command = ""
    if "command_deg" in content and one.state != "not_determined":
        low, high = content["command_deg"]["interval_95"]
        command = {
            "measured": f"{low:.3g}° to {high:.3g}°",
            "bounded": f"above {low:.2g}°" if one.quantity.is_limit else f"below {high:.2g}°",
        }[one.state]
    return content | {"state": STATES[content["state"]], "name": one.quantity.name, "command": command}


def _figure(one: Certified) -> str:
    """Draw a profile likelihood as SVG: deviance over the quantity, with the 95 % level and the interval."""
    with plt.rc_context(STYLE):
        figure, ax = plt.subplots(figsize=FIGURE, layout="constrained")
        _draw_profile(ax, one)
        ax.set_ylabel("2·loss of log L", fontsize=8)
        return _svg(figure)


def _draw_profile(ax: Any, one: Certified) -> None:
    assert one.profile is not None
    quantity, near = one.quantity, one.profile.deviances <= TALLEST
    # A limit is drawn over its reciprocal, whose 0 is no limit; the ticks are named by the limit.
    factor = 1.0 if quantity.is_limit else quantity.to_file
    ax.plot(factor * one.profile.values[near], one.profile.deviances[near], color=AFTER, lw=1.2, marker=".", ms=3)
    ax.axhline(THRESHOLD, color=BEFORE, lw=0.8, ls="--")
    ends = [end for end in one.interval if np.isfinite(end)]
    if len(ends) == 2:
        ax.axvspan(factor * ends[0], factor * ends[1], color=FAINT, alpha=0.6, zorder=0)
    ax.axvline(factor * one.profile.estimate, color=MEASURED, lw=0.8)
    ax.set_title(quantity.name, loc="left", fontsize=9)
    ax.set_xlabel(quantity.unit.strip(), fontsize=8)
    ax.set_ylim(0.0, TALLEST)
    if quantity.is_limit:
        low, high = ax.get_xlim()
        places, names = limit_ticks(low, high, quantity.to_file)
        ax.set_xticks(places, names)
        ax.invert_xaxis()
    else:
        ax.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4))
        ax.locator_params(axis="x", nbins=4)


def limit_ticks(low: float, high: float, to_file: float) -> tuple[list[float], list[str]]:
    """Return the ticks of an axis over the reciprocal of a limit.

    Parameters
    ----------
    low, high : float
        Ends of the axis, SI.
    to_file : float
        The limit is this divided by the reciprocal.

    Returns
    -------
    places : list of float
        Round values of the limit as reciprocals, ascending, at least a quarter of the axis apart.
    names : list of str
        The limit at each place; ``∞`` at zero.

    Examples
    --------
    >>> limit_ticks(0.0, 0.01, 1.0)[1]
    ['∞', '200', '100']
    """
    least = to_file / high
    if low > 0.5 * high:
        limits = np.asarray(MaxNLocator(4).tick_values(least, to_file / low))[::-1]
    else:
        decades = 10.0 ** np.arange(np.floor(np.log10(least)), np.floor(np.log10(least)) + 3)
        limits = np.outer(decades, (1.0, 2.0, 5.0)).ravel()[::-1]
    candidates = [*([0.0] if low <= 0.0 else []), *(to_file / limits)]
    places: list[float] = []
    for place in candidates:
        if low <= place <= high * (1.0 + 1e-9) and (not places or place - places[-1] > 0.25 * (high - low)):
            places.append(float(place))
    return places, ["∞" if place == 0.0 else f"{to_file / place:.6g}" for place in places]
