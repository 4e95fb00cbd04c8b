"""Names of the files that a page of a clip consists of; apart from the pages, whose figures take a second to load."""

from __future__ import annotations

THUMBNAIL_ENDING = ".thumb.webp"
OTHER_PAGES = ("index", "report")
"""Names of pages of sessions and batches, which a clip's page must not replace."""


def page_name(name: str) -> str:
    """Return the file name of a clip's page.

    Examples
    --------
    >>> page_name("swing"), page_name("report")
    ('swing.html', 'report.angles.html')
    """
    return f"{name}.angles.html" if name in OTHER_PAGES else f"{name}.html"
