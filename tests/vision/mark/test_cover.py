"""The covered share of a pixel is relative to the values next to the edge; a tail belongs to the region it touches."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.vision.mark.colour import EMPTY_LEVEL, FULL_LEVEL
from anglecam.vision.mark.cover import connected_tail, cover_weight

LOW = 0.1


def _levels(share: np.ndarray) -> np.ndarray:
    return np.round(EMPTY_LEVEL + share * (FULL_LEVEL - EMPTY_LEVEL)).astype(np.uint8)


@pytest.mark.parametrize(("empty", "full"), [(0.0, 1.0), (0.15, 1.0), (0.1, 0.7), (-0.1, 1.1)])
@pytest.mark.parametrize("covered", [0.05, 0.3, 0.5, 0.8, 0.95])
def test_the_share_of_an_edge_pixel_is_scaled_between_its_neighbours(empty, full, covered):
    share = np.full((40, 60), empty)
    share[:, 30] = empty + covered * (full - empty)
    share[:, 31:] = full
    columns = np.arange(60)
    core = np.tile(columns > 31, (40, 1)).astype(np.uint8)
    near = np.tile(columns > 28, (40, 1)).astype(np.uint8)
    weight = cover_weight(_levels(share), core, near, near, LOW)
    assert weight[20, 30] == pytest.approx(np.clip((covered - LOW) / (1 - 2 * LOW), 0, 1), abs=0.015)
    assert (weight[:, :29] == 0.0).all()
    assert weight[:, 32:] == pytest.approx(1.0, abs=1e-6)


def test_where_no_empty_pixel_is_near_the_clips_typical_values_hold():
    every = np.ones((30, 30), np.uint8)
    weight = cover_weight(_levels(np.full((30, 30), 0.5)), 0 * every, every, every, LOW)
    assert weight == pytest.approx(0.5, abs=0.005)


def test_a_tail_that_touches_the_region_belongs_to_it_and_another_patch_does_not():
    smooth = np.zeros((20, 30), np.uint8)
    smooth[5:10, 5:10] = 200
    smooth[10:14, 10] = 90  # touches the region at a corner
    smooth[5:10, 20:25] = 200
    filled = (smooth == 200).astype(np.uint8)
    filled[:, 20:] = 0
    expected = filled.copy()
    expected[10:14, 10] = 1
    np.testing.assert_array_equal(connected_tail(smooth, filled, 90.0), expected)
    np.testing.assert_array_equal(connected_tail(smooth, filled, 90.5), filled)


def test_a_hole_below_the_level_is_inside_the_region_that_surrounds_it():
    filled = np.zeros((9, 9), np.uint8)
    filled[2:7, 2:7] = 1
    smooth = 200 * filled
    smooth[4, 4] = 0
    np.testing.assert_array_equal(connected_tail(smooth, filled, 100.0), filled)
