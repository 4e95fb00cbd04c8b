"""What is drawn over a frame."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from anglecam.data.series import AngleSeries
from anglecam.video.overlay import draw_frame

SIZE = (240, 320)


def drawn_with_pivot(pivot_px):
    """Draw the line from a mark at (200, 100) to a pivot on a grey frame."""
    series = AngleSeries(
        "swing",
        time=np.zeros(1),
        angle=np.radians([7.42]),
        sigma=np.radians([0.28]),
        status=("ok",),
        mark_px=np.array([[200.0, 100.0]]),
        pivot_px=np.array([pivot_px]),
    )
    return draw_frame(np.full((*SIZE, 3), 90, np.uint8), SimpleNamespace(series=series, contours_px=[None]), 0)


def changed_beside_the_line(drawn, columns):
    """Count changed pixels near the line of sight, but not on it, in some columns."""
    beside = np.r_[88:97, 104:113]
    return int((drawn[beside][:, columns] != 90).any(axis=2).sum())


@pytest.mark.parametrize(
    ("pivot_px", "columns"),
    [((-150.0, 100.0), slice(0, 30)), ((600.0, 100.0), slice(290, 320))],
    ids=["left", "right"],
)
def test_an_arrow_at_the_edge_points_at_a_pivot_outside(pivot_px, columns):
    assert changed_beside_the_line(drawn_with_pivot((60.0, 100.0)), columns) == 0
    assert changed_beside_the_line(drawn_with_pivot(pivot_px), columns) > 20


def test_no_arrow_is_drawn_where_neither_mark_nor_line_is_in_the_picture():
    series = AngleSeries(
        "swing",
        time=np.zeros(1),
        angle=np.zeros(1),
        sigma=np.zeros(1),
        status=("ok",),
        mark_px=np.array([[-50.0, -60.0]]),
        pivot_px=np.array([[-150.0, -100.0]]),
    )
    drawn = draw_frame(np.full((*SIZE, 3), 90, np.uint8), SimpleNamespace(series=series, contours_px=[None]), 0)
    assert (drawn[:150] == 90).all()
