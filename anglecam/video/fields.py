"""Interlaced pictures: the field that was exposed first, as a picture of full height.

The lines of an interlaced picture belong to two instants: every second one was exposed half a frame period later than
the others. A mechanism that moves is seen twice in it, and an angle measured on both would hold at no definite time.
So the first field alone is used, which belongs to the frame's time stamp. Its lines stay unchanged at their rows, and
the rows between them are interpolated.
"""

from __future__ import annotations

import av
import cv2
import numpy as np
from av.filter import Graph

from anglecam.data.typing import Image

STILL_CODECS = ("png", "apng", "gif")
"""What these call interlaced is an order of transmission: all lines of their pictures are of one instant."""
_BOTTOM_FIRST = (3, 4)
"""FFmpeg's AV_FIELD_BB and AV_FIELD_TB: the second, fourth, … line was exposed first."""
_BETWEEN = np.array([1.0, -5.0, 20.0, 20.0, -5.0, 1.0]) / 32.0
"""Weights of the lines around a row halfway between two lines: the interpolation by which H.264 predicts motion."""


def is_bottom_first(field_order: int) -> bool:
    """Return whether the second line belongs to the first field; high definition and unknown orders have it last."""
    return field_order in _BOTTOM_FIRST


def first_field(picture: av.VideoFrame, bottom_first: bool) -> av.VideoFrame:
    """Return every second line of all planes of an interlaced picture: those that were exposed first."""
    graph = Graph()
    source = graph.add_buffer(
        width=picture.width, height=picture.height, format=picture.format, time_base=picture.time_base
    )
    field = graph.add("field", "type=bottom" if bottom_first else "type=top")
    graph.link_nodes(source, field, graph.add("buffersink")).configure()
    graph.push(picture)
    return graph.vpull()


def fill_rows(field: Image, height: int, bottom_first: bool) -> Image:
    """Return a picture of full height from the lines of a field.

    Parameters
    ----------
    field : ndarray
        (lines, width, planes) bytes.
    height : int
        Rows of the picture.
    bottom_first : bool
        Whether the lines belong to the rows 1, 3, 5 … and not to 0, 2, 4 ….

    Returns
    -------
    ndarray
        (height, width, planes) bytes; the rows of the lines are unchanged.
    """
    longer = np.concatenate([field, field[-1:]])  # for a row below the last line
    # the anchor is the line above the row in between, or the line below it where the field starts with row 1
    anchor = (0, 3 if bottom_first else 2)
    between = cv2.sepFilter2D(longer, -1, np.ones(1), _BETWEEN, anchor=anchor, borderType=cv2.BORDER_REPLICATE)
    picture = np.empty((height, *field.shape[1:]), np.uint8)
    lines, others = (1, 0) if bottom_first else (0, 1)
    picture[lines::2] = field
    picture[others::2] = between.reshape(longer.shape)[: len(picture[others::2])]
    return picture
