import numpy as np
import pytest

from anglecam.neck.parameters import HeadParameters
from anglecam.neck.turning import (
    KGF_CM,
    TurningMechanism,
    bearing_torque,
    bearing_torque_mean,
    slider,
    turning_angle,
    turning_range,
    turning_servo_angle,
    turning_slope,
    turning_start_torque,
)

DEFAULT = TurningMechanism()
SWINGING = TurningMechanism(crank=0.026, distance=0.030, travel=np.radians(175.0))  # bearing outside the crank's circle
OFFSET = TurningMechanism(offset=0.004)
SWINGING_OFFSET = TurningMechanism(crank=0.026, distance=0.032, offset=-0.003, travel=np.radians(175.0))
EACH = pytest.mark.parametrize(
    "mechanism", [DEFAULT, SWINGING, OFFSET, SWINGING_OFFSET], ids=["default", "swinging", "offset", "swinging offset"]
)
WEIGHT = 2.31 * 9.80665


def sweep(mechanism, count=721):
    return turning_servo_angle(mechanism, np.linspace(*turning_range(mechanism), count)[1:-1])


def test_a_servos_half_turn_gives_the_papers_sixty_degrees_to_either_side():
    low, high = turning_range(DEFAULT)
    np.testing.assert_allclose(np.degrees([low, high]), [-60.75, 60.75], atol=0.005)
    assert high == pytest.approx(np.arctan(25 / 14), abs=1e-12)
    np.testing.assert_allclose(
        np.degrees(turning_servo_angle(DEFAULT, np.radians([-60.0, 0.0, 60.0]))), [-89.01, 0.0, 89.01], atol=0.005
    )


@EACH
def test_the_chain_closes(mechanism):
    servo = sweep(mechanism)
    phi, x = turning_angle(mechanism, servo), slider(mechanism, servo)
    slot = np.stack([np.cos(phi), np.sin(phi)])
    square = np.stack([-np.sin(phi), np.cos(phi)])
    pin = np.stack([mechanism.distance + mechanism.crank * np.cos(servo), mechanism.crank * np.sin(servo)])
    np.testing.assert_allclose(x * slot + mechanism.offset * square, pin, rtol=0, atol=1e-12)


@EACH
def test_the_servo_angle_undoes_the_turning_angle(mechanism):
    phi = np.linspace(*turning_range(mechanism), 721)
    np.testing.assert_allclose(turning_angle(mechanism, turning_servo_angle(mechanism, phi)), phi, rtol=0, atol=1e-12)


@EACH
def test_the_slope_is_the_derivative_of_the_turning_angle(mechanism):
    servo, h = sweep(mechanism), 1e-4

    def phi(at):
        return turning_angle(mechanism, at)

    difference = (phi(servo - 2 * h) - 8 * phi(servo - h) + 8 * phi(servo + h) - phi(servo + 2 * h)) / (12 * h)
    np.testing.assert_allclose(turning_slope(mechanism, servo), difference, rtol=0, atol=1e-9)


def test_the_default_has_an_even_slope_and_no_dead_centre():
    slopes = turning_slope(DEFAULT, np.radians(np.linspace(-90.0, 90.0, 181)))
    assert slopes.min() == pytest.approx(25 / 39, abs=1e-12)
    assert slopes.max() == pytest.approx(25**2 / (25**2 + 14**2), abs=1e-12)


def test_outside_the_cranks_circle_the_head_turns_back_at_the_dead_centres():
    low, high = turning_range(SWINGING)
    np.testing.assert_allclose([low, high], [-np.arcsin(26 / 30), np.arcsin(26 / 30)], rtol=0, atol=1e-12)
    for mechanism in (SWINGING, SWINGING_OFFSET):
        low, high = turning_range(mechanism)
        ends = turning_servo_angle(mechanism, [low, high])
        np.testing.assert_allclose(turning_slope(mechanism, ends), 0.0, atol=1e-7)
        everywhere = turning_angle(mechanism, np.linspace(-mechanism.travel, mechanism.travel, 100001))
        np.testing.assert_allclose([everywhere.min(), everywhere.max()], [low, high], rtol=0, atol=1e-8)


def test_a_turn_beyond_the_range_names_itself_and_the_limits():
    with pytest.raises(ValueError, match=r"a turn of 65\.00° is beyond the neck's -60\.75° to 60\.75°"):
        turning_servo_angle(DEFAULT, np.radians([0.0, 65.0]))
    with pytest.raises(ValueError, match=r"cannot reach the slot with the servo at 180\.0°"):
        turning_angle(TurningMechanism(offset=0.012), np.pi)


def test_the_bearings_friction_is_that_of_equation_4():
    torque = bearing_torque(WEIGHT, 0.001, 12.7e-3)
    assert torque / KGF_CM == pytest.approx(1.467e-3, abs=5e-7)
    assert torque / KGF_CM == pytest.approx(1.46e-3, rel=0.005)  # as printed


def test_both_forms_of_equation_4_agree_where_their_coefficients_belong_together():
    bore, outside = 12.7e-3, 28.6e-3
    mean = 0.001 * bore / ((bore + outside) / 2)
    by_bore = bearing_torque(WEIGHT, 0.001, bore)
    assert bearing_torque_mean(WEIGHT, mean, bore, outside) == pytest.approx(by_bore, rel=1e-12)
    by_mean = bearing_torque_mean(WEIGHT, 0.001, bore, outside)
    assert by_mean == pytest.approx(WEIGHT * 0.001 * 20.65e-3 / 2, rel=1e-12)


def test_the_total_torque_is_six_times_the_bearings():
    printed = turning_start_torque(1.46e-3 * KGF_CM)
    assert printed / KGF_CM == pytest.approx(0.00876, abs=1e-12)
    assert turning_start_torque(bearing_torque(WEIGHT, 0.001, 12.7e-3)) / KGF_CM == pytest.approx(0.0088, abs=5e-5)


def test_without_springs_the_nod_needs_7_2_kilogram_centimetres_not_9_9():
    head = HeadParameters(mass=2.31, centre_of_mass=0.031, gravity=9.80665)
    assert head.weight_moment / KGF_CM == pytest.approx(7.16, abs=0.005)
    assert abs(head.weight_moment / KGF_CM - 9.9) > 2.7
