"""Output error against plants whose parameters are known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from anglecam.data.record import Record
from anglecam.identification.identify_records import identify_records
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.io.rig import Rig
from anglecam.models.plant import Plant
from support.motion import Plant as TruePlant
from support.motion import Recording
from support.series import noise, record, session

TRUE = np.array([26.0, 524.0, 508.0])
EXACT = session(TruePlant(), 0, sigma_deg=0.0)


def noisy(seed, phi=0.0):
    rng = np.random.default_rng(seed)
    return [replace(r, angle=r.angle + noise(rng, len(r.time), np.radians(0.2), phi)) for r in EXACT[::2]]


def test_a_b_c_lie_within_their_stated_uncertainty():
    normalised = []
    for seed in range(20):
        records = noisy(seed)
        fit = fit_output_error(Plant(), records, start_parameters(records))
        normalised.append((fit.parameters - TRUE) / fit.sigma)
    spread = np.std(normalised, axis=0)
    assert np.all((spread > 0.6) & (spread < 1.45)), spread  # 99 % limits of a standard deviation over 20 draws


@pytest.mark.parametrize(
    "plant", [TruePlant(2.0, 40.0, 38.0), TruePlant(8.0, 150.0, 300.0), TruePlant(60.0, 900.0, 880.0)]
)
def test_other_plants_are_found_without_an_initial_guess(plant):
    records = session(plant, 1)
    fit = fit_output_error(Plant(), records, start_parameters(records))
    assert fit.parameters == pytest.approx([plant.a, plant.b, plant.c], rel=0.01)


def test_sigma_includes_ar1_noise():
    normalised = []
    for seed in range(20):
        records = noisy(seed, phi=0.6)
        model = identify_records(records, Rig(), "oe2")
        normalised.append((model.values - TRUE) / model.sigmas)
    spread = np.std(normalised, axis=0)
    assert np.all((spread > 0.6) & (spread < 1.45)), spread


def test_sigma_includes_correlated_errors_that_the_fit_was_not_given():
    found, stated = [], []
    for seed in range(20):
        records = session(TruePlant(), 40 + seed, sigma_deg=0.2, phi=0.6)
        fit = fit_output_error(Plant(), records, [TRUE])
        found.append(fit.parameters)
        stated.append((fit.sigma, np.sqrt(np.diag(fit.covariance))))
    sigma, white = np.mean(stated, axis=0)
    spread = np.std(found, axis=0)
    assert np.all((spread / sigma > 0.6) & (spread / sigma < 1.45)), spread / sigma
    assert np.all(spread / white > 1.45), spread / white


def test_a_free_swing_is_fitted_from_an_unknown_state():
    swing = Recording("release", "release", amplitude_deg=15.0, rest_s=0.0)
    true = TruePlant(a=0.4, b=30.0)
    records = [record(true, swing, np.random.default_rng(0), sigma_deg=0.1)]
    model = identify_records(records, Rig(), "oe2")
    assert model.values == pytest.approx([0.4, 30.0], rel=0.02)
    assert model.as_dict()["parameters"].keys() >= {"a_per_s", "b_per_s2", "c_per_s2"}


def test_prediction_of_a_held_out_recording_leaves_the_noise():
    *fitted, held_out = session(TruePlant(), 3, sigma_deg=0.1)
    fit = fit_output_error(Plant(), fitted, start_parameters(fitted))
    assert np.degrees(predict_output_error(fit, [held_out]).rmse) == pytest.approx(0.1, rel=0.1)


def test_angle_errors_shift_parameters_as_predicted_and_not_at_all_where_fitted_zeros_absorb_them():
    known = [replace(r, zero_known=True) for r in EXACT]
    fit = fit_output_error(Plant(), known, [TRUE])
    for shape in (np.ones_like, np.sin):
        errors = [1e-4 * shape(r.angle) for r in known]
        off = fit_output_error(
            Plant(), [replace(r, angle=r.angle + e) for r, e in zip(known, errors, strict=True)], [TRUE]
        )
        assert off.parameters - fit.parameters == pytest.approx(fit.parameter_shift(known, errors), rel=0.01, abs=1e-6)
    free = noisy(0)
    ones = [np.ones_like(r.angle) for r in free]
    assert np.all(np.abs(fit_output_error(Plant(), free, [TRUE]).parameter_shift(free, ones)) < 1e-6 * TRUE)


class TwoAlike:
    """Two parameters whose effects on the angle are nearly the same; the second is at most 1."""

    states, names = 2, ("free", "bounded")
    lower, upper, scales, to_file = np.zeros(2), np.array([np.inf, 1.0]), np.ones(2), np.ones(2)

    def predict(self, parameters, time, command, state, view=None):
        return parameters @ [np.sin(time), np.sin(1.05 * time)]


def test_sigma_of_a_parameter_correlated_with_one_at_its_bound_includes_the_distance_from_the_bound():
    rng, sigma, time = np.random.default_rng(0), 0.2, np.arange(0.0, 9.0, 1.0 / 15.0)
    exact = TwoAlike().predict(np.array([1.0, 0.9]), time, None, None)
    columns = np.column_stack([np.sin(time), np.sin(1.05 * time)])
    unbounded = sigma * np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0])
    model, relaxed, fixed = TwoAlike(), [], []
    for _ in range(200):
        angle = exact + sigma * rng.standard_normal(len(time))
        measured = Record("one", time, angle, None, zero_known=True, sigma=np.full(len(time), sigma))
        fit = fit_output_error(model, [measured], [np.array([1.0, 0.5])], nuisance=[np.zeros(2)])
        if fit.parameters[1] > 1.0 - 1e-6:
            assert np.isnan(fit.sigma[1])
            # no larger than without the bound; the noise is known to 6 %
            assert np.sqrt(fit.covariance[0, 0]) < 1.2 * unbounded
            relaxed.append((fit.parameters[0] - 1.0) / fit.sigma[0])
            fixed.append((fit.parameters[0] - 1.0) / (sigma / np.linalg.norm(np.sin(time))))
    assert len(relaxed) > 30
    assert np.mean(np.abs(relaxed) < 1.96) >= 0.9
    assert np.mean(np.abs(fixed) < 1.96) < 0.7  # as if the bound were the truth


@dataclass(frozen=True)
class Diverges:
    """The angle grows with time, and beyond a certain rate it diverges."""

    beyond: float

    states, names = 2, ("rate",)
    lower, upper, scales, to_file = np.full(1, -np.inf), np.full(1, np.inf), np.ones(1), np.ones(1)

    def predict(self, parameters, time, command, state, view=None):
        return parameters[0] * time if parameters[0] <= 1.0 else np.full(len(time), self.beyond)


@pytest.mark.parametrize("beyond", [np.nan, 1e240])  # the angle is not finite, or its square overflows
def test_a_start_next_to_which_the_plant_diverges_is_fitted(beyond):
    time = np.arange(0.0, 2.0, 0.1)
    measured = Record("one", time, 0.5 * time, None, zero_known=True, sigma=np.full(len(time), 0.01))
    fit = fit_output_error(Diverges(beyond), [measured], [np.ones(1)], nuisance=[np.zeros(2)])
    assert fit.parameters == pytest.approx([0.5])
