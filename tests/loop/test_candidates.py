"""Each effect is fitted as well as from its true parameters."""

from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.noise import DISTANCE, Noise
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.candidates import Candidate, fit_from_candidates
from anglecam.loop.cross_validation import split_records
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.likelihood import log_likelihood_gain, rms_difference
from anglecam.loop.policy import DEFAULT
from anglecam.loop.rivals import find_rivals
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.loop.stepwise import Task, assess, rank_candidates
from anglecam.models.plant import Plant
from benchmarks.blind.drawn import draw
from benchmarks.blind.sessions import HELD_OUT, session
from support.starts import first_start

FEW = ("stairs", "chirp", "random")
"""Recordings of a session that show dry friction as all five do."""


@pytest.mark.parametrize(("seed", "torque"), [(7, 0.798), pytest.param(5, 0.896, marks=pytest.mark.sweep)])
def test_dry_friction_is_fitted_as_well_as_from_the_truth_and_without_staged_parameters(seed, torque):
    fitted, _ = split_records(session({"coulomb_friction": {"torque": torque}}, seed=seed), HELD_OUT)
    friction = effect("coulomb_friction")
    base = fit_output_error(Plant(), fitted, [np.array([26.0, 524.0, 508.0])])
    (forecast,) = forecasts(base, directions(base, fitted, changes(base, fitted, [friction])))
    found = fit_with(base, fitted, forecast)
    size = replace(friction, parameters=friction.parameters[:1])
    from_truth = fit_output_error(Plant((size,)), fitted, [np.append(base.parameters, torque)])
    assert found.cost < (1.0 + 1e-6) * from_truth.cost
    assert found.model.names[3:] == ("friction_deg_per_s2",)


def test_a_dead_zone_is_fitted_as_well_as_from_the_truth_once_a_candidate_has_left_its_local_minimum():
    width = 0.11164477548077598
    fitted, _ = split_records(session({"dead_zone": {"half_width_deg": width}}, seed=1), HELD_OUT)
    base = fit_output_error(Plant(), fitted, [np.array([26.0, 608.0, 428.0])])
    now, found = base, []
    for name in ("dead_zone", "constant_torque"):
        (forecast,) = forecasts(now, directions(now, fitted, changes(now, fitted, [effect(name)])))
        found.append(Candidate(forecast, fit_with(now, fitted, forecast), 0.0, None, None, 0.0))
        now = found[-1].fit
    zone, beside = found
    deeper = fit_from_candidates(zone.fit, [beside], fitted)
    from_truth = fit_output_error(zone.fit.model, fitted, [np.append(base.parameters, np.radians(width))])
    assert deeper.model is zone.fit.model
    assert deeper.cost < (1.0 + 1e-6) * from_truth.cost
    assert fit_from_candidates(deeper, [], fitted) is deeper


def test_the_stribeck_speed_is_bounded_to_slow_motion():
    friction = {"torque": 0.8, "breakaway": 1.6, "stribeck_deg_per_s": 60.0}  # a quarter of the fastest speed
    fitted, _ = split_records(session({"coulomb_friction": friction}, seed=5, sigma_deg=0.002, names=FEW), HELD_OUT)
    base = fit_output_error(Plant(), fitted, [np.array([26.0, 524.0, 508.0])])
    (forecast,) = forecasts(base, directions(base, fitted, changes(base, fitted, [effect("coulomb_friction")])))
    found = dict(zip((fit := fit_with(base, fitted, forecast)).model.names, fit.parameters, strict=True))
    fastest = max(np.max(np.abs(np.gradient(r.angle, r.time))) for r in fitted)
    assert found["stribeck_speed_deg_per_s"] == pytest.approx(DEFAULT.candidates.slow_speed_share * fastest, rel=0.02)


def test_in_a_film_a_change_below_the_angles_uncertainty_adds_no_staged_parameter():
    friction = {"torque": 0.8, "breakaway": 1.6}
    fitted, _ = split_records(session({"coulomb_friction": friction}, seed=5, sigma_deg=0.002, names=FEW), HELD_OUT)
    base = fit_output_error(Plant(), fitted, [np.array([26.0, 524.0, 508.0])])
    (forecast,) = forecasts(base, directions(base, fitted, changes(base, fitted, [effect("coulomb_friction")])))
    sure = fit_with(base, fitted, forecast)
    size_alone = fit_with(base, fitted, forecast, staged=False)
    distance = rms_difference(sure, size_alone)
    assert len(sure.parameters) > len(size_alone.parameters)
    assert len(fit_with(base, fitted, forecast, camera=0.9 * distance).parameters) == len(sure.parameters)
    assert len(fit_with(base, fitted, forecast, camera=1.1 * distance).parameters) == len(size_alone.parameters)


@pytest.mark.parametrize(
    ("sigma_deg", "alike"),
    [pytest.param(0.002, "camera_tilt", marks=pytest.mark.sweep), (0.05, "lens_distortion")],
)
def test_between_effects_closer_than_the_cameras_uncertainty_only_strong_evidence_decides(sigma_deg, alike):
    effects = {"camera_tilt": {"tilt_deg": 9.0}}
    fitted, predicted = split_records(session(effects, seed=3, sigma_deg=sigma_deg), HELD_OUT)
    base = fit_output_error(Plant(), fitted, [np.array([26.0, 524.0, 508.0])])
    ledger = [effect(name) for name in ("camera_tilt", "lens_distortion")]
    tilt, lens = sorted(
        forecasts(base, directions(base, fitted, changes(base, fitted, ledger))), key=lambda f: f.effect.id
    )
    best = fit_with(base, fitted, tilt)
    distance = rms_difference(best, fit_with(base, fitted, lens))
    assert len(tilt.effect.parameters) > len(lens.effect.parameters)
    assert list(find_rivals(best, base, fitted, tilt.effect, [lens], 1.02 * distance)) == ["lens_distortion"]
    floor = Noise(1.02 * distance, 0.0, 0.1, DISTANCE)
    task = Task(tuple(fitted), tuple(predicted), tuple(ledger), floor, np.random.default_rng(0), lambda stage: None)
    assert rank_candidates(task, assess(task, base))[0].effect.id == alike


def test_a_converged_fit_gains_nothing_when_it_is_repeated():
    gravity = effect("gravity_geometry")
    fitted, _ = split_records(session(draw(gravity.id, 4), seed=4), HELD_OUT)
    start = [26.0, 524.0, 508.0, *first_start(gravity)]
    found = further = fit_output_error(Plant((gravity,)), fitted, [np.array(start)])
    for _ in range(4):
        further = fit_output_error(further.model, fitted, [further.parameters], nuisance=further.nuisance)
    assert log_likelihood_gain(found.cost, further.cost, len(found.white)) < 0.01
