"""Torque curves over angle and speed span the residual of any such torque, in the ledger or not."""

import math

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.cross_validation import split_records
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.residual_test import run_residual_test
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.loop.torque_basis import torque_responses
from anglecam.models.plant import Plant
from benchmarks.blind.sessions import HELD_OUT, session


@pytest.fixture(scope="module")
def records():
    return session({}, seed=5)


@pytest.mark.parametrize(
    ("column", "effect_id", "size"),
    [("angle", "stiffening_spring", 60.0), ("velocity", "damping_asymmetry", 0.3), ("velocity", "quadratic_drag", 0.3)],
)
def test_the_change_by_a_torque_over_angle_or_speed_lies_in_the_span_of_its_basis(records, column, effect_id, size):
    fit = fit_output_error(Plant(), records, [np.array([26.0, 524.0, 508.0])])
    richer = Plant((effect(effect_id),))
    paths = []
    for value in (size, 0.0):
        parameters = np.append(fit.parameters, value)
        paths.append(
            [
                richer.predict(parameters, r.time, r.command, own[:2])
                for r, own in zip(records, fit.nuisance, strict=True)
            ]
        )
    change = np.concatenate(paths[0]) - np.concatenate(paths[1])
    left = {}
    for name, basis in torque_responses(fit, records).items():
        inside, *_ = np.linalg.lstsq(basis, change, rcond=None)
        left[name] = np.linalg.norm(change - basis @ inside) / np.linalg.norm(change)
    assert left[column] < 0.15
    assert left[column] < 0.3 * max(left.values())


def test_the_stribeck_curve_is_fitted_with_all_parameters():
    friction = {"torque": 4.0, "breakaway": 10.0, "stribeck_deg_per_s": 3.0}
    records = session({"coulomb_friction": friction}, seed=1, sigma_deg=0.005)
    base = fit_output_error(Plant(), records, [np.array([26.0, 524.0, 508.0])])
    (forecast,) = forecasts(base, directions(base, records, changes(base, records, [effect("coulomb_friction")])))
    fit = fit_with(base, records, forecast)
    assert np.degrees(fit.rmse) < 1.05 * 0.005
    true = [math.degrees(4.0), 0.0, math.degrees(6.0), 3.0]
    assert fit.model.names[3:] == tuple(p.name for p in effect("coulomb_friction").parameters)
    assert np.all(np.abs(np.degrees(fit.parameters[3:]) - true) < 3.0 * np.degrees(fit.sigma[3:]))
    assert np.degrees(fit.parameters[-1]) == pytest.approx(3.0, rel=0.05)


def test_the_residual_test_detects_a_one_sided_spring_after_the_most_similar_gravity_is_fitted():
    slack = {"one_sided_spring": {"stiffness": 9.1, "slack_deg": -0.27}}
    fitted, _ = split_records(session(slack, seed=1), HELD_OUT)
    near = np.array([26.1, 622.9, 435.6, math.radians(4625.0), math.radians(40.6)])
    fit = fit_output_error(Plant((effect("gravity_geometry"),)), fitted, [near])
    assert np.degrees(fit.rmse) < 1.05 * 0.05
    result = run_residual_test(fit, fitted, [], np.random.default_rng(0), 0.0, phi_estimated=False)
    assert result.p_value < 0.01
    assert min(result.tests, key=lambda test: test.p_value).name == "torque against angle"
