"""Fits of the laboratory's neck at ±25°: linear, third-order and large-angle models compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.errors import RigError
from anglecam.identification.fit import Fit
from anglecam.identification.identify_records import identify_records
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.io.rig import Rig
from anglecam.models.large_angle import LargeAngle
from anglecam.models.plant import Plant
from anglecam.models.third_order import ThirdOrder
from anglecam.neck.parameters import PAPER
from support.large_angle import COMMANDS, LABORATORY, noisy, true_angle

SIGMA_DEG = 0.2
MODEL = LargeAngle(LABORATORY)


@pytest.fixture(scope="module")
def angles():
    return {name: true_angle(name) for name in COMMANDS}


def records(angles, seed):
    rng = np.random.default_rng(seed)
    *fitted, held = [noisy(name, angle, rng, SIGMA_DEG) for name, angle in angles.items()]
    return fitted, held


def missed_deg(fit: Fit, held, angle) -> float:
    """Return the RMS difference of a held-out prediction from the true angle, the mean of each subtracted."""
    wrong = held.angle - predict_output_error(fit, [held]).residuals[0] - angle
    return float(np.degrees(np.std(wrong)))


def test_only_the_large_angle_fit_predicts_held_out_data_to_the_noise_floor(angles):
    fitted, held = records(angles, 0)
    linear = fit_output_error(Plant(), fitted, start_parameters(fitted))
    a, b, c = linear.parameters
    third = fit_output_error(
        ThirdOrder(), fitted, [np.array([a + p, b + a * p, b * p, 0.0, c, c * p]) for p in (20.0, 60.0)]
    )
    large = fit_output_error(MODEL, fitted, MODEL.starts(linear.parameters))
    floor = np.degrees(np.std(held.angle - angles["held"]))
    ratio = {f.model: np.degrees(predict_output_error(f, [held]).rmse) / floor for f in (linear, third, large)}
    assert ratio[large.model] < 1.02
    assert ratio[linear.model] > 1.15
    assert ratio[third.model] > 1.15
    assert missed_deg(large, held, angles["held"]) < 0.05 < 0.1 < missed_deg(linear, held, angles["held"])
    assert missed_deg(third, held, angles["held"]) > 0.1


def test_physical_parameters_lie_within_their_stated_uncertainty(angles):
    normalised, relative = [], []
    for seed in range(14):
        fitted, _ = records(angles, seed)
        fit = fit_output_error(MODEL, fitted, [MODEL.nominal])
        normalised.append((fit.parameters - MODEL.nominal) / fit.sigma)
        relative.append(fit.sigma / MODEL.nominal)
    spread, mean = np.std(normalised, axis=0, ddof=1), np.mean(normalised, axis=0)
    assert np.all((spread > 0.52) & (spread < 1.51)), spread  # 99 % limits of a standard deviation over 14 draws
    assert np.all(np.abs(mean) < 2.6 / np.sqrt(14)), mean
    assert np.median(relative, axis=0) == pytest.approx([0.004, 0.004, 0.02, 0.007], rel=0.35)  # C, c3, h, K


def test_a_wrong_start_of_every_quantity_is_corrected(angles):
    fitted, _ = records(angles, 1)
    servo, spring = PAPER.servo, PAPER.spring
    wrong = replace(
        PAPER,
        damping=3.0 * PAPER.damping,
        servo=replace(servo, amplifier_gain=0.5 * servo.amplifier_gain, sensor_gain=2.0 * servo.sensor_gain),
        spring=replace(spring, rate=1.4 * spring.rate),
    )
    model = LargeAngle(replace(LABORATORY, parameters=wrong))
    linear = fit_output_error(Plant(), fitted, start_parameters(fitted))
    fit = fit_output_error(model, fitted, model.starts(linear.parameters))
    assert np.all(np.abs(fit.parameters - MODEL.nominal) < 4.0 * fit.sigma)


def test_springs_that_do_not_balance_the_head_are_detected(angles):
    fitted, _ = records(angles, 2)
    model = LargeAngle(replace(LABORATORY, pretension_error=0.15), (*MODEL.free, "pretension_error_nm"))
    declared = [replace(r, zero_known=True) for r in fitted]
    fit = fit_output_error(model, declared, [model.nominal])
    excess, sigma = fit.parameters[-1], fit.sigma[-1]
    assert sigma < 0.002
    assert abs(excess) < 4.0 * sigma  # the laboratory's are balanced


def test_identify_fits_the_neck_and_reports_a_wrong_declaration(angles):
    fitted, held = records(angles, 2)
    model = identify_records(fitted, Rig(), "neck", held_out=[held], neck=LABORATORY)
    assert model.names == MODEL.names
    assert np.all(np.abs(model.fit.parameters - MODEL.nominal) < 4.0 * model.sigmas / MODEL.to_file)
    assert model.held_out is not None
    assert np.degrees(model.held_out.rmse) < 1.05 * SIGMA_DEG
    assert model.step.overshoot == pytest.approx(0.1, abs=0.05)
    with pytest.raises(RigError, match="common_stretch_m"):
        identify_records(fitted, Rig(), "neck", neck=replace(LABORATORY, common_stretch=None))


def test_a_model_with_a_large_residual_or_a_parameter_at_a_bound_is_doubted(angles):
    fitted, _ = records(angles, 3)
    sure = [replace(r, sigma=np.full(len(r.time), np.radians(SIGMA_DEG / 10.0))) for r in fitted]
    linear = identify_records(sure, Rig(), "oe2")
    assert "lacks something" in linear.doubts[0]
    assert not identify_records(fitted, Rig(), "neck", neck=LABORATORY).doubts
    held = replace(linear, covariance=np.diag([1.0, np.nan, 1.0]))
    assert held.doubts[0].startswith("oe2: no uncertainty of b_per_s2 (")
