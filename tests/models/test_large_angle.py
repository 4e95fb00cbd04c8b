"""The compiled large-angle neck against the laboratory, its small-angle limit, and identifiability."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from anglecam.data.command import Command
from anglecam.models.large_angle import DEFAULT, QUANTITIES, LargeAngle
from anglecam.models.plant import Plant
from anglecam.neck.large_angle import LargeAngleNeck, linearise
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import PAPER
from support.large_angle import COMMANDS, LABORATORY, TIME, command, true_angle

REST = np.zeros(2)
STEP = Command(np.array([0.0, 0.5]), np.array([0.0, math.radians(20.0)]))


@pytest.mark.parametrize("name", ["stairs", "chirp"])
def test_prediction_agrees_with_the_laboratory(name):
    model = LargeAngle(LABORATORY)
    predicted = model.predict(model.nominal, TIME, command(name), REST)
    assert np.degrees(predicted) == pytest.approx(np.degrees(true_angle(name)), abs=5e-5)


def test_the_response_to_small_commands_is_that_of_equation_28():
    linear, small = linear_neck(PAPER), command("chirp", share=1e-4)
    expected = Plant().predict(np.array([linear.a, linear.b, linear.c]), TIME, small, REST)
    for neck in (LargeAngleNeck(), LargeAngleNeck(common_stretch=0.03)):
        predicted = LargeAngle(neck).predict(LargeAngle(neck).nominal, TIME, small, REST)
        assert predicted == pytest.approx(expected, abs=2e-4 * np.max(np.abs(expected)))


def test_parameters_enter_equation_31_at_their_places():
    model = LargeAngle(LABORATORY, tuple(q.name for q in QUANTITIES))
    values = np.array([0.2, 2.5, 1.1, 1500.0, 0.1, 0.7, 0.03])
    neck = model.neck_at(values)
    assert LargeAngle(neck, model.free).nominal == pytest.approx(values, rel=1e-12)
    p, near = neck.parameters, linearise(neck)
    assert near.phi == pytest.approx(-2.5, rel=1e-12)
    assert near.varpi == pytest.approx(0.2 + p.servo.back_emf_damping * neck.ratio.slope(0.0), rel=1e-12)
    assert p.servo.back_emf_damping == LABORATORY.parameters.servo.back_emf_damping
    weight = p.head.weight_moment * math.cos(0.7)
    assert near.eta == pytest.approx(1500.0 * 0.048 * 0.059 - weight + 2.75 * float(neck.ratio.slope(0.0)), rel=1e-9)
    assert model.neck_at(model.nominal).parameters == LABORATORY.parameters


def test_the_command_gain_of_equation_29_scales_the_command():
    neck = replace(LABORATORY, parameters=replace(PAPER, servo=replace(PAPER.servo, command_gain=0.5)))
    double = Command(STEP.time, 2.0 * STEP.angle)
    nominal = LargeAngle(LABORATORY).nominal
    expected = LargeAngle(LABORATORY).predict(nominal, TIME, STEP, REST)
    assert LargeAngle(neck).predict(nominal, TIME, double, REST) == pytest.approx(expected, abs=1e-15)


def test_a_linear_model_gives_the_starting_values():
    model, near = LargeAngle(LABORATORY), linearise(LABORATORY)
    for start in model.starts(np.array([near.a, near.b, near.c])):
        assert start == pytest.approx(model.nominal, rel=1e-9)
    for start in model.starts(np.array([40.0, 300.0, 200.0]))[:2]:
        found = linearise(model.neck_at(start))
        assert (found.a, found.b, found.c) == pytest.approx((40.0, 300.0, 200.0), rel=1e-9)


def test_a_head_driven_beyond_its_linkage_has_no_angle():
    far = Command(STEP.time, np.array([0.0, math.radians(-30.0)]))
    predicted = LargeAngle(LABORATORY).predict(LargeAngle(LABORATORY).nominal, TIME, far, REST)
    assert np.all(np.isfinite(predicted[TIME < 0.5]))
    assert np.all(np.isnan(predicted[TIME > 1.0]))


def test_four_quantities_are_identifiable_at_large_angles_and_three_at_small_angles():
    wide, narrow = singular_values(LABORATORY, 1.0), singular_values(LABORATORY, 0.2)
    constant = singular_values(LargeAngleNeck(common_stretch=LABORATORY.common_stretch), 0.2)
    assert wide[0] / wide[-1] < 150
    assert wide[-1] > 30  # relative uncertainty of the least certain combination below 1/30
    assert narrow[-1] < 2  # not identifiable
    assert constant[-1] < 0.3
    assert narrow[-2] > 20  # the other three are identifiable


def test_an_unknown_quantity_is_reported_with_the_known_ones():
    with pytest.raises(ValueError, match="no quantity 'mass'; choose from damping_nms"):
        LargeAngle(LABORATORY, ("mass",))
    with pytest.raises(ValueError, match="one spring has none"):
        LargeAngle(LargeAngleNeck(), ("common_stretch_m",))


def singular_values(neck: LargeAngleNeck, share: float) -> np.ndarray:
    """Return those of the default set's Jacobian, relative changes over 0.2°, nuisance parameters projected out."""
    model, parts = LargeAngle(neck), []
    p = model.nominal
    for name in COMMANDS:
        asked = command(name, share)

        def angle(parameters: np.ndarray, state: np.ndarray, asked: Command = asked) -> np.ndarray:
            return model.predict(parameters, TIME, asked, state)

        own = [(angle(p, e) - angle(p, -e)) / 2e-4 for e in np.eye(2) * 1e-4]
        shared = [(angle(p + e, REST) - angle(p - e, REST)) / 2e-4 for e in np.diag(p) * 1e-4]
        q, _ = np.linalg.qr(np.column_stack([*own, np.ones(len(TIME))]))
        jacobian = np.column_stack(shared)
        parts.append(jacobian - q @ (q.T @ jacobian))
    assert len(p) == len(DEFAULT)
    return np.linalg.svd(np.vstack(parts) / math.radians(0.2), compute_uv=False)
