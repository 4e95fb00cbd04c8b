"""Patches above a level are OpenCV's connected components, in the same order."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from anglecam.vision.mark.patches import find_patches


def _map(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    size = rng.integers(1, 90, 2) if seed % 4 else rng.integers(200, 500, 2)
    rough = rng.standard_normal(size).astype(np.float32)
    return cv2.GaussianBlur(rough, (0, 0), rng.uniform(0.5, 3.0)) if seed % 3 else rough


@pytest.mark.parametrize("seed", range(60))
def test_patches_are_opencv_s(seed):
    values = _map(seed)
    level = float(np.random.default_rng(1000 + seed).uniform(-1.0, 2.0) * values.std())
    _, labels, stats, centres = cv2.connectedComponentsWithStats((values > level).astype(np.uint8), connectivity=8)
    below, found = find_patches(values, [-9.0 * values.std(), level])
    assert below.area.sum() == values.size
    np.testing.assert_array_equal(found.box_px, stats[1:, : cv2.CC_STAT_AREA])
    np.testing.assert_array_equal(found.area, stats[1:, cv2.CC_STAT_AREA])
    np.testing.assert_array_equal(found.centre_px, centres[1:])
    for k, (x, y) in enumerate(found.first_px[:40], start=1):
        assert labels[y, x] == k
        assert (labels == k).ravel().argmax() == y * labels.shape[1] + x


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_a_map_without_and_one_full_of_patches(value):
    (found,) = find_patches(np.full((7, 9), value, np.float32), [0.5])
    assert found.area.tolist() == ([63] if value else [])
    assert found.centre_px.tolist() == ([[4.0, 3.0]] if value else [])
