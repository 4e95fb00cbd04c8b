"""The noise's size and correlation agree with the truth, whichever source they come from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from anglecam.data.record import record_from_series
from anglecam.data.series import AngleSeries
from anglecam.identification.noise import (
    MEASURED,
    QUANTISED,
    RESIDUAL,
    REST,
    autoregression,
    correlated_share,
    noise_floor,
)
from anglecam.identification.quantisation import quantisation
from support.motion import Plant
from support.series import session

STEP = np.radians(360.0 / 4096)


def rounded(records, step=STEP, decimals=None, offset=0.0):
    found = [replace(r, angle=step * np.round(r.angle / step) + offset) for r in records]
    if decimals is not None:
        found = [replace(r, angle=np.radians(np.round(np.degrees(r.angle), decimals))) for r in found]
    return found


@pytest.mark.parametrize("decimals", [None, 2, 3, 4, 6])
@pytest.mark.parametrize("offset", [0.0, 0.0123])
def test_the_step_of_an_encoder_is_found_whatever_the_files_rounding(decimals, offset):
    grid = quantisation(rounded(session(Plant(), 3, sigma_deg=0.01), decimals=decimals, offset=offset))
    assert grid.step == pytest.approx(STEP, rel=1e-3)
    assert grid.sigma == pytest.approx(STEP / np.sqrt(12.0), rel=1e-3)


@pytest.mark.parametrize("decimals", [2, 4, 6])
def test_the_decimals_of_a_file_are_not_the_noise(decimals):
    records = [replace(r, angle=np.radians(np.round(np.degrees(r.angle), decimals))) for r in session(Plant(), 4)]
    assert quantisation(records) is None
    floor = noise_floor(records)
    assert floor.source == "rest"
    assert np.degrees(floor.sigma) == pytest.approx(0.05, rel=0.2)
    assert noise_floor([r.between(1.0, np.inf) for r in records]) is None


def test_a_quantised_rest_without_scatter_is_not_taken_for_no_noise():
    floor = noise_floor(rounded(session(Plant(), 5, sigma_deg=0.0)))
    assert floor.source == QUANTISED
    assert floor.sigma == pytest.approx(STEP / np.sqrt(12.0), rel=1e-3)


def test_the_stated_uncertainty_is_not_overruled_by_the_rest():
    records = [replace(r, sigma=np.full(len(r.time), 2e-4)) for r in session(Plant(), 6)]
    floor = noise_floor(records)
    assert (floor.source, floor.sigma) == ("stated", pytest.approx(2e-4))
    assert floor.phi == pytest.approx(noise_floor(session(Plant(), 6)).phi)


@pytest.mark.parametrize(
    "motion",
    [lambda t: 0.9 * np.sin(12.0 * t), lambda t: 0.02 * t, lambda t: 0.1 * np.exp(-3.0 * t)],
    ids=["swing", "trend", "approach"],
)
def test_a_rest_in_motion_is_not_taken_for_noise(motion):
    records = [replace(r, angle=r.angle + motion(r.time)) for r in session(Plant(), 7)]
    assert noise_floor(records) is None


def test_repeated_recordings_show_the_noise_where_there_is_no_rest():
    cut = [[r.between(1.0, np.inf) for r in session(Plant(), 8, phi=phi)] for phi in (0.0,)]
    first = cut[0]
    rng = np.random.default_rng(0)
    again = [replace(r, angle=r.angle + np.radians(0.05) * rng.standard_normal(len(r.time))) for r in first]
    floor = noise_floor([*first, *again])
    assert floor.source == "repeated recordings"
    # the second time has the first one's noise and as much again, so half the difference's variance is half of it
    assert np.degrees(floor.sigma) == pytest.approx(0.05 / np.sqrt(2.0), rel=0.1)


@pytest.mark.parametrize("phi", [0.0, 0.6])
def test_the_estimated_noise_states_a_lower_limit_that_holds_in_95_percent(phi):
    rng, held, draws = np.random.default_rng(1), 0, 400
    for _ in range(draws):
        e = rng.standard_normal(150)
        for i in range(1, len(e)):
            e[i] = phi * e[i - 1] + np.sqrt(1.0 - phi**2) * e[i]
        held += autoregression([e], REST).least_sigma < 1.0
    # a two-sided 95 % interval leaves 2.5 % above its lower limit; 3 sigma of the binomial about it
    assert held / draws == pytest.approx(0.975, abs=3.0 * np.sqrt(0.975 * 0.025 / draws))


def test_a_stated_uncertainty_is_its_own_lower_limit():
    floor = noise_floor([replace(r, sigma=np.full(len(r.time), 2e-4)) for r in session(Plant(), 6)])
    assert floor.least_sigma == pytest.approx(2e-4)


@pytest.mark.parametrize("decimals", [15, 4])  # in memory, and as files state places
def test_a_mark_that_a_bodys_rotation_placed_shows_no_noise_and_the_stated_one_counts(decimals):
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 6.0, 1.0 / 30.0)
    true, sigma = 0.2 * np.sin(3.0 * time), np.radians(0.05)
    angle = true + rng.normal(0.0, sigma, len(time))
    pivot = np.tile([320.0, 60.0], (len(time), 1))
    placed = pivot + 210.0 * np.column_stack([np.sin(angle), np.cos(angle)])
    seen = placed + rng.normal(0.0, 210.0 * sigma, placed.shape)
    series = AngleSeries(
        "body", time, angle, np.full(len(time), sigma), ("ok",) * len(time), line=angle, pivot_px=pivot
    )
    carried, marked = (
        record_from_series(replace(series, mark_px=np.round(mark, decimals)), None, zero_known=False)
        for mark in (placed, seen)
    )
    noise = noise_floor([carried])
    assert (noise.source, noise.sigma, noise.filmed) == (MEASURED, pytest.approx(sigma), True)
    assert noise_floor([marked]).sigma == pytest.approx(sigma, rel=0.15)
    assert np.isfinite(noise_floor([marked]).phi_error)  # the distance from the pivot shows the correlation as well


def _noise(phi, count, seed):
    white = np.random.default_rng(seed).standard_normal(count + 100)
    return lfilter([1.0], [1.0, -phi], white)[100:]


@pytest.mark.parametrize("phi", [0.0, 0.6, 0.9])
def test_all_of_autoregressive_noise_can_be_noise(phi):
    noises = [_noise(phi, 400, seed) for seed in range(200)]
    shares = np.array([correlated_share([one]) for one in noises])
    assert np.mean(shares == 1.0) > 0.85
    assert shares.mean() > 0.98


def test_what_follows_the_motion_is_no_correlated_noise():
    time = np.arange(400) / 50.0
    left = np.radians(4.0) * np.sin(12.0 * time) + np.radians(0.05) * _noise(0.0, 400, 0)
    phi = autoregression([left], RESIDUAL).phi
    assert phi > 0.95
    assert correlated_share([left]) < 0.1
    assert correlated_share([left[:5]]) == 1.0  # nothing can be said
