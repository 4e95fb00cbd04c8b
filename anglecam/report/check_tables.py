"""Tables of `anglecam check` for the terminal."""

from __future__ import annotations

import math
from dataclasses import fields

from rich.table import Table

from anglecam.check.prediction import Prediction
from anglecam.check.sigma_terms import SPREAD
from anglecam.check.smallest import SIZE_SPREAD
from anglecam.data.rounding import with_uncertainty
from anglecam.effects.unit_names import unit_on_screen
from anglecam.errors import printable

_CAUSES = {
    "noise": "noise of the pixels",
    "grid": "codec and pixel grid",
    "pivot": "pivot",
    "zero": "zero of the angle",
    "view": "lens and tilt",
    "exposure": "motion within the exposure",
}


def prediction_table(found: Prediction) -> Table:
    """Tabulate what was found in a clip, and the uncertainty to expect."""
    title = f"{found.name}: {found.frames_read} frames read, {found.seconds_read:.1f} s"
    table = Table("found", "", title=printable(title), title_justify="left")
    table.add_row("measured", f"{found.frames_measured} of {found.frames_read} frames, on the {found.mark}")
    table.add_row("pivot", f"{found.pivot}, lever {found.lever_px:.0f} px")
    contrast = "" if found.contrast_grey is None else f", the mark stands out by {found.contrast_grey:.0f}"
    table.add_row("noise", f"{found.noise_grey:.1f} grey levels{contrast}")
    if found.exposure_s is not None:
        value, sigma = (1000.0 * x for x in found.exposure_s)
        table.add_row("exposure", f"{with_uncertainty(value, sigma, ' ms')}, from the blur")
    whole = math.degrees(found.whole.sigma)
    table.add_row("sigma of a frame", f"{whole:.2g}°, expected between {whole / SPREAD:.2g}° and {whole * SPREAD:.2g}°")
    terms = {_CAUSES[f.name]: getattr(found.whole, f.name) ** 2 for f in fields(found.whole)}
    shares = sorted(terms.items(), key=lambda item: -item[1])
    total = max(sum(terms.values()), 1e-300)
    table.add_row(
        "shares of its variance", ", ".join(f"{name} {v / total:.0%}" for name, v in shares if v >= 0.01 * total)
    )
    return table


def smallest_table(found: Prediction) -> Table:
    """Tabulate the smallest sizes that a session would show; the prediction has sizes."""
    sizes = found.sizes
    assert sizes is not None
    title = (
        f"smallest sizes that {sizes.recordings} recordings of {sizes.duration:.1f} s would show ({sizes.motion});"
        f" within a factor of {SIZE_SPREAD:g}"
    )
    table = Table("effect", "parameter", "smallest", title=title, title_justify="left")
    for one in sizes.smallest:
        first = one.effect.parameters[0]
        limit = "up to " if first.inverse else ""
        table.add_row(one.effect.id, first.name, f"{limit}{one.size:.2g}{unit_on_screen(first.name)}")
    return table


def advice_table(found: Prediction) -> Table:
    """Tabulate what would help, with the factors."""
    table = Table("what would help", "sigma ×", "smallest sizes ×", title_justify="left")
    rows = [(one.text, f"{one.sigma_factor:.2f}", one.size_factor) for one in found.advice]
    if found.played is not None:
        rows.append((f"play {found.played.description}", "1.00", found.played.factor))
    for text, sigma, size in sorted(rows, key=lambda row: row[2]):
        table.add_row(text, sigma, f"{size:.2f}")
    return table
