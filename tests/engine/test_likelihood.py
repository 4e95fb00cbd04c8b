"""The sums over pixels are those of their definition, in double precision."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage, stats

from anglecam.engine.likelihood import log_density, multiply_odds, pose_gains

RNG = np.random.default_rng(4)
PICTURE, MEAN, BACK = (RNG.uniform(0.0, 255.0, (30, 40)).astype(np.float32) for _ in range(3))
MEAN[:, :20] = PICTURE[:, :20] + RNG.normal(0.0, 3.0, (30, 20))
VARIANCE, BACK_VARIANCE = (RNG.uniform(1.0, 30.0, (30, 40)).astype(np.float32) for _ in range(2))


def _expected(picture, mean, variance):
    normal = stats.norm.pdf(picture.astype(float), mean, np.sqrt(variance.astype(float)))
    known = np.isfinite(mean) & np.isfinite(picture)
    return np.log(np.where(known, 0.98 * normal + 0.02 / 256.0, 1.0 / 256.0))


def test_a_pixel_is_as_probable_as_the_mixture_says():
    mean = MEAN.copy()
    mean[3, 4] = np.nan
    np.testing.assert_allclose(log_density(PICTURE, mean, VARIANCE), _expected(PICTURE, mean, VARIANCE), atol=1e-4)


def test_odds_are_the_product_over_pictures():
    odds = np.ones(PICTURE.shape)
    picture = PICTURE.copy()
    picture[7, 8] = np.nan
    for _ in range(3):
        multiply_odds(odds, picture, MEAN, VARIANCE, 2.0, BACK, BACK_VARIANCE)
    log_odds = _expected(picture, MEAN, VARIANCE + 2.0) - _expected(picture, BACK, BACK_VARIANCE + 2.0)
    np.testing.assert_allclose(np.log(odds), np.where(np.isfinite(picture), 3.0 * log_odds, 0.0), atol=1e-3)


@pytest.mark.parametrize("shade", [0.0, 12.0])
def test_the_gain_of_a_pose_is_the_sum_over_the_body(shade):
    rows, columns = np.nonzero(np.ones((12, 14)))
    places = np.stack([columns, rows]).astype(np.float32)
    variance = VARIANCE[rows, columns]
    body = np.stack([MEAN[rows + 5, columns + 3], variance, *np.full((2, len(rows)), shade)])
    ends = np.array([50, 50, len(rows)])
    pose = np.array([[[1.0, 0.0, 3.0], [0.0, 1.0, 5.0]]])
    precision = 1.0 / (BACK_VARIANCE + 1.5)
    found = pose_gains(PICTURE, BACK, precision, np.float32(1.5), places, body.astype(np.float32), ends, pose)
    seen, behind = (one[rows + 5, columns + 3] for one in (PICTURE, BACK))
    log_odds = _expected(seen, body[0] + shade, variance + 1.5)  # unturned: the cosine is 1, the sine 0
    log_odds -= _expected(seen, behind, BACK_VARIANCE[rows + 5, columns + 3] + 1.5)
    expected = [part.sum() for part in np.split(log_odds, ends[:-1])]
    np.testing.assert_allclose(found[0], expected, rtol=1e-4, atol=0.05)


def test_any_grey_level_is_as_probable_where_the_background_is_unknown():
    rows, columns = np.nonzero(np.ones((12, 14)))
    places = np.stack([columns, rows]).astype(np.float32)
    variance = VARIANCE[rows, columns]
    body = np.stack([MEAN[rows, columns], variance, *np.zeros((2, len(rows)))]).astype(np.float32)
    stands = np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    back = np.full_like(BACK, np.nan)
    found = pose_gains(PICTURE, back, back, np.float32(0.0), places, body, np.array([len(rows)]), stands)
    seen = PICTURE[rows, columns]
    log_odds = _expected(seen, body[0], variance) - _expected(seen, np.full_like(seen, np.nan), variance)
    np.testing.assert_allclose(found[0, 0], log_odds.sum(), rtol=1e-4, atol=0.05)


def test_between_pixels_the_picture_is_interpolated_and_beyond_it_nothing_is_said():
    rows, columns = np.nonzero(np.ones((30, 40)))
    places = np.stack([columns, rows]).astype(np.float32)
    body = np.stack([np.full(len(rows), 90.0), np.full(len(rows), 40.0), *np.zeros((2, len(rows)))]).astype(np.float32)
    cos, sin = np.cos(0.4), np.sin(0.4)
    pose = np.array([[[cos, sin, -7.3], [-sin, cos, 5.6]]])
    picture = PICTURE.copy()
    picture[6, 9] = np.nan
    precision = np.full_like(BACK, 1.0 / 30.0)
    ends = np.array([len(rows) // 2, len(rows)])
    found = pose_gains(picture, BACK, precision, np.float32(0.0), places, body, ends, pose)
    x, y = pose[0, :, :2] @ places + pose[0, :, 2:]
    height, width = PICTURE.shape
    inside = (x >= 0) & (y >= 0) & (x < width - 1) & (y < height - 1)
    seen, behind = (ndimage.map_coordinates(one, [y, x], order=1, mode="nearest") for one in (picture, BACK))
    log_odds = _expected(seen, body[0], body[1]) - _expected(seen, behind, np.full_like(seen, 30.0))
    counts = inside & np.isfinite(seen)
    assert 0 < counts.sum() < inside.sum() < len(rows)
    expected = [part.sum() for part in np.split(np.where(counts, log_odds, 0.0), ends[:-1])]
    np.testing.assert_allclose(found[0], expected, rtol=1e-3, atol=0.05)
