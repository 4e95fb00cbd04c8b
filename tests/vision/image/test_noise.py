"""The noise of a clip's pixels, from the differences between its frames."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from anglecam.vision.image.noise import pixel_noise


def _frames(sigma: float, planes: int) -> list[np.ndarray]:
    rng = np.random.default_rng(5)
    return [np.clip(np.rint(rng.normal(100.0, sigma, (96, 128, planes))), 0, 255).astype(np.uint8) for _ in range(6)]


@pytest.mark.parametrize("planes", [1, 3])
def test_it_is_the_median_absolute_difference_of_neighbouring_frames(planes: int) -> None:
    frames = _frames(4.0, planes)
    apart = [np.abs(a[::4, ::4].astype(float) - b[::4, ::4]) for a, b in itertools.pairwise(frames)]
    assert pixel_noise(frames) == pytest.approx(1.4826 * np.median(apart) / np.sqrt(2.0), rel=1e-12)


def test_it_is_that_of_rounding_where_nothing_changes() -> None:
    assert pixel_noise([np.full((40, 40), 90, np.uint8)] * 3) == pytest.approx(1.0 / np.sqrt(12.0))


def test_it_is_close_to_the_noise_that_was_added() -> None:
    assert pixel_noise(_frames(6.0, 3)) == pytest.approx(6.0, rel=0.1)
