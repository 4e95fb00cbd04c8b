"""The circle of a large mark is as uncertain as the mark's own rotation says; a small mark's is left as it is."""

import numpy as np
import pytest

from anglecam.vision.mark.own_rotation import widened_by_own_rotation
from anglecam.vision.mark.segment import Region
from anglecam.vision.pivot.circle import fit_circle

PIVOT, LEVER = np.array([200.0, 60.0]), 80.0
TURN = np.radians(np.linspace(-40.0, 40.0, 90))


def _bars(length, slid_px=0.0):
    """Return a bar of 8 px that turns about `PIVOT`; where it is turned most, its centroid has slid along it."""
    out = np.column_stack([np.sin(TURN), np.cos(TURN)])
    places = PIVOT + (LEVER + slid_px * (TURN / TURN.max()) ** 2)[:, None] * out
    places += np.random.default_rng(4).normal(0.0, 0.05, places.shape)
    regions = []
    for place, along in zip(places, out, strict=True):
        across = np.array([-along[1], along[0]])
        moments = (length**2 * np.outer(along, along) + 8.0**2 * np.outer(across, across)) / 12.0
        regions.append(Region(place, 8.0 * length, moments, np.eye(2), np.zeros((0, 2), np.int32), True))
    return regions


def _distance(length, slid_px):
    """Return the true pivot's distance from the circle's centre, in standard uncertainties, before and after."""
    regions = _bars(length, slid_px)
    circle = fit_circle(np.array([region.centre_px for region in regions]))
    found = widened_by_own_rotation(circle, regions)
    assert found.radius_px == circle.radius_px
    off = PIVOT - circle.centre_px
    return [float(np.sqrt(off @ np.linalg.solve(c.centre_covariance_px2, off))) for c in (circle, found)]


@pytest.mark.parametrize("length", [60.0, 150.0])
def test_the_uncertainty_covers_the_pivot_of_a_bar_whose_path_has_another_curvature(length):
    before, after = _distance(length, 6.0)
    assert before > 10.0
    assert after < 2.0


@pytest.mark.parametrize(("length", "slid_px"), [(150.0, 0.0), (30.0, 6.0)], ids=["a consistent bar", "a short bar"])
def test_a_path_that_the_own_rotation_does_not_contradict_is_left_as_it_is(length, slid_px):
    before, after = _distance(length, slid_px)
    assert before == after


def test_the_path_of_a_pan_that_hangs_and_does_not_turn_is_left_as_it_is():
    upright = np.diag([60.0**2, 20.0**2]) / 12.0
    places = PIVOT + LEVER * np.column_stack([np.sin(TURN), np.cos(TURN)])
    pans = [Region(place, 1200.0, upright, np.eye(2), np.zeros((0, 2), np.int32), True) for place in places]
    circle = fit_circle(places + np.random.default_rng(4).normal(0.0, 0.05, places.shape))
    assert widened_by_own_rotation(circle, pans) is circle
