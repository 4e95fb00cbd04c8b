"""The median of few pictures equals NumPy's bit for bit."""

import numpy as np
import pytest

from anglecam.vision.image.median import median_picture


@pytest.mark.parametrize("dtype", [np.uint8, np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 2, 3, 6, 9, 16])
def test_the_median_is_numpys_for_any_count_and_dtype(count, dtype):
    # More pixels than are sorted at a time, and repeated values.
    pile = np.random.default_rng(count).uniform(0, 255, (count, 150, 160, 3)).astype(dtype)
    pile[:, :50] = np.round(pile[:, :50] / 16) * 16
    before, expected = pile.copy(), np.median(pile, axis=0)
    found = median_picture(pile)
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(pile, before)
