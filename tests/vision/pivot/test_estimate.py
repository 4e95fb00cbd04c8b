"""Marker and centre of rotation are combined by their uncertainties where they agree."""

import numpy as np

from anglecam.vision.pivot.circle import fit_circle
from anglecam.vision.pivot.estimate import combine_pivot
from anglecam.vision.pivot.marker import RoundMarker


def _path(centre):
    at = np.radians(np.linspace(-25, 25, 200))
    rng = np.random.default_rng(0)
    return np.array(centre) + 170 * np.column_stack([np.cos(at), np.sin(at)]) + 0.02 * rng.standard_normal((200, 2))


def test_marker_and_centre_of_rotation_that_agree_are_combined():
    pivot, note = combine_pivot(
        RoundMarker(np.array([50.02, 60.0]), 0.05**2 * np.eye(2), 9.0), fit_circle(_path((50, 60)))
    )
    assert note is None
    assert pivot.source == "marker and centre of rotation"
    assert np.hypot(*(pivot.centre_px - [50, 60])) < 0.05
    assert pivot.covariance_px2[0, 0] < 0.05**2


def test_a_marker_off_the_centre_of_rotation_is_reported_and_not_used():
    pivot, note = combine_pivot(
        RoundMarker(np.array([50.0, 66.0]), 0.05**2 * np.eye(2), 9.0), fit_circle(_path((50, 60)))
    )
    assert "6.0" in note
    assert pivot.source == "centre of rotation"
    assert np.hypot(*(pivot.centre_px - [50, 60])) < 0.5


def test_without_marker_and_motion_there_is_no_pivot():
    assert combine_pivot(None, None) == (None, None)
