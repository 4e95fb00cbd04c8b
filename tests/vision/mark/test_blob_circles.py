"""Blobs are drawn as one draw after another of NumPy's generator would."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.vision.mark.blob_circles import circle_of, draw_blobs
from anglecam.vision.mark.blobs import Blobs


def _blobs(count: int, seed: int) -> Blobs:
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 300.0, (count, 2))
    area, contrast = rng.uniform(40.0, 120.0, count), rng.uniform(20.0, 50.0, count)
    none = np.zeros((count, 2), np.int64)
    return Blobs(rng.integers(0, 12, count), places, places, area, contrast, np.zeros((count, 4), np.int64), none)


def _one_after_another(blobs: Blobs, through: np.ndarray | None) -> list[tuple[int, ...]]:
    key = np.column_stack([np.round(blobs.plane_px / 4.0), np.round(np.log(blobs.area) / 0.3)])
    poses = np.unique(key, axis=0, return_index=True)[1]
    rng = np.random.default_rng(0)
    drawn: dict[tuple[int, ...], tuple[int, ...]] = {}
    for trial in range(600):
        some = rng.choice(poses, size=min(2 + (trial % 4 > 0), len(poses)), replace=False)
        if through is not None and len(through):
            some[0] = rng.choice(through)
        size, contrast = blobs.area[some], blobs.contrast[some]
        alike = size.max() <= 1.6 * size.min() and contrast.max() <= 1.5 * contrast.min()
        if alike and len(set(blobs.frame[some])) == len(some):
            drawn.setdefault(tuple(sorted(some.tolist())), tuple(some.tolist()))
    return list(drawn.values())


@pytest.mark.parametrize("count", [2, 3, 5, 40, 150])
@pytest.mark.parametrize("through", [None, [], [1], [0, 1]])
def test_draws_are_those_of_the_generator(count, through):
    blobs = _blobs(count, count)
    some = None if through is None else np.array(through, np.intp)
    expected = _one_after_another(blobs, some)
    assert [tuple(draw.tolist()) for draw in draw_blobs(blobs, some)] == expected
    assert expected or count < 40


def test_without_two_distinct_poses_nothing_is_drawn():
    assert draw_blobs(_blobs(0, 0), None) == []
    assert draw_blobs(_blobs(1, 0), None) == []


def test_a_circle_through_three_places_agrees_with_the_hint_or_is_about_it():
    centre, radius = np.array([100.0, 80.0]), 50.0
    turns = np.array([0.1, 0.9, 2.0])
    places = centre + radius * np.column_stack([np.cos(turns), np.sin(turns)])
    for hint in (None, centre + 20.0):
        found, of = circle_of(places, hint, 500.0)
        np.testing.assert_allclose([*found, of], [*centre, radius], rtol=1e-12)
    assert circle_of(places, centre + [90.0, 0.0], 500.0) is None
    assert circle_of(places, None, 40.0) is None
    assert circle_of(places[[0, 0, 1]], None, 500.0) is None
