import math

import numpy as np
import pytest

from anglecam.neck.parameters import PAPER
from anglecam.neck.servo import (
    back_emf,
    drive_torque,
    error_signal,
    gear_torque,
    motor_current,
    motor_speed,
    servo_torque,
    torque_speed,
)

SERVO = PAPER.servo
KG_CM = 9.80665e-2


def test_the_blocks_of_figure_5_give_equation_11():
    voltage, theta, omega, alpha = 0.3, -0.2, 1.7, 40.0
    c3 = 3.3e-3 * 37 / (0.5 / 12)
    left = SERVO.rotor_inertia * alpha + 3.3e-3**2 / ((1 / 12) ** 2 * 0.5) * omega + c3 * 1.4 * theta
    assert servo_torque(SERVO, voltage, theta, omega, alpha) == pytest.approx(c3 * voltage - left, rel=1e-12)


def test_equation_11_holds_the_gear_ratio_squared_only_if_the_motor_turns_faster_than_the_arm():
    omega = 2.0
    error = error_signal(SERVO, 0.0, 0.0)
    geared = gear_torque(SERVO, motor_current(SERVO, error, motor_speed(SERVO, omega)))
    as_printed = gear_torque(SERVO, motor_current(SERVO, error, omega))  # Eq. (10): ω_m = θ̇_a
    assert geared == pytest.approx(-SERVO.back_emf_damping * omega, rel=1e-12)
    assert geared / as_printed == pytest.approx(12.0, rel=1e-12)


def test_equation_12_is_equation_11_with_the_arm_at_gamma_times_the_head():
    motion = (0.1, -2.0, 30.0)
    expected = servo_torque(SERVO, 0.5, *(-0.36 * m for m in motion))
    assert drive_torque(SERVO, -0.36, 0.5, *motion) == pytest.approx(expected, rel=1e-14)


def test_power_balances_without_loss_in_the_gear():
    voltage, omega = 0.4, 5.0
    speed = motor_speed(SERVO, omega)
    current = motor_current(SERVO, error_signal(SERVO, voltage, 0.0), speed)
    assert back_emf(SERVO, speed) * current == pytest.approx(gear_torque(SERVO, current) * omega, rel=1e-14)


def test_table_5_gives_2_930_newton_metres_a_volt_and_so_c_505():
    assert SERVO.torque_gain == pytest.approx(2.930, abs=5e-4)
    assert SERVO.torque_gain / 0.0058 == pytest.approx(505, abs=0.5)


def test_six_volts_stall_at_the_4_8_kg_cm_of_the_hs_225():
    line = torque_speed(SERVO, 6.0 / SERVO.amplifier_gain)
    assert line.stall_torque == pytest.approx(4.8 * KG_CM, rel=0.01)  # 0.475 and 0.471 N·m


def test_no_load_speed_of_table_5_is_sixteen_times_the_data_sheet():
    line = torque_speed(SERVO, 6.0 / SERVO.amplifier_gain)
    assert line.no_load_speed == pytest.approx(151.5, abs=0.1)
    assert line.no_load_speed / (math.pi / 3 / 0.11) == pytest.approx(15.9, abs=0.05)  # 0.11 s for 60°


def test_torque_falls_along_the_line_by_the_back_emf_damping():
    line = torque_speed(SERVO, 0.1)
    omega = np.array([0.0, 10.0, line.no_load_speed])
    np.testing.assert_allclose(line.torque(omega), servo_torque(SERVO, 0.1, 0.0, omega), atol=1e-14)
    assert line.torque(line.no_load_speed) == pytest.approx(0.0, abs=1e-15)
