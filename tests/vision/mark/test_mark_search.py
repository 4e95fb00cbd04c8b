"""The mark is looked for where it is expected, and found as in the whole picture."""

from __future__ import annotations

import numpy as np

from anglecam.vision.mark.colour import ColourModel
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.mark_search import MarkSearch
from anglecam.vision.mark.segment import find_regions

RED = ColourModel(np.array([0.0, 0.0, 1 / 255]), 0.0, 0.01, np.array([0.0, 0.0, 255.0]))
SIZE = 320, 240
AREA = 400.0
FOUND = FoundMark(RED, AREA, np.array([160.0, 120.0]), None, "declared", 0, 1.0)


def _picture(*centres: tuple[float, float]) -> np.ndarray:
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]].astype(float)
    red = np.zeros(SIZE[::-1])
    for cx, cy in centres:
        red = np.maximum(red, np.clip(np.sqrt(AREA / np.pi) + 0.5 - np.hypot(x - cx, y - cy), 0.0, 1.0))
    return np.dstack([np.zeros_like(red), np.zeros_like(red), np.round(255.0 * red)]).astype(np.uint8)


def _search(pictures):
    """Search pictures one after another; return the regions and the share of each picture that was looked at."""
    search = MarkSearch(FOUND, lambda region: 0.5 * AREA < region.area_px2 < 2.0 * AREA)
    regions, shares = [], []
    for k, picture in enumerate(pictures):
        seen = []

        def colours_in(part, picture=picture, seen=seen):
            seen.append(picture[part].size / picture.size)
            return picture[part]

        regions.append(search.regions(k, SIZE, colours_in))
        shares.append(sum(seen))
    return regions, np.array(shares)


def test_a_mark_alone_is_found_in_a_part_as_in_the_whole_picture():
    turns = 0.9 * np.sin(np.arange(40) / 5.0)
    pictures = [_picture((160 + 90 * np.sin(a), 20 + 90 * np.cos(a))) for a in turns]
    regions, shares = _search(pictures)
    assert np.median(shares) < 0.2
    assert (shares[::16] >= 1.0).all()
    for picture, found in zip(pictures, regions, strict=True):
        (one,) = find_regions(picture, RED, (0.25 * AREA, 8.0 * AREA))
        np.testing.assert_allclose(found[0].centre_px, one.centre_px, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(found[0].moments_px2, one.moments_px2, rtol=1e-9)
        np.testing.assert_array_equal(found[0].contour_px, one.contour_px)
        assert found[0].whole


def test_a_mark_that_jumps_is_found_in_the_whole_picture():
    pictures = [_picture((60.0 + k, 120.0)) for k in range(8)] + [_picture((250.0, 60.0)), _picture((250.0, 61.0))]
    regions, shares = _search(pictures)
    assert shares[8] > 1.0
    assert np.hypot(*(regions[8][0].centre_px - [250.0, 60.0])) < 0.1
    assert shares[9] < 0.2


def test_where_a_second_thing_is_near_or_the_mark_is_gone_the_whole_picture_is_searched():
    alone = [_picture((60.0 + k, 120.0)) for k in range(4)]
    regions, shares = _search([*alone, _picture((64.0, 120.0), (95.0, 120.0)), _picture(), *alone[:2]])
    assert len(regions[4]) == 2
    assert regions[5] == []
    assert (shares[4:7] >= 1.0).all()  # in the last one nothing is known of where it is
    assert len(regions[6]) == 1


def test_a_mark_that_touches_something_is_not_taken_from_a_part():
    half = [_picture((60.0 + k, 120.0)) for k in range(4)]
    merged = _picture((64.0, 120.0), (84.0, 120.0))
    regions, shares = _search([*half, merged])
    assert shares[4] > 1.0
    assert regions[4][0].area_px2 > 1.5 * AREA
