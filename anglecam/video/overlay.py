"""The clip with the measured angle drawn into it, for a check by eye."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Protocol

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.series import OK, AngleSeries
from anglecam.data.typing import Floats, Image
from anglecam.io.files import write_whole
from anglecam.progress import Progress, unseen, watched
from anglecam.video.film import Film, Frame

RADII_PX = (6.0, 10.0)
"""Radii of the circles around the mark: the paper's pixel errors."""
_TICKS = 90_000
"""Per second; represents 24, 25, 30, 29.97, 60 Hz and milliseconds exactly."""
_SHIFT = 4
"""Fractional bits of cv2's drawing coordinates."""
_FONT, _SMALL = cv2.FONT_HERSHEY_SIMPLEX, 0.45
_ARROW_PX = 30
"""Length of the arrow that points at a pivot outside the picture."""
_LINE, _CONTOUR, _CIRCLES, _BAD = (255, 220, 0), (0, 255, 0), (0, 220, 255), (60, 60, 255)


class Measured(Protocol):
    """The content of an overlay: an angle series, and the outline that each position was measured on."""

    @property
    def series(self) -> AngleSeries:
        """A row a frame of the clip."""

    @property
    def contours_px(self) -> Sequence[NDArray[np.int32] | None]:
        """Each frame's (k, 2) outline of the mark, where one was found."""


def write_overlay(film: Film, measured: Measured, path: Path, progress: Progress = unseen) -> None:
    """Write ``NAME.overlay.mp4``: the clip in H.264, each frame at its time, with the measured angle drawn into it.

    Parameters
    ----------
    film : Film
        The clip that was measured.
    measured : Measured
        The result of measuring it.
    path : Path
        The file to write; it appears whole or not at all. Its folder is made if missing.
    progress : Progress
        Called after each frame.

    Raises
    ------
    InputError
        As `Film.frames`.
    """
    frames = watched(film.frames(), progress, "drawing the overlay", len(measured.series.time))
    with write_whole(path) as unfinished, av.open(str(unfinished), mode="w") as container:
        _encode(container, frames, measured)


def draw_frame(image: Image, measured: Measured, index: int) -> Image:
    """Draw one frame's line pivot→mark, outline, 6 px and 10 px circles, angle and sigma, or the status.

    Of a pivot outside the picture, an arrow at the edge shows the direction, and a number the distance from there.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) blue, green, red; it is not changed.
    measured : Measured
        The result of measuring the clip.
    index : int
        The frame's number.

    Returns
    -------
    ndarray
        (h, w, 3).
    """
    drawn: Image = image.copy()
    series = measured.series
    good = series.status[index] == OK
    contour = measured.contours_px[index]
    if contour is not None:
        cv2.polylines(drawn, [contour], True, _CONTOUR if good else _BAD, 1, cv2.LINE_AA)
    text = f"{series.time[index]:.3f} s  "
    if good and series.mark_px is not None and series.pivot_px is not None:
        pivot, mark = _fixed(series.pivot_px[index]), _fixed(series.mark_px[index])
        cv2.line(drawn, pivot, mark, _LINE, 1, cv2.LINE_AA, _SHIFT)
        cv2.circle(drawn, pivot, 3 << _SHIFT, _LINE, 1, cv2.LINE_AA, _SHIFT)
        _point_at_pivot_outside(drawn, series.pivot_px[index], series.mark_px[index])
        for radius in RADII_PX:
            cv2.circle(drawn, mark, round(radius * 2**_SHIFT), _CIRCLES, 1, cv2.LINE_AA, _SHIFT)
        angle, sigma = np.degrees((series.angle[index], series.sigma[index]))
        digits = int(np.clip(1 - np.floor(np.log10(sigma)), 2, 5)) if sigma > 0.0 else 3
        text += f"{angle:+.{digits}f} deg, sigma {sigma:.{digits}f}"
    else:
        text += series.status[index]
    _write(drawn, text, (10, drawn.shape[0] - 12), 0.6, (255, 255, 255) if good else _BAD)
    return drawn


def _point_at_pivot_outside(drawn: Image, pivot_px: Floats, mark_px: Floats) -> None:
    """Draw an arrow at the edge, where the line from the mark to a pivot outside leaves the picture."""
    height, width = drawn.shape[:2]
    mark, pivot = (tuple(int(x) for x in np.round(point)) for point in (mark_px, pivot_px))
    crosses, _, edge = cv2.clipLine((0, 0, width, height), mark, pivot)
    beyond = float(np.hypot(*np.subtract(pivot, edge)))
    if not crosses or beyond == 0.0:
        return
    back = np.subtract(mark, pivot) / np.hypot(*np.subtract(mark, pivot))
    tail = np.round(edge + _ARROW_PX * back).astype(int)
    cv2.arrowedLine(drawn, (int(tail[0]), int(tail[1])), tuple(edge), _LINE, 2, cv2.LINE_AA, tipLength=0.4)
    text = f"pivot {beyond:.0f} px outside"
    (length, tall), _ = cv2.getTextSize(text, _FONT, _SMALL, 1)
    # Beside the arrow's tail, within the picture and above the line of text at its bottom.
    x = int(np.clip(tail[0] + 10, 4, max(4, width - length - 4)))
    y = int(np.clip(tail[1] + 2 * tall, tall + 4, max(tall + 4, height - 40)))
    _write(drawn, text, (x, y), _SMALL, _LINE)


def _write(drawn: Image, text: str, at: tuple[int, int], scale: float, colour: tuple[int, int, int]) -> None:
    """Write text on black; ``at`` is the left end of its base line."""
    (width, height), below = cv2.getTextSize(text, _FONT, scale, 1)
    cv2.rectangle(drawn, (at[0] - 4, at[1] - height - 4), (at[0] + width + 4, at[1] + below), (0, 0, 0), cv2.FILLED)
    cv2.putText(drawn, text, at, _FONT, scale, colour, 1, cv2.LINE_AA)


def _encode(container: av.container.OutputContainer, frames: Iterable[Frame], measured: Measured) -> None:
    stream: av.VideoStream | None = None
    shown: Image | None = None
    for frame in frames:
        # Where there is no picture the one before stays, and the text says why.
        shown = shown if frame.image is None else frame.image
        if shown is None:
            continue
        height, width = shown.shape[:2]
        if stream is None:
            # No reordering: with it, decoders' delays would shift the time stamps.
            stream = container.add_stream("libx264", options={"crf": "20", "preset": "veryfast", "bf": "0"})
            stream.width, stream.height = width + width % 2, height + height % 2
            stream.pix_fmt = "yuv420p"
            stream.time_base = stream.codec_context.time_base = Fraction(1, _TICKS)
        # H.264 at 4:2:0 has even sides only.
        drawn: Image = cv2.copyMakeBorder(
            draw_frame(shown, measured, frame.index), 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE
        )
        picture = av.VideoFrame.from_ndarray(drawn, format="bgr24")
        picture.pts = round(frame.time * _TICKS)
        picture.time_base = Fraction(1, _TICKS)
        container.mux(stream.encode(picture))
    if stream is not None:
        container.mux(stream.encode())


def _fixed(point_px: Floats) -> tuple[int, int]:
    x, y = np.round(point_px * 2**_SHIFT).astype(int)
    return int(x), int(y)
