"""Regions of the mark's colour: each at its place, and none without area."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.vision.mark.colour import ColourModel
from anglecam.vision.mark.segment import find_patches, find_regions, measure

RED = ColourModel(np.array([0.0, 0.0, 1 / 255]), 0.0, 0.01, np.array([0.0, 0.0, 255.0]))
"""The fraction of mark is the red channel."""


def _picture(red: np.ndarray) -> np.ndarray:
    return np.dstack([np.zeros_like(red), np.zeros_like(red), red]).astype(np.uint8)


def test_a_square_has_its_true_centre_and_area():
    red = np.zeros((60, 80))
    red[20:40, 30:60] = 255
    (region,) = find_regions(_picture(red), RED, (10.0, np.inf))
    assert region.whole
    assert region.centre_px == pytest.approx([44.5, 29.5], abs=1e-6)
    assert region.area_px2 == pytest.approx(600.0, rel=0.02)


def test_a_thread_between_two_larger_patches_is_not_a_separate_region():
    red = np.zeros((60, 80))
    red[10:50, 10:37] = red[10:50, 43:70] = 255
    red[12:48, 39:41] = 255
    regions = find_regions(_picture(red), RED, (10.0, np.inf))
    assert len(regions) == 2
    assert all(np.isfinite(region.centre_px).all() and region.area_px2 > 500.0 for region in regions)
    assert not any(region.whole for region in regions)


def test_a_patch_at_the_pictures_edge_is_cut_before_and_after_it_is_measured():
    red = np.zeros((60, 80))
    red[20:40, 0:30] = red[22:38, 50:70] = 255
    patches = find_patches(_picture(red), RED, (10.0, np.inf))
    assert [patch.cut for patch in patches] == [True, False]
    assert [tuple(patch.contour_px.reshape(-1, 2).min(axis=0)) for patch in patches] == [(0, 20), (50, 22)]
    regions = find_regions(_picture(red), RED, (10.0, np.inf))
    assert [region.whole for region in regions] == [False, True]
    assert regions[1].centre_px == pytest.approx([59.5, 29.5], abs=1e-6)
    assert regions[1].area_px2 == measure(patches[1], RED).area_px2


@pytest.mark.parametrize(("level", "found"), [(127, 0), (128, 1)])
def test_a_patch_is_where_the_mark_covers_at_least_half_of_a_pixel(level, found):
    grey = ColourModel(
        np.array([0.0, 0.0, 1 / 175]), -40 / 175, 0.01, np.zeros(3)
    )  # the fraction map is the red channel
    red = np.full((40, 40), 40.0)
    red[10:30, 10:30] = level
    patches = find_patches(_picture(red), grey, (10.0, np.inf))
    assert len(patches) == found
    assert all(patch.core.sum() == 18**2 for patch in patches)  # smoothing empties its outermost pixels
