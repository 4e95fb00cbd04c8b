"""Median and robust variance are those of their definition, where some values are unknown, too."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.engine.sample import sample_of
from anglecam.engine.typical import median_and_variance


@pytest.mark.parametrize("count", [1, 2, 7, 24])
def test_they_are_those_of_the_known_values(count):
    pictures = np.random.default_rng(count).uniform(0.0, 255.0, (count, 9, 11)).astype(np.float32)
    pictures[0, 2:4] = np.nan
    median, variance = median_and_variance(pictures)
    with np.errstate(all="ignore"):
        seen = np.isfinite(pictures).any(axis=0)
        expected = np.where(seen, np.nanmedian(np.where(seen, pictures, 0.0), axis=0), np.nan)
        spread = np.nanmedian(np.abs(np.where(seen, pictures - expected, 0.0)), axis=0)
    np.testing.assert_allclose(median, expected, rtol=1e-6)
    np.testing.assert_allclose(variance, np.where(seen, (1.4826 * spread) ** 2, np.nan), rtol=1e-4)


def test_of_a_sample_they_are_those_of_the_chosen_pictures():
    pictures = np.random.default_rng(1).uniform(50.0, 200.0, (12, 20, 30)).astype(np.float32)
    sample = sample_of(pictures, np.arange(12), 1.0, np.zeros(2))
    for use in (np.arange(0, 12, 2), np.arange(1, 12, 2), np.arange(0, 12, 2)):
        np.testing.assert_array_equal(sample.typical(use)[0], median_and_variance(sample.pictures[use])[0])
