"""Recordings fitted at once give the same predictions, residuals and derivatives as one after another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.fit import whiten
from anglecam.identification.joined import NUISANCE_STEP, STEP, join
from anglecam.models.plant import Plant
from anglecam.models.third_order import ThirdOrder
from support.motion import Plant as TruePlant
from support.series import session

PHI = 0.4
ABC = np.array([26.0, 524.0, 508.0])
ONE, *OTHERS = session(TruePlant(), 0)
RECORDS = [replace(ONE, zero_known=True), *OTHERS]
NUISANCE = [np.array([r.angle[0], 0.02 * i, 0.001 * i][: 3 - r.zero_known]) for i, r in enumerate(RECORDS)]
JOINED = join(RECORDS, PHI)
OWN = JOINED.stack(NUISANCE)
MODELS = [
    (Plant(), ABC),
    (Plant((effect("coulomb_friction"),)), np.array([*ABC, 3.0, 0.0, 0.2, 0.1])),
    (Plant((effect("angle_drift"), effect("backlash"))), np.array([*ABC, 0.002, 0.01])),
]


def one_by_one(model, parameters, nuisance):
    """Return each recording's whitened prediction."""
    return [
        whiten(r, PHI, model.predict(parameters, r.time, r.command, o[:2], r.view) + (0.0 if r.zero_known else o[2]))
        for r, o in zip(RECORDS, nuisance, strict=True)
    ]


@pytest.mark.parametrize(("model", "parameters"), MODELS)
def test_predictions_and_residuals_are_those_of_each_recording(model, parameters):
    predicted = JOINED.predict(model, parameters, OWN)
    expected = np.concatenate(one_by_one(model, parameters, NUISANCE))
    assert JOINED.whiten(predicted.angle) == pytest.approx(expected, abs=1e-13)
    measured = np.concatenate([whiten(r, PHI, r.angle) for r in RECORDS])
    assert JOINED.errors(predicted) == pytest.approx(measured - expected, abs=1e-13)


@pytest.mark.parametrize(("model", "parameters"), MODELS)
def test_derivatives_are_those_of_each_recording(model, parameters):
    here = one_by_one(model, parameters, NUISANCE)
    shared, own = [], np.zeros((len(JOINED.angle), 3))
    for j, value in enumerate(parameters):
        shifted = parameters.copy()
        step = STEP * max(model.scales[j], abs(value))
        shifted[j] += step
        after = one_by_one(model, shifted, NUISANCE)
        shared.append(np.concatenate([(a - b) / step for a, b in zip(after, here, strict=True)]))
    for i, nuisance in enumerate(NUISANCE):
        for j in range(len(nuisance)):
            changed = [one.copy() for one in NUISANCE]
            changed[i][j] += NUISANCE_STEP
            own[JOINED.runs.parts[i], j] = (one_by_one(model, parameters, changed)[i] - here[i]) / NUISANCE_STEP
    slopes = JOINED.slopes(model, parameters, OWN, JOINED.predict(model, parameters, OWN))
    # the sums before the difference quotient are rounded in another order
    assert slopes.shared == pytest.approx(np.column_stack(shared), rel=1e-9, abs=1e-8)
    assert slopes.own == pytest.approx(own, rel=1e-9, abs=1e-8)


def test_fixed_parameters_have_no_derivatives():
    predicted = JOINED.predict(Plant(), ABC, OWN)
    slopes = JOINED.slopes(Plant(), ABC, OWN, predicted, fixed=True)
    assert not slopes.shared.any()
    assert slopes.own.any()


def test_a_known_zero_is_no_nuisance_parameter():
    assert JOINED.fitted(OWN)[:, 2].tolist() == [False, True, True, True, True]
    declared = [replace(r, zero_known=True) for r in RECORDS]
    assert join(declared, 0.0).stack([one[:2] for one in NUISANCE]).shape == (5, 2)


def test_a_model_without_joined_runs_is_predicted_one_recording_after_another():
    model, parameters = ThirdOrder(), np.array([50.0, 1200.0, 20000.0, 0.0, 300.0, 20000.0])
    own = np.zeros((len(RECORDS), model.states + 1))
    each = [model.predict(parameters, r.time, r.command, own[i, : model.states]) for i, r in enumerate(RECORDS)]
    assert list(JOINED.predict(model, parameters, own).angle) == list(np.concatenate(each))


def test_where_only_one_side_is_finite_the_derivative_is_taken_there():
    class Limited(Plant):
        """A plant that is undefined above a damping."""

        def predict_all(self, parameters, runs, first, near=None):
            angle, motion = super().predict_all(parameters, runs, first, near)
            return (angle if parameters[0] <= ABC[0] else np.full(len(angle), np.nan)), motion

    limited, whole = (
        JOINED.slopes(model, ABC, OWN, JOINED.predict(model, ABC, OWN)).shared for model in (Limited(), Plant())
    )
    assert np.isfinite(limited).all()
    assert limited[:, 0] == pytest.approx(whole[:, 0], abs=1e-4 * np.abs(whole[:, 0]).max())


def test_colouring_undoes_whitening():
    white = np.random.default_rng(0).standard_normal((len(JOINED.angle), 2))
    assert JOINED.whiten(JOINED.colour(white)) == pytest.approx(white, abs=1e-12)
    assert np.array_equal(join(RECORDS, 0.0).colour(white), white)
