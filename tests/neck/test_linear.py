from dataclasses import replace

import pytest

from anglecam.neck.damping import OilFilm
from anglecam.neck.head import head_acceleration
from anglecam.neck.linear import linear_neck, passive_stiffness
from anglecam.neck.parameters import PAPER
from anglecam.neck.servo import drive_torque
from anglecam.neck.spring import small_angle_torque
from anglecam.neck.statics import pretension_angle


def test_k_l2_l6_and_the_weight_leave_a_passive_stiffness_of_4_517():
    assert passive_stiffness(PAPER) == pytest.approx(5.318 - 0.801, abs=1e-3)


def test_start_of_the_papers_filter_follows_from_rounded_figures():
    inertia, damping, stiffness = 0.01, 0.05, 5.31  # as the paper rounds J, C of the oil film and K·L2·L6
    assert (damping / inertia, stiffness / inertia, 1 / inertia) == pytest.approx((5, 531, 100))
    assert OilFilm().damping == pytest.approx(damping, abs=0.005)
    assert small_angle_torque(PAPER.spring, 1.0) == pytest.approx(stiffness, abs=0.01)


def test_table_5_comes_close_to_the_identified_a_b_and_c():
    neck = linear_neck(PAPER)
    assert (neck.a, neck.b, neck.c) == pytest.approx((25.9786, 523.7292, 507.5597), rel=0.021)
    assert (neck.a, neck.b, neck.c) == pytest.approx((25.45, 519.6, 500.9), abs=0.05)


def test_equation_28_is_12_16_18a_and_22_put_together():
    neck, delta, omega, alpha = linear_neck(PAPER), 1e-6, 3e-5, 2e-3
    voltage = (neck.inertia * alpha + neck.damping * omega + neck.stiffness * delta) / neck.gain
    torque = drive_torque(PAPER.servo, PAPER.gamma, voltage, delta, omega, alpha)
    carried = small_angle_torque(PAPER.spring, PAPER.head.neutral - pretension_angle(PAPER) + delta)
    resisting = PAPER.damping * omega + carried
    assert head_acceleration(PAPER.head, PAPER.head.neutral + delta, resisting, torque) == pytest.approx(
        alpha, rel=1e-6
    )


def test_the_feedback_gain_of_1_39_keeps_the_neck_stable_and_4_26_does_not():
    # notes on Eqs. (34)-(35): h < 4.26 with c3 = c·J = 2.944
    unstable = replace(PAPER, servo=replace(PAPER.servo, sensor_gain=4.30))
    assert linear_neck(PAPER).stiffness > 0 > linear_neck(unstable).stiffness
