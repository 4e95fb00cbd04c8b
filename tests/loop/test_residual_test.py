"""An effect whose frequency is searched in the residual does not raise the false-alarm rate of the residual test."""

import math
from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.effects.seen import sines_and_cosines
from anglecam.identification.output_error import fit_output_error
from anglecam.loop import noise_draws
from anglecam.loop.residual_test import run_residual_test
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.loop.seen import largest_shares, seen_of
from anglecam.models.plant import Plant
from benchmarks.blind.sessions import session

SEARCHED = ("periodic_disturbance", "cogging")
SIGMA = math.radians(0.05)
SAMPLES = 40


@pytest.fixture(scope="module")
def records():
    return session({}, seed=3, names=("triangle",))


@pytest.fixture(scope="module")
def fit(records):
    return fit_output_error(Plant(), records, [np.array([26.0, 524.0, 508.0])])


@pytest.fixture(scope="module")
def tested_noise(fit, records):
    """Residual tests of pure noise with directions that were chosen from it, and the best forecast gain of each."""
    rng, found = np.random.default_rng(5), []
    ledger = [effect(name) for name in SEARCHED]
    patch = pytest.MonkeyPatch()
    patch.setattr(noise_draws, "DRAWS", 199)  # for speed
    for _ in range(SAMPLES):
        noise = SIGMA * rng.standard_normal(len(fit.white))
        noisy = replace(fit, white=fit.slopes.without_followed(noise))
        chosen = directions(noisy, records, changes(noisy, records, ledger))
        result = run_residual_test(noisy, records, chosen, rng, 0.0, phi_estimated=False)
        found.append((result, forecasts(noisy, chosen)[0].gain))
    patch.undo()
    return found


def test_the_test_finds_structure_in_no_more_noise_than_its_rate_states(tested_noise):
    p = np.array([result.p_value for result, _ in tested_noise])
    assert np.sum(p < 0.05) <= 6  # of 40; more has a probability of 0.3 % at a rate of 5 %
    assert abs(np.mean(p < 0.5) - 0.5) < 0.24  # three standard deviations


@pytest.mark.parametrize("name", SEARCHED)
def test_the_p_value_of_a_searched_effect_is_uniform_for_noise(tested_noise, name):
    each = [{test.name: test.p_value for test in result.tests}[f"effect {name}"] for result, _ in tested_noise]
    off = np.sort(each) - (np.arange(SAMPLES) + 0.5) / SAMPLES
    assert np.max(np.abs(off)) < 1.63 / math.sqrt(SAMPLES)  # Kolmogorov's 1 % limit


def test_the_further_gain_of_noise_is_small_although_the_chosen_frequency_fits_it(tested_noise):
    further, forecast = np.median([(result.further_gain, gain) for result, gain in tested_noise], axis=0)
    assert forecast > 4.0
    assert further < 0.5 * forecast


def test_a_wave_between_two_searched_frequencies_loses_little(fit, records):
    seen = seen_of(fit, records)
    tried = np.linspace(2.0, 4.0, round(2 * 2.0 * seen.span) + 1)
    change = _change(fit, records, frequency=0.5 * (tried[8] + tried[9]))
    torques = sines_and_cosines(seen.times, math.tau * tried)
    assert largest_shares(fit, records, seen.times, torques, change[:, None]) > 0.75


def test_a_disturbance_as_large_as_the_noise_is_found_at_its_frequency(fit, records):
    rng, change = np.random.default_rng(2), _change(fit, records, frequency=3.3)
    white = SIGMA * (rng.standard_normal(len(change)) + change / np.sqrt(np.mean(change**2)))
    noisy = replace(fit, white=fit.slopes.without_followed(white))
    chosen = directions(noisy, records, changes(noisy, records, [effect("periodic_disturbance")]))
    result = run_residual_test(noisy, records, chosen, rng, 0.0, phi_estimated=False)
    assert result.p_value == pytest.approx(0.001)
    assert {test.name: test.p_value for test in result.tests}["effect periodic_disturbance"] < 1e-12
    assert forecasts(noisy, chosen)[0].start[1] == pytest.approx(3.3, abs=0.03)
    assert result.further_gain > 0.25 * len(change)


def test_long_series_are_tested_in_blocks_of_single_precision_with_the_same_result(fit, records, monkeypatch):
    noise = SIGMA * np.random.default_rng(4).standard_normal(len(fit.white))
    noisy = replace(fit, white=fit.slopes.without_followed(noise))
    chosen = directions(noisy, records, changes(noisy, records, [effect("quadratic_drag"), effect("cogging")]))
    whole = run_residual_test(noisy, records, chosen, np.random.default_rng(1), 0.0, phi_estimated=False)
    monkeypatch.setattr(noise_draws, "MOST_DOUBLE", 0)
    monkeypatch.setattr(noise_draws, "AT_ONCE", 7 * len(fit.white))
    parts = run_residual_test(noisy, records, chosen, np.random.default_rng(1), 0.0, phi_estimated=False)
    found, expected = (
        [test.p_value for test in result.tests if "effect" not in test.name] for result in (parts, whole)
    )
    assert found == pytest.approx(expected, rel=1e-3)  # of the data alone, not of the draws
    assert parts.p_value == pytest.approx(whole.p_value, abs=0.05)  # with other draws


def _change(fit, records, frequency):
    """Return the change by a periodic disturbance, (N,) rad, that the fit cannot follow."""
    (record,), (own,) = records, fit.nuisance
    plant = Plant((effect("periodic_disturbance"),))
    pushed, left_alone = (
        plant.predict(np.append(fit.parameters, [amplitude, frequency, 0.4]), record.time, record.command, own[:2])
        for amplitude in (1.0, 0.0)
    )
    return fit.slopes.without_followed(pushed - left_alone)
