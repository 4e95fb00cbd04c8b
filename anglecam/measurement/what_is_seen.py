"""Words for messages of measuring: what single frames show, where the mark is seen, and the line of rig.yaml to try."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import cv2
import numpy as np

from anglecam.data.series import OK
from anglecam.data.typing import Image
from anglecam.measurement.detections import Detections

DECLARE_MARK = "point at what turns: mark: {at: [x, y], frame: k} in rig.yaml"
_SEEN = {
    "no_mouth": "nothing like it is seen in",
    "occluded": "what is seen looks otherwise in",
    "ambiguous": "two things may be it in",
    "no_pivot": "the pivot is not seen in",
    "duplicate": "the picture is the one before in",
    "undecodable": "the picture cannot be decoded in",
}
"""What a frame of each status shows."""
_BLUR_PX = 5.0
"""Standard deviation, px, of the blur that leaves of noise and edges that flicker less than of a thing that moves."""
_MOVES = 6.0
"""Change of the blurred picture, relative to its median over the picture, from which on something moves there."""


def causes_seen(status: Sequence[str]) -> str:
    """Return what the frames without an angle show, the most frequent first.

    Parameters
    ----------
    status : sequence of str
        Of every frame.

    Examples
    --------
    >>> causes_seen(["ok", "no_mouth", "undecodable", "no_mouth"])
    'nothing like it is seen in 2, the picture cannot be decoded in 1'
    """
    return ", ".join(f"{_SEEN[cause]} {k}" for cause, k in Counter(s for s in status if s != OK).most_common())


def place_of(detections: Detections) -> str:
    """Return where in the picture a mark is seen, px: ``around 320,200``.

    Parameters
    ----------
    detections : Detections
        Of a mark that is found in one frame at least.
    """
    places = detections.places_px
    x, y = detections.lens.distort(np.median(places[np.isfinite(places).all(axis=1)], axis=0))
    return f"around {x:.0f},{y:.0f}"


def where_it_moves(images: Sequence[Image]) -> tuple[int, int] | None:
    """Return where in the picture most changes between frames, px; ``None`` where nothing stands out.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) frames of one size.
    """
    if len(images) < 2:
        return None
    grey = np.stack([cv2.GaussianBlur(image.mean(axis=2, dtype=np.float32), (0, 0), _BLUR_PX) for image in images])
    change = np.abs(grey - np.median(grey, axis=0)).mean(axis=0)
    row, column = np.unravel_index(int(np.argmax(change)), change.shape)
    if change[row, column] <= _MOVES * float(np.median(change)):
        return None
    return int(column), int(row)
