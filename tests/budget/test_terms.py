"""The terms of a budget combine to the series' sigma, and Monte Carlo through the geometry agrees."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from anglecam.budget.terms import ErrorSources, angle_draws, terms_over_time
from anglecam.camera.lens import Lens
from anglecam.camera.tilt import Tilt
from anglecam.measurement.sigma import PlaceErrors, angle_sigma
from support.nod import COVARIANCE, PIVOT, REST, N, nod_sources


def _combined(sources: ErrorSources) -> np.ndarray:
    return np.sqrt(sum(c.contribution**2 for c in terms_over_time(sources) if c.in_sigma))


def _spread(sources: ErrorSources, i: int, m: int = 400_000) -> float:
    return float(np.std(angle_draws(sources, i)(np.random.default_rng(7), m)))


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("neutral", [REST, None])
def test_terms_combine_to_the_sigma_of_the_series(mirrored, neutral):
    sources, mouth = nod_sources(mirrored=mirrored, neutral=neutral)
    sigma = angle_sigma(mouth, PIVOT, COVARIANCE, PlaceErrors(sources.noise_px, sources.pose_px), neutral)
    assert _combined(sources) == pytest.approx(sigma.total, rel=1e-9)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("neutral", [REST, None])
@pytest.mark.parametrize("i", [5, 40, 79])
def test_the_monte_carlo_spread_through_the_geometry_equals_sigma(mirrored, neutral, i):
    sources, _ = nod_sources(mirrored=mirrored, neutral=neutral)
    assert _spread(sources, i) == pytest.approx(_combined(sources)[i], rel=0.006)


@pytest.mark.parametrize("only", ["noise", "pose", "pivot"])
def test_each_term_alone_equals_its_monte_carlo_spread(only):
    chosen = {
        "noise": 0.03 * (only == "noise"),
        "pose": 0.02 * (only == "pose"),
        "pivot_covariance_px2": COVARIANCE * (only == "pivot"),
    }
    sources, _ = nod_sources(**chosen)
    assert _spread(sources, 60) == pytest.approx(_combined(sources)[60], rel=0.006)
    names = {c.name for c in terms_over_time(sources)}
    expected = {"noise": {"picture noise", "neutral line"}, "pose": {"pixel grid and codec"}, "pivot": {"pivot"}}
    assert names == expected[only]


def test_a_pivots_error_cancels_at_neutral_and_grows_as_the_line_turns():
    sources, _ = nod_sources(noise=0.0, pose=0.0, pivot_covariance_px2=0.01 * np.eye(2))
    (pivot,) = terms_over_time(sources)
    expected = 2.0 * np.abs(np.sin(sources.angle / 2.0)) * 0.1 / sources.lever_px
    assert pivot.contribution == pytest.approx(expected, abs=1e-8)


def test_registration_contributes_its_sigma_and_its_pivot_sensitivity():
    sensitivity = np.column_stack([np.linspace(0.0, 4e-4, N), np.linspace(1e-4, -3e-4, N)])
    sigma = np.full(N, 4e-5)
    plain, _ = nod_sources(noise=0.0, pose=0.0)
    neutral = replace(
        plain.neutral, registration=4e-5 / math.sqrt(REST.sum()), pivot_sensitivity=sensitivity[REST].mean(axis=0)
    )
    sources = replace(plain, registration=sigma, pivot_sensitivity=sensitivity, neutral=neutral)
    off = sensitivity - sensitivity[REST].mean(axis=0)
    expected = sigma**2 * (1.0 + 1.0 / REST.sum()) + np.einsum("ni,ij,nj->n", off, COVARIANCE, off)
    assert _combined(sources) == pytest.approx(np.sqrt(expected), rel=1e-9)
    assert _spread(sources, 70) == pytest.approx(_combined(sources)[70], rel=0.006)


def test_the_pivot_sensitivity_of_the_geometry_gives_the_sigma_of_the_geometry():
    sources, _ = nod_sources(lever_px=np.full(N, 200.0))
    along = np.column_stack([np.sin(sources.line), np.cos(sources.line)])
    sensitivity = along / 200.0
    registered = replace(
        sources,
        pivot_sensitivity=sensitivity,
        neutral=replace(sources.neutral, pivot_sensitivity=sensitivity[REST].mean(axis=0)),
    )
    assert _combined(registered) == pytest.approx(_combined(sources), rel=1e-9)
    assert _spread(registered, 60) == pytest.approx(_spread(sources, 60), rel=0.006)


def test_a_tilt_stretches_the_picture_across_its_axis():
    tilt = Tilt(math.radians(20.0), math.radians(30.0), 0.0)
    line = np.radians([30.0, 120.0, 75.0, 400.0])
    turned = np.degrees(tilt.turned(line, math.radians(5.0)))
    grown = math.cos(math.radians(20.0)) / math.cos(math.radians(25.0))
    assert turned[:2] == pytest.approx([30.0, 120.0])  # along the axis and across it nothing turns
    assert turned[2] == pytest.approx(30.0 + math.degrees(math.atan(grown)))
    assert turned[3] == pytest.approx(360.0 + 30.0 + math.degrees(math.atan(grown * math.tan(math.radians(10.0)))))


@pytest.mark.parametrize("axis_deg", [0.0, 35.0, 90.0])
def test_a_wrong_tilt_turns_a_line_as_undoing_it_does(axis_deg):
    axis, tilt, error = math.radians(axis_deg), math.radians(12.0), math.radians(3.0)
    view = Lens(tilt=tilt, tilt_axis=axis, focal_px=900.0, pivot_px=tuple(PIVOT))
    line = np.radians([-50.0, -8.0, 14.0])
    seen = view.distort(PIVOT + 180.0 * np.column_stack([np.cos(line), -np.sin(line)]))
    x, y = (replace(view, tilt=tilt + error).rectify(seen) - PIVOT).T
    assert np.arctan2(-y, x) == pytest.approx(Tilt(tilt, axis, 0.0).turned(line, error), abs=1e-9)


def test_the_term_of_the_tilt_equals_its_monte_carlo_spread():
    tilt = Tilt(math.radians(15.0), math.radians(20.0), math.radians(1.0))
    sources, _ = nod_sources(noise=0.0, pose=0.0, pivot_covariance_px2=np.zeros((2, 2)), tilt=tilt)
    assert _spread(sources, 60) == pytest.approx(_combined(sources)[60], rel=0.06)  # the slope itself changes by 1/15


def test_errors_of_the_time_count_by_the_speed_and_are_not_in_sigma():
    without, _ = nod_sources()
    sources = replace(without, exposure_s=0.01, clock_s=0.001)
    timed = {c.name: c for c in terms_over_time(sources) if not c.in_sigma}
    assert timed["instant within the exposure"].at(40).uncertainty == pytest.approx(0.01 / math.sqrt(12.0))
    assert _combined(sources) == pytest.approx(_combined(without))
    total = np.sqrt(sum(c.contribution[40] ** 2 for c in terms_over_time(sources)))
    assert total > 1.5 * _combined(sources)[40]
    assert _spread(sources, 40) == pytest.approx(total, rel=0.006)
