"""One HTML file: a template that extends ``base.html``, with stylesheet, scripts and data in it; it needs no network.

The scripts are built from ``anglecam/web/src`` and committed as ``anglecam/web/static``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from anglecam import __version__
from anglecam.errors import printable
from anglecam.io.files import write_atomically
from anglecam.report.origin import Origin

ORIGIN = "How this was made"
"""Heading of the last section of every page."""


def html_of(
    template: str,
    *,
    contents: Mapping[str, str],
    made: Origin | None = None,
    curves: Mapping[str, Any] | None = None,
    images: str = "data:",
    filters: Mapping[str, Any] | None = None,
    **values: Any,
) -> str:
    """Return a page.

    Parameters
    ----------
    template : str
        File name of a template beside this module that extends ``base.html``.
    contents : mapping of str to str
        Headings by anchor, in order; the template uses both. The origin is added.
    made : Origin, optional
        How the result was made.
    curves : mapping, optional
        From `anglecam.report.curves.curves_as_dict`; the scripts draw it.
    images : str
        Sources of pictures that the page may load, as a Content Security Policy states them. Nothing else is loaded.
    filters : mapping, optional
        Further filters of the template, by name.
    **values
        Names of the template.

    Returns
    -------
    str
        One HTML document.
    """
    # autoescape, because names of files and recordings come from the user; figures and pictures are marked as safe
    environment = Environment(loader=PackageLoader("anglecam.report", "."), autoescape=True, undefined=StrictUndefined)
    environment.filters |= dict(filters or {}) | {"printable": printable}
    static = files("anglecam") / "web" / "static"
    styles = (files("anglecam.report") / "style.css", static / "report.css")
    return environment.get_template(template).render(
        contents=dict(contents) | ({"origin": ORIGIN} if made else {}),
        made=made,
        curves=None if curves is None else _script_json(curves),
        images=images,
        style=Markup("\n".join(one.read_text("utf-8") for one in styles)),
        script=Markup((static / "report.js").read_text("utf-8").replace("</script", "<\\/script")),
        version=__version__,
        **values,
    )


def write_html(path: Path, text: str) -> None:
    """Write a page, whole or not at all."""
    with write_atomically(path) as stream:
        stream.write(text)


def _script_json(content: Mapping[str, Any]) -> Markup:
    """Return JSON that cannot end the ``<script>`` element which holds it."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c"))
