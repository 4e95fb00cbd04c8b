"""Marker and centre of rotation are combined by their uncertainties where they agree."""

import numpy as np

from anglecam.vision.pivot.circle import fit_circle
from anglecam.vision.pivot.estimate import PivotEstimate, combine_pivot
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
    assert note.startswith("the round marker is 6.0")
    assert "from the pivot by the centre of rotation (uncertainty 0." in note
    assert pivot.source == "centre of rotation"
    assert np.hypot(*(pivot.centre_px - [50, 60])) < 0.5


def test_without_marker_and_motion_there_is_no_pivot():
    assert combine_pivot(None, None) == (None, None)


HINT = PivotEstimate(np.array([50.0, 60.0]), 100.0 * np.eye(2), "hint")
SCREWS = 10.0 / (640 * 480)
"""Ten round things in the picture, 1/px²."""


def _marker(x, y):
    return RoundMarker(np.array([x, y]), 0.05**2 * np.eye(2), 9.0)


def test_a_hint_is_a_pivot_where_the_path_is_too_short():
    circle = fit_circle(_path((50, 60))[:4])
    assert combine_pivot(None, circle, None) == (None, None)
    pivot, _ = combine_pivot(None, circle, HINT)
    assert np.hypot(*(pivot.centre_px - [50.0, 60.0])) < 3.0 * np.sqrt(np.trace(pivot.covariance_px2))


def test_a_hint_counts_by_its_uncertainty_and_a_contradiction_makes_both_less_certain():
    rng = np.random.default_rng(1)
    at = np.radians(np.linspace(-10, 10, 200))
    circle = fit_circle(100 * np.column_stack([np.cos(at), np.sin(at)]) + 0.05 * rng.standard_normal((200, 2)))
    alone, _ = combine_pivot(None, circle)
    near = PivotEstimate(circle.centre_px + [1.0, 0.0], np.eye(2), "hint")
    agreed, _ = combine_pivot(None, circle, near)
    far = PivotEstimate(circle.centre_px + [200.0, 0.0], 10.0**2 * np.eye(2), "hint")
    contradicted, _ = combine_pivot(None, circle, far)
    assert agreed.covariance_px2[0, 0] < min(1.0, 0.5 * alone.covariance_px2[0, 0])
    assert not agreed.elsewhere
    assert contradicted.elsewhere
    assert np.abs(contradicted.centre_px - circle.centre_px).max() < 3.0 * np.sqrt(contradicted.covariance_px2[0, 0])
    assert contradicted.covariance_px2[0, 0] > 10.0 * alone.covariance_px2[0, 0]


def test_a_marker_off_hint_and_path_is_named_with_both():
    pivot, note = combine_pivot(_marker(50.0, 160.0), fit_circle(_path((50, 60))[:12]), HINT)
    assert pivot.source == "hint and centre of rotation"
    assert "from the pivot by the hint and the centre of rotation (uncertainty" in note
    assert note.endswith("that pivot is used")


def test_a_round_thing_far_from_the_hint_is_an_uncertain_pivot():
    pivot, note = combine_pivot(_marker(50.0, 80.0), None, HINT, SCREWS)
    assert note is None
    assert "may be something else" in pivot.doubt
    assert np.sqrt(np.trace(pivot.covariance_px2) / 2.0) > 5.0


def test_a_round_thing_on_the_axis_of_a_short_arc_is_as_uncertain_as_the_arcs_centre():
    at = np.radians(np.linspace(-6, 6, 200))
    rng = np.random.default_rng(0)
    circle = fit_circle(100 * np.column_stack([np.cos(at), np.sin(at)]) + 0.05 * rng.standard_normal((200, 2)))
    along = np.sqrt(circle.centre_covariance_px2[0, 0])
    assert 10.0 < along < 20.0
    screw = circle.centre_px + [1.5 * along, 0.0]
    pivot, _ = combine_pivot(_marker(*screw), circle, None, SCREWS)
    assert "may be something else" in pivot.doubt
    assert np.sqrt(pivot.covariance_px2[0, 0]) > along
    long = fit_circle(_path((50, 60)))
    certain, _ = combine_pivot(_marker(*long.centre_px), long, None, SCREWS)
    assert certain.doubt is None
    assert certain.covariance_px2[0, 0] < long.centre_covariance_px2[0, 0]


def test_a_declared_marker_at_the_hint_is_a_certain_pivot():
    pivot, note = combine_pivot(_marker(53.0, 60.0), None, HINT)
    assert note is None
    np.testing.assert_allclose(pivot.centre_px, [53.0, 60.0], atol=0.01)
    assert np.sqrt(np.trace(pivot.covariance_px2) / 2.0) < 0.1


def test_a_marker_nearer_to_the_camera_does_not_bind_a_pivot_that_the_path_shows():
    circle = fit_circle(_path((50, 60)))
    nearer, _ = combine_pivot(_marker(53.0, 64.0), circle, None, SCREWS, np.outer([4.0, 5.0], [4.0, 5.0]))
    assert np.hypot(*(nearer.centre_px - [50.0, 60.0])) < 3.0 * np.sqrt(np.trace(circle.centre_covariance_px2))
    off = nearer.centre_px - [50.0, 60.0]
    assert off @ np.linalg.solve(nearer.covariance_px2, off) < 9.21


def test_of_many_pivots_three_cases_cover_the_truth_as_often_as_their_covariance_says():
    """A round thing is the marker, a marker at another depth, or a screw; the hint is off by 10 px RMS."""
    rng, D = np.random.default_rng(4), np.diag([36.0, 1e-6])
    squared = []
    for _ in range(400):
        truth = HINT.centre_px + 10.0 * rng.standard_normal(2)
        case = rng.choice(3, p=[0.7, 0.2, 0.1])
        place = truth + 0.05 * rng.standard_normal(2)
        if case == 1:
            place = place + [6.0 * rng.standard_normal(), 0.0]
        if case == 2:
            place = HINT.centre_px + rng.uniform(-40.0, 40.0, 2)
        pivot, _ = combine_pivot(_marker(*place), None, HINT, 0.1 / 80.0**2, D)
        off = pivot.centre_px - truth
        squared.append(off @ np.linalg.solve(pivot.covariance_px2, off) / 2.0)
    assert np.mean(np.array(squared) < 9.21 / 2.0) > 0.93
