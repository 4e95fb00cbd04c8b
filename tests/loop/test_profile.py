"""The profile likelihood agrees with the linear interval where that holds, and keeps to bounds where it does not."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.certificate.quantity import with_breakaway
from anglecam.effects import effect
from anglecam.identification.noise import Noise
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.profile import THRESHOLD, _end, interval_of, profile
from anglecam.models.plant import Plant
from support.motion import Plant as TruePlant
from support.motion import Recording
from support.series import record

NOISE = Noise(np.radians(0.05), 0.0, 0.1, "stated")


@pytest.fixture(scope="module")
def late():
    rng = np.random.default_rng(1)
    true = TruePlant(dead_time_s=0.03)
    records = [record(true, Recording(k, k, duration_s=4.0), rng, sigma_deg=0.05) for k in ("stairs", "chirp")]
    fit = fit_output_error(Plant((effect("dead_time"),)), records, [np.array([26.0, 524.0, 508.0, 0.03])])
    return fit, records


def test_a_smooth_parameter_has_the_linear_interval(late):
    fit, records = late
    found = profile(fit, "tau_s", records, NOISE)
    sigma = fit.sigma[3]
    assert found.upper - found.estimate == pytest.approx(1.96 * sigma, rel=0.1)
    assert found.estimate - found.lower == pytest.approx(1.96 * sigma, rel=0.1)
    assert found.lower < 0.03 < found.upper
    assert found.excludes_null
    assert found.is_limited


def test_where_the_likelihood_is_quadratic_the_interval_is_that_of_the_standard_uncertainty(late):
    fit, records = late
    assert interval_of(fit, "tau_s", records, NOISE) == pytest.approx(
        (fit.parameters[3] - 1.96 * fit.sigma[3], fit.parameters[3] + 1.96 * fit.sigma[3]), abs=1e-3 * fit.sigma[3]
    )


def test_where_it_is_not_the_interval_is_that_of_the_profile(late):
    """A speed limit that is never reached has a flat likelihood below a certain reciprocal."""
    _, records = late
    plant = Plant((effect("dead_time"), effect("rate_limit")))
    fit = fit_output_error(plant, records, [np.array([26.0, 524.0, 508.0, 0.03, 1e-3])])
    found = interval_of(fit, "rate_deg_per_s", records, NOISE)
    whole = profile(fit, "rate_deg_per_s", records, NOISE)
    assert found == (whole.lower, whole.upper)
    assert found[0] == 0.0 < found[1] < 1.0


@pytest.mark.parametrize(("absence", "lower"), [(3.84, 0.05), (5.99, 0.0)])
def test_absence_is_excluded_by_its_threshold(absence, lower):
    """The deviance (x − 1)²·4.25 is 3.84 at 0.05 and 4.25 at 0."""
    found = _end(lambda x: 4.25 * (x - 1.0) ** 2, 1.0, -0.5, 0.0, 0.0, absence)
    assert found == pytest.approx(lower, abs=0.02)


def test_a_further_uncertainty_widens_the_interval(late):
    fit, records = late
    found = profile(fit, "tau_s", records, NOISE, 0.002)
    assert found.upper - found.estimate == pytest.approx(1.96 * 0.002, rel=0.1)


@pytest.mark.parametrize(
    ("estimate", "expected"),
    [(0.0, (0.0, 2.0)), (1.0, (0.0, 3.0)), (5.0, (3.0, 7.0))],
    ids=["at the null", "near it", "far from it"],
)
def test_the_ends_of_a_parabola_and_the_null(estimate, expected):
    def deviance(value):
        return THRESHOLD * ((value - estimate) / 2.0) ** 2

    low, high = (_end(deviance, estimate, step, bound, 0.0) for step, bound in ((-0.5, 0.0), (0.5, 100.0)))
    assert low == pytest.approx(expected[0], abs=0.06)
    assert high == pytest.approx(expected[1], abs=0.11)
    assert high >= expected[1]  # rounded outwards
    assert low <= expected[0]


def test_an_end_beyond_the_bound_is_infinite_and_a_second_maximum_is_inside():
    assert _end(lambda value: 0.0, 1.0, 0.5, 10.0, 0.0) == np.inf

    def two_maxima(value):
        return min(40.0 * abs(value - 1.0), 10.0 * abs(value - 1.7))

    assert _end(two_maxima, 1.0, 0.05, 10.0, 0.0) == pytest.approx(1.7 + THRESHOLD / 10.0, abs=0.05)


def test_breakaway_friction_is_the_ledgers_with_another_parameter():
    level = with_breakaway(effect("coulomb_friction"))
    np.testing.assert_allclose(level.complete(np.array([2.0, 0.1, 3.0])), [2.0, 0.1, 1.0])
    np.testing.assert_allclose(level.complete(np.array([4.0, 0.1, 3.0])), [3.0, 0.1, 0.0])
    held = level.with_fixed({"asymmetry_deg_per_s2": 0.0}).with_fixed({"breakaway_deg_per_s2": 3.0})
    np.testing.assert_allclose(held.complete(np.array([2.0])), [2.0, 0.0, 1.0])
