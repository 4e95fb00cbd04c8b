"""The frames of a film that a page shows, small enough to be part of it, with what was measured in each."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.data.typing import Image
from anglecam.errors import InputError
from anglecam.report.moments import EVENLY, Moment
from anglecam.video.film import Film
from anglecam.video.overlay import RADII_PX

MOST_OF_RECORDING, MOST_OF_PAGE = 60, 180
"""Pictures of one recording and of a page, which keep a report of any number of frames below some 8 MB."""
LONGEST_SIDE_PX = 560
"""Of a picture on a page."""
QUALITY = 55
"""Of WebP, in which a mark's edge is still sharp."""
CHOSEN_IN_PRINT = 6
"""Pictures of a recording that are printed: of those that are not merely evenly spaced."""


@dataclass(frozen=True)
class Picture:
    """One frame of a film."""

    row: int
    """Row of the series."""
    frame: int
    """Number in the film."""
    caption: str
    """What it shows, in words."""
    source: str
    """A data URI."""
    size: tuple[int, int]
    """Width and height of the frame in the film, px."""
    mark: tuple[float, float] | None = None
    """Where the mark was measured, px; ``None`` where it was not."""
    pivot: tuple[float, float] | None = None
    radii: tuple[float, ...] = RADII_PX
    """Of the circles around the mark within which the worst-case bounds let it lie, px."""
    chosen: bool = False
    """Whether it is printed."""


def most_pictures(recordings: int) -> int:
    """Return how many pictures each recording of a page may have."""
    return max(1, min(MOST_OF_RECORDING, MOST_OF_PAGE // max(recordings, 1)))


def take_pictures(film: Film | None, series: AngleSeries, moments: Sequence[Moment]) -> tuple[Picture, ...]:
    """Read the frames of a film that a page shows.

    Parameters
    ----------
    film : Film or None
        The film that the series was measured in; ``None`` for a series without one.
    series : AngleSeries
        A row a frame.
    moments : sequence of Moment
        From `anglecam.report.moments.choose_moments`.

    Returns
    -------
    tuple of Picture
        Without those frames that cannot be decoded; none if the film can no longer be read.
    """
    if film is None or not moments:
        return ()
    wanted = {moment.row: moment for moment in moments}
    ranked = [m.row for m in moments if m.why != EVENLY]
    chosen = {ranked[k] for k in np.linspace(0, len(ranked) - 1, CHOSEN_IN_PRINT).astype(int)} if ranked else set()
    found = []
    try:
        for frame in film.frames(only=wanted.keys()):
            if frame.image is not None:
                found.append(_picture(frame.image, series, wanted[frame.index], frame.index in chosen))
            if len(found) == len(wanted):
                break
    except InputError:  # the file has changed since it was measured
        return ()
    return tuple(found)


def thumbnail(picture: Image, longest_px: int = LONGEST_SIDE_PX, quality: int = QUALITY) -> bytes:
    """Return a picture, (h, w, 3) blue, green, red or (h, w, 1), as WebP, at most ``longest_px`` wide and high."""
    height, width = picture.shape[:2]
    scale = min(1.0, longest_px / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = picture if scale == 1.0 else cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, quality])[1])


def caption_of(series: AngleSeries, row: int) -> str:
    """Return number, time and angle of a frame, in words."""
    place = f"frame {series.first_frame + row}, {series.time[row]:.3f} s"
    if not series.ok[row]:
        return f"{place}: no angle ({series.status[row]})"
    angle, sigma = np.degrees([series.angle[row], series.sigma[row]])
    if not sigma > 0.0:
        return f"{place}: {angle:.3f}°".replace("-", "−")
    digits = int(np.clip(1 - np.floor(np.log10(sigma)), 1, 6))
    return f"{place}: {angle:.{digits}f}° ± {sigma:.{digits}f}°".replace("-", "−")


def _picture(image: Image, series: AngleSeries, moment: Moment, chosen: bool) -> Picture:
    row, (height, width) = moment.row, image.shape[:2]
    measured = series.ok[row] and series.mark_px is not None and series.pivot_px is not None
    places: Mapping[str, tuple[float, float]] = {}
    if measured and series.mark_px is not None and series.pivot_px is not None:
        pairs = (("mark", series.mark_px[row]), ("pivot", series.pivot_px[row]))
        places = {name: (round(float(x), 2), round(float(y), 2)) for name, (x, y) in pairs}
    return Picture(
        row,
        series.first_frame + row,
        caption_of(series, row) + ("" if moment.why == EVENLY else f"; {moment.why}"),
        "data:image/webp;base64," + base64.b64encode(thumbnail(image)).decode(),
        (width, height),
        **places,
        radii=tuple(sorted(series.bounds)) or RADII_PX,
        chosen=chosen,
    )
