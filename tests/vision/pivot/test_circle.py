"""The centre of rotation from a path: accurate, robust, and with a covariance that matches its error."""

import numpy as np
import pytest

from anglecam.vision.pivot.circle import circle_through, fit_circle


def _arc(half_deg, n, rng, noise=0.03, centre=(214.5, 301.3), radius=170.0):
    at = np.radians(rng.uniform(-half_deg, half_deg, n))
    return np.array(centre) + radius * np.column_stack([np.cos(at), np.sin(at)]) + noise * rng.standard_normal((n, 2))


def test_three_points_determine_a_circle():
    centre, radius = circle_through(np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]) * 50 + 7)
    np.testing.assert_allclose([*centre, radius], [7, 7, 50], atol=1e-9)


def test_the_closed_form_of_three_points_agrees_with_the_fit_of_the_same_points_twice():
    for points in np.random.default_rng(0).uniform(0.0, 640.0, (50, 3, 2)):
        centre, radius = circle_through(points)
        fitted, fitted_radius = circle_through(np.vstack([points, points]))
        np.testing.assert_allclose([*centre, radius], [*fitted, fitted_radius], rtol=1e-6)


@pytest.mark.parametrize("count", [3, 9])
def test_points_on_a_line_have_no_circle(count):
    points = np.column_stack([np.arange(count), 2.0 * np.arange(count)])
    assert not np.isfinite(circle_through(points)[1]) or circle_through(points)[1] > 1e6


def test_a_tenth_of_wrong_points_does_not_move_the_centre():
    rng = np.random.default_rng(1)
    points = _arc(20, 200, rng)
    points[::10] += rng.uniform(3, 30, (20, 2))
    found = fit_circle(points)
    assert np.hypot(*(found.centre_px - [214.5, 301.3])) < 0.5
    assert not found.fits[::10].any()
    assert found.scatter_px == pytest.approx(0.03, rel=0.3)


@pytest.mark.parametrize("half_deg", [8, 12, 25])
def test_the_covariance_is_not_too_small(half_deg):
    rng = np.random.default_rng(half_deg)
    squared = []
    for _ in range(40):
        found = fit_circle(_arc(half_deg, 120, rng))
        off = found.centre_px - [214.5, 301.3]
        squared.append(off @ np.linalg.solve(found.centre_covariance_px2, off) / 2)
    # With white noise alone, the allowance for slow errors makes the stated uncertainty larger, never smaller.
    assert np.mean(squared) < 1.2


def test_a_mark_at_rest_has_no_circle():
    rng = np.random.default_rng(0)
    assert fit_circle(np.array([100.0, 100.0]) + 0.02 * rng.standard_normal((100, 2))) is None


@pytest.mark.parametrize("off", [(-2.9, -3.2, -2.5), (2.0, 2.0, 2.0), (-400.0, 35.0, 50.0)])
def test_a_mark_that_rests_in_two_places_has_their_circle_from_any_start(off):
    rng = np.random.default_rng(0)
    at = np.radians(np.concatenate([np.full(140, -17.0), np.linspace(-17.0, 6.0, 15), np.full(40, 0.0)]))
    path = np.array([214.5, 301.3]) + 170.0 * np.column_stack([np.cos(at), np.sin(at)])
    start = np.array([214.5, 301.3]) + off[:2], 170.0 + off[2]
    found = fit_circle(path + 0.02 * rng.standard_normal(path.shape), start=start)
    assert np.hypot(*(found.centre_px - [214.5, 301.3])) < 2.0
    assert found.fits.all()


def test_a_nearly_straight_path_has_no_circle():
    rng = np.random.default_rng(3)
    along = np.linspace(0.0, 12.0, 40)
    for bend in (0.0, 1e-9, 1e-7):
        path = np.column_stack([along, bend * along**2])
        assert fit_circle(path) is None
        circle = fit_circle(path + rng.normal(0.0, 0.02, path.shape))
        assert circle is None or np.linalg.eigvalsh(circle.centre_covariance_px2).min() > 0.0


def test_an_arc_of_two_degrees_has_a_circle():
    angle = np.radians(np.linspace(0.0, 2.0, 60))
    path = 400.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    circle = fit_circle(path)
    assert circle is not None
    assert abs(circle.radius_px - 400.0) < 1e-3
