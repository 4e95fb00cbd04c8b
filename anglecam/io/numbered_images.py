"""Find the numbered pictures of a folder, which together are a film: ``run_0001.png``, ``run_0002.png``, …."""

from __future__ import annotations

import re
from pathlib import Path

from anglecam.errors import InputError

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
_NUMBERED = re.compile(r"(?P<series>.*?)(?P<number>[0-9]{1,18})", re.DOTALL)


def has_numbered_images(folder: Path) -> bool:
    """Return whether a folder has at least two pictures of one numbered series."""
    return any(len(images) > 1 for images in _series(folder).values())


def find_numbered_images(folder: Path) -> dict[int, Path]:
    """Return the numbered pictures of a folder by their number, in order.

    Parameters
    ----------
    folder : Path
        A folder. Hidden files, and files that are no pictures or whose names do not end in a number, are left out.

    Returns
    -------
    dict of int to Path
        At least two pictures.

    Raises
    ------
    InputError
        Where the folder has no such series or several of them, a number occurs twice, or more numbers are missing than
        there are: numbers that are no count, such as times, would give wrong times.
    """
    series = {name: images for name, images in _series(folder).items() if len(images) > 1}
    if not series:
        raise InputError(f"{folder}: no numbered pictures in this folder")
    if len(series) > 1:
        one, other = sorted(series)[:2]
        raise InputError(f"{folder}: pictures of several series ({one}, {other}); give each series its own folder")
    images = sorted(*series.values(), key=lambda image: image[0])
    found = dict(images)
    if len(found) < len(images):
        raise InputError(f"{folder}: two pictures have the same number")
    first, last = images[0][0], images[-1][0]
    if last - first + 1 > 2 * len(found):
        raise InputError(f"{folder}: {len(found)} pictures have the numbers {first} to {last}; number them one by one")
    return found


def _series(folder: Path) -> dict[str, list[tuple[int, Path]]]:
    """Return the numbered pictures of a folder by what stands before and after their number."""
    found: dict[str, list[tuple[int, Path]]] = {}
    for path in folder.iterdir():
        named = _NUMBERED.fullmatch(path.stem)
        is_image = path.suffix.lower() in IMAGE_ENDINGS and not path.name.startswith(".")
        if named is not None and is_image and path.is_file():
            found.setdefault(f"{named['series']}*{path.suffix}", []).append((int(named["number"]), path))
    return found
