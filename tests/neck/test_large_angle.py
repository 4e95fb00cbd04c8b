import math
from dataclasses import replace

import numpy as np
import pytest

from anglecam.neck.fourbar import FourBar, head_angle, servo_angle
from anglecam.neck.large_angle import (
    LargeAngleNeck,
    LinkageRatio,
    acceleration,
    equilibrium,
    holding_voltage,
    linearise,
    torque_balance,
)
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import PAPER
from anglecam.neck.statics import slack_limit
from synth.motion.linkage import transmission
from synth.motion.neck import build_neck
from synth.spec import NeckPlant

EXACT = LinkageRatio(FourBar())
TAUT = 1.25 * slack_limit(PAPER.spring, *EXACT.reach)
NECKS = {
    "constant, single": LargeAngleNeck(),
    "constant, pair": LargeAngleNeck(common_stretch=TAUT),
    "exact, single": LargeAngleNeck(gamma="exact"),
    "exact, pair": LargeAngleNeck(gamma="exact", common_stretch=TAUT),
}
each = pytest.mark.parametrize("neck", NECKS.values(), ids=NECKS)


def test_the_small_angle_limit_with_constant_gamma_is_equation_28():
    expected = linear_neck(PAPER)
    for neck in (NECKS["constant, single"], NECKS["constant, pair"]):
        near = linearise(neck)
        assert (near.a, near.b, near.c) == pytest.approx((expected.a, expected.b, expected.c), rel=1e-12)


def test_the_small_angle_limit_with_the_exact_linkage_is_equation_28_with_its_slope():
    gamma = float(EXACT.slope(0.0))
    assert gamma == pytest.approx(-0.4224, abs=5e-5)
    expected, near = linear_neck(replace(PAPER, gamma=gamma)), linearise(NECKS["exact, pair"])
    assert (near.a, near.b, near.c) == pytest.approx((expected.a, expected.b, expected.c), rel=1e-12)


@each
@pytest.mark.parametrize("delta_deg", [-15.0, -5.0, 0.0, 10.0, 25.0])
def test_equation_33_differentiates_equation_31(neck, delta_deg):
    delta, h = math.radians(delta_deg), 1e-6
    voltage = float(holding_voltage(neck, delta))
    at, step = np.array([0.0, 0.0, delta, voltage]), np.eye(4) * h
    slopes = [float(torque_balance(neck, *(at + e)) - torque_balance(neck, *(at - e))) / (2 * h) for e in step]
    near = linearise(neck, delta)
    np.testing.assert_allclose([near.psi, near.varpi, near.eta, near.phi], slopes, rtol=1e-7, atol=1e-8)


def test_the_feedback_of_equation_33_has_the_sign_of_equation_31():
    neck = NECKS["constant, single"]
    without = replace(neck, parameters=replace(PAPER, servo=replace(PAPER.servo, sensor_gain=0.0)))
    feedback = linearise(neck).eta - linearise(without).eta
    assert feedback == pytest.approx(PAPER.servo.torque_gain * 1.4 * -0.36, rel=1e-12)  # printed: the opposite


@each
def test_the_torque_balance_is_zero_at_the_solved_acceleration(neck):
    delta, omega = np.radians([-20.0, -3.0, 12.0, 29.0]), np.array([3.0, -8.0, 1.0, 0.0])
    alpha = acceleration(neck, delta, omega, 0.2)
    np.testing.assert_allclose(torque_balance(neck, alpha, omega, delta, 0.2), 0.0, atol=1e-14)


@each
def test_the_equilibrium_is_where_the_voltage_holds(neck):
    for delta in np.radians([-8.0, 0.0, 6.0, 20.0]):
        assert equilibrium(neck, float(holding_voltage(neck, delta))) == pytest.approx(delta, abs=1e-9)


def test_the_neck_agrees_with_the_truth_in_the_laboratory():
    neck, truth = NECKS["exact, pair"], build_neck(NeckPlant(kind="neck"), FourBar())
    for delta in np.radians(np.linspace(-23.0, 30.0, 12)):
        for omega in (-9.0, 0.0, 4.0):
            terms = truth.terms(float(delta), omega, 1.0)
            expected = (truth.gain * (0.2 - terms.feedback) + terms.passive) / terms.inertia
            assert acceleration(neck, delta, omega, 0.2) == pytest.approx(expected, abs=1e-9)


def test_the_servos_travel_is_the_integral_of_the_slope():
    inside = np.linspace(EXACT.reach[0] + 1e-3, EXACT.reach[1] - 1e-3, 60)
    truth = transmission(FourBar())
    np.testing.assert_allclose(EXACT.travel(inside), [truth.gathered(float(x)) for x in inside], atol=2e-12)
    h = 1e-5
    slope = (EXACT.travel(inside[5:-5] + h) - EXACT.travel(inside[5:-5] - h)) / (2 * h)
    np.testing.assert_allclose(EXACT.slope(inside[5:-5]), slope, atol=1e-6)
    bend = (EXACT.slope(inside[5:-5] + h) - EXACT.slope(inside[5:-5] - h)) / (2 * h)
    np.testing.assert_allclose(EXACT.bend(inside[5:-5]), bend, rtol=1e-5)


def test_gamma_is_the_slope_of_the_head_over_the_servo():
    delta, h = np.radians([-20.0, 0.0, 20.0]), 1e-6
    crank = servo_angle(FourBar(), EXACT.neutral_rocker - delta)
    slope = (head_angle(FourBar(), crank + h) - head_angle(FourBar(), crank - h)) / (2 * h)
    np.testing.assert_allclose(EXACT.slope(delta), slope, atol=1e-8)


def test_beyond_the_reach_of_the_linkage_there_is_no_acceleration():
    assert np.isnan(acceleration(NECKS["exact, pair"], EXACT.reach[1] + 1e-6, 0.0, 0.0))
    assert np.isnan(EXACT.travel(EXACT.reach[0] - 1e-6))


def test_the_papers_single_spring_cannot_hold_the_head_at_minus_22_degrees():
    with pytest.raises(ValueError, match="nothing balances stably"):
        equilibrium(NECKS["constant, single"], float(holding_voltage(NECKS["constant, pair"], math.radians(-22.0))))


def test_the_linear_gain_is_off_by_degrees_at_large_angles():
    linear = linear_neck(PAPER)
    voltage = math.radians(25.0)
    expected = math.degrees(linear.gain / linear.stiffness * voltage)
    assert expected == pytest.approx(24.1, abs=0.05)
    assert math.degrees(equilibrium(NECKS["constant, single"], voltage)) == pytest.approx(28.2, abs=0.05)
    assert math.degrees(equilibrium(NECKS["exact, pair"], voltage)) == pytest.approx(25.5, abs=0.1)


def test_four_degrees_of_steady_state_error_are_0_21_newton_metres_of_pretension():
    neck, voltage = NECKS["exact, pair"], math.radians(22.0)  # the paper's step, and its remark 2
    for excess, off in ((-0.21, 4.0), (0.21, -4.0)):
        wrong = replace(neck, pretension_error=excess)
        assert math.degrees(equilibrium(wrong, voltage) - equilibrium(neck, voltage)) == pytest.approx(off, abs=0.05)
