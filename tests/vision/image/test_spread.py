"""The compiled median and spread equal NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.vision.image.spread import median_and_spread


@pytest.mark.parametrize("count", [1, 2, 3, 8, 15])
def test_equals_numpy(count: int) -> None:
    pile = np.random.default_rng(count).integers(0, 256, (count, 37, 41, 3), dtype=np.uint8)

    middle, spread = median_and_spread(pile)

    expected = np.median(pile, axis=0)
    np.testing.assert_array_equal(middle, expected)
    np.testing.assert_allclose(spread, 1.4826 * np.median(np.abs(pile - expected), axis=0), rtol=1e-6)
