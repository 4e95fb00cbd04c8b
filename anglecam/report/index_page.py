"""``index.html``: the clips of a batch as a table with pictures, which can be sorted and filtered.

Pictures and pages of the clips lie beside it and are linked, so that the page stays small however many clips there are.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import quote

from anglecam.io.session import SERIES_ENDING
from anglecam.report.document import html_of
from anglecam.report.origin import origin_of
from anglecam.report.page_names import THUMBNAIL_ENDING, page_name

HEADS = (
    "clip",
    "status",
    "measured",
    "median σ, °",
    "length, s",
    "frames",
    "size, px",
    "verdict",
    "effects",
    "notes",
)
"""Columns after the picture."""
REPORT = "report.html"


def index_html(rows: Sequence[Mapping[str, Any]], folder: Path) -> str:
    """Return the index of a batch as a page.

    Parameters
    ----------
    rows : sequence of mapping
        The rows of ``index.csv``, by the names of its columns.
    folder : Path
        The output folder, in which the pages, thumbnails and reports that exist are linked.

    Returns
    -------
    str
        One HTML document.
    """
    return html_of(
        "index.html",
        contents={},
        made=origin_of(()),
        images="'self' file: data:",
        rows=[_row(row, folder) for row in rows],
        counts=dict(sorted(Counter(row["status"] for row in rows).items())),
        heads=HEADS,
    )


def _row(row: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    path = PurePosixPath(row["path"])
    pictures = ("width_px", "height_px")
    size = "" if row["width_px"] is None else " × ".join(str(row[side]) for side in pictures)
    share, sigma = row["share_measured"], row["median_sigma_deg"]
    return {
        "path": row["path"],
        "name": path.name,
        "folder": str(path.parent),
        "status": row["status"],
        "cause": row["cause"],
        "thumbnail": _link(folder, row["series"], lambda name: name + THUMBNAIL_ENDING),
        "page": _link(folder, row["series"], page_name),
        "cells": [
            _cell("" if share is None else f"{100.0 * share:.1f} %", share),
            _cell("" if sigma is None else f"{sigma:.2g}", sigma),
            _cell("" if row["duration_s"] is None else f"{row['duration_s']:.2f}", row["duration_s"]),
            _cell(row["frames"], row["frames"]),
            _cell(size, row["width_px"]),
            _cell((row["verdict"] or "").replace("_", " "), row["verdict"], _report(folder, row["model"])),
            _cell((row["effects"] or "").replace("_", " ")),
            _cell(row["notes"]),
        ],
    }


def _cell(text: object, key: object = None, link: str | None = None) -> dict[str, Any]:
    """Return a cell: its text, what it is sorted by, and where it leads."""
    shown = "" if text is None else str(text)
    return {"text": shown, "key": shown if key is None else key, "link": link}


def _link(folder: Path, series: str | None, named: Callable[[str], str]) -> str | None:
    """Return the address of a file of a clip, if it exists; ``named`` gives its name from the clip's."""
    if series is None:
        return None
    beside = PurePosixPath(series)
    file = beside.with_name(named(beside.name.removesuffix(SERIES_ENDING)))
    return quote(str(file)) if (folder / file).exists() else None


def _report(folder: Path, model: str | None) -> str | None:
    """Return the address of the report beside a session's model, if it exists."""
    file = None if model is None else PurePosixPath(model).with_name(REPORT)
    return quote(str(file)) if file is not None and (folder / file).exists() else None
