"""The consistency tests themselves: their rate of false alarms, and the errors that they detect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from anglecam.identification.ekf import EkfSettings, fit_ekf, settings_for
from support.consistency import consistency, error_consistency, innovation_consistency, innovation_whiteness
from support.motion import Plant as TruePlant
from support.motion import Recording
from support.series import noise, record

TRUE = np.array([26.0, 524.0, 508.0])
SIGMA = np.radians(0.2)
SPREAD = np.array([1.0, 15.0, 15.0])
STEPS = [record(TruePlant(), Recording("steps"), np.random.default_rng(0), sigma_deg=0.0)]
STEPS = [replace(STEPS[0], zero_known=True)]


def noisy(seed, records=STEPS, phi=0.0):
    rng = np.random.default_rng(seed)
    return [replace(r, angle=r.angle + noise(rng, len(r.time), SIGMA, phi)) for r in records]


def fitted(records):
    return fit_ekf(records, TRUE, settings_for(records, TRUE, SIGMA))


def plausible(count, trials, probability):
    """Return whether a count lies within the central 99.8 % of a binomial distribution."""
    low, high = binom.interval(0.998, trials, probability)
    return low <= count <= high


def test_bounds_hold_for_95_percent_of_sums_of_squares():
    sums = np.random.default_rng(0).chisquare(30, 2000)
    assert plausible(sum(consistency(float(s), 30).holds for s in sums), 2000, 0.95)


def test_errors_in_units_that_differ_by_powers_of_ten_are_tested_alike():
    rng = np.random.default_rng(1)
    half = np.array([[1e-4, 0.0, 0.0], [0.5, 1.0, 0.0], [300.0, 100.0, 1e3]])
    errors = rng.normal(size=(4000, 3)) @ half.T
    found = error_consistency(errors, np.tile(half @ half.T, (4000, 1, 1)))
    assert found.degrees_of_freedom == 12000
    assert found.mean == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 12000))


@pytest.mark.parametrize("seeds", [30, pytest.param(60, marks=pytest.mark.sweep)])
def test_one_pass_from_a_start_with_its_stated_uncertainty_has_errors_and_innovations_of_their_stated_size(seeds):
    variance = (SIGMA**2, 1e-6, *SPREAD**2)
    errors, covariances, normalised = [], [], []
    for seed in range(seeds):
        start = TRUE + SPREAD * np.random.default_rng(1000 + seed).normal(size=3)
        estimate = fit_ekf(noisy(seed), start, EkfSettings(variance, 0.0, SIGMA**2, 1))
        errors.append(estimate.parameters - TRUE)
        covariances.append(estimate.covariance)
        normalised.append(estimate.normalised[0][1:])  # the first frame is where the filter starts
    found = error_consistency(np.array(errors), np.array(covariances))
    assert abs(found.mean - 1.0) < 3.3 * np.sqrt(2.0 / found.degrees_of_freedom)
    assert np.mean(np.square(normalised)) == pytest.approx(1.0, abs=3.3 * np.sqrt(2.0 / np.size(normalised)))


@pytest.mark.parametrize("seeds", [30, pytest.param(120, marks=pytest.mark.sweep)])
def test_innovations_of_the_iterated_filter_fail_both_tests_at_their_nominal_rates(seeds):
    # 99.8 % of the counts at 5 % are 0 to 6 of 30, or 0 to 14 of 120
    estimates = [fitted(noisy(seed)) for seed in range(seeds)]
    assert plausible(sum(innovation_consistency(e).holds for e in estimates), seeds, 0.95)
    assert plausible(sum(innovation_whiteness(e.normalised).p_value < 0.05 for e in estimates), seeds, 0.05)


def test_fitted_unknowns_are_not_counted_as_degrees_of_freedom():
    assert innovation_consistency(fitted(noisy(0))).degrees_of_freedom == 240 - 5
    undeclared = [replace(r, zero_known=False) for r in noisy(0)]
    assert innovation_consistency(fitted([*undeclared, *undeclared])).degrees_of_freedom == 480 - 3 - 2 * 3


def test_noise_stated_20_percent_too_small_is_detected():
    records = noisy(0)
    estimate = fit_ekf(records, TRUE, settings_for(records, TRUE, 0.8 * SIGMA))
    assert not innovation_consistency(estimate).holds


def test_innovations_with_ar1_noise_or_an_unmodelled_dead_time_are_not_white():
    assert innovation_whiteness(fitted(noisy(0, phi=0.4)).normalised).p_value < 1e-4
    late = [record(TruePlant(dead_time_s=0.03), Recording("steps"), np.random.default_rng(0), sigma_deg=0.0)]
    assert innovation_whiteness(fitted(noisy(0, late)).normalised).p_value < 1e-4
