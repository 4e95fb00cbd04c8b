"""The paper's neck: linkage, springs, servo and head at large angles, and the linear model at small angles."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import TransferFunction, lsim

from anglecam.neck import FourBar, head_angle, joints
from support.moved import NECK, let_go, moved
from synth.motion import linear_model
from synth.motion.linkage import transmission
from synth.motion.neck import build_neck
from synth.spec import LinearPlant, NeckPlant

PAPER = NeckPlant(kind="neck")
THROUGH = transmission(FourBar())
SPRINGS = build_neck(PAPER, FourBar()).springs
WITHIN = np.linspace(*THROUGH.reach, 203)[1:-1]


def test_the_linkage_closes_to_a_nanometre_all_along_a_motion():
    motion = moved({}, np.array([[0.0, 0.0], [0.5, 22.0], [1.5, -16.0]]), plant=NECK)
    theta = motion.angle(np.linspace(0, 3, 601))
    assert np.degrees(np.ptp(theta)) > 40
    placed = joints(FourBar(), THROUGH.neutral_rocker - theta)
    crank = THROUGH.neutral_crank + np.array([THROUGH.at(angle).crank for angle in theta.tolist()])
    C = placed["A"] + FourBar().crank * np.stack([np.cos(crank), np.sin(crank)], axis=-1)
    np.testing.assert_allclose(np.hypot(*(C - placed["D"]).T), FourBar().coupler, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*(placed["D"] - placed["B"]).T), FourBar().rocker, atol=1e-9)


def test_gamma_is_the_slope_of_figure_4_at_every_angle():
    h = 1e-4
    crank = THROUGH.neutral_crank + np.array([THROUGH.at(angle).crank for angle in WITHIN])
    f = {k: head_angle(FourBar(), crank + k * h) for k in (-2, -1, 1, 2)}
    slope = (8 * (f[1] - f[-1]) - (f[2] - f[-2])) / (12 * h)
    np.testing.assert_allclose([THROUGH.at(angle).gamma for angle in WITHIN], slope, atol=1e-10)
    assert -0.43 < slope.min() < slope.max() < 0


def test_gammas_slope_and_integral_are_consistent_with_gamma():
    for angle in (-0.4, -0.2, 0.0, 0.3, 0.53):
        h = 1e-4
        around = [THROUGH.at(angle + k * h).gamma for k in (-2, -1, 1, 2)]
        bend = (8 * (around[2] - around[1]) - (around[3] - around[0])) / (12 * h)
        assert THROUGH.at(angle).bend == pytest.approx(bend, rel=1e-7)
        gathered = quad(lambda x: THROUGH.at(x).gamma, 0.0, angle, epsabs=1e-13)[0]
        assert THROUGH.gathered(angle) == pytest.approx(gathered, abs=1e-13)


def test_the_springs_carry_the_head_at_neutral_and_have_the_papers_stiffness():
    carried = PAPER.mass * PAPER.gravity * PAPER.centre_of_mass * math.sin(math.radians(45.0))
    assert SPRINGS.torque(0.0) == pytest.approx(carried, rel=1e-12)
    h = 1e-4
    tangent = (8 * (SPRINGS.torque(h) - SPRINGS.torque(-h)) - SPRINGS.torque(2 * h) + SPRINGS.torque(-2 * h)) / (12 * h)
    assert tangent == pytest.approx(PAPER.spring_rate * PAPER.spring_base * PAPER.spring_arm, rel=1e-9)
    assert tangent == pytest.approx(5.318, abs=5e-4)


def test_neither_spring_goes_slack_within_the_linkages_reach():
    stretched = np.array([SPRINGS.stretched(angle) for angle in WITHIN])
    assert stretched.min() > 0.005
    # the paper's single spring, with its full rate and gravity's stretch, would be slack 9° below neutral
    alone = (SPRINGS.behind - SPRINGS.before) / 2
    slack = [angle for angle in WITHIN if SPRINGS.stretched(angle)[0] - SPRINGS.behind + alone < 0]
    assert math.degrees(max(slack)) == pytest.approx(-8.7, abs=0.3)


def test_without_a_command_the_neck_stays_at_rest():
    motion = moved({}, None, plant=NECK)
    assert np.abs(motion.angle(np.linspace(-1, 3, 400))).max() < 1e-13


def test_the_undamped_neck_keeps_its_energy_over_ten_seconds():
    # a motor with a tiny constant and a large gain has the paper's torque without the motor's damping
    plant = {**NECK, "damping": 0.0, "motor_constant": 3.3e-8, "amplifier_gain": 37e5}
    motion = let_go({}, 15.0, 10.5, plant)
    times = np.linspace(0.5, 10.5, 2001)
    theta, omega = motion.angle(times), motion.speed(times)
    c3 = 3.3e-3 * 37 * 12 / 0.5
    held = np.array([quad(THROUGH.gathered, 0.0, angle, epsabs=1e-13)[0] for angle in theta.tolist()])
    behind, before = np.array([SPRINGS.stretched(angle) for angle in theta.tolist()]).T
    weight = 2.31 * 9.81 * 0.05 * np.cos(math.radians(45.0) + theta)
    stored = c3 * 1.4 * held + SPRINGS.rate * (behind**2 + before**2) / 2 + weight
    energy = 0.00585 * omega**2 / 2 + stored
    swing = 0.00585 * omega.max() ** 2 / 2
    assert swing > 0.05
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-6 * swing)


def test_eq_28_has_the_numbers_of_table_5():
    a, b, c = linear_model(PAPER, FourBar())
    gamma = THROUGH.neutral_gamma
    assert gamma == pytest.approx(-0.4224, abs=1e-4)  # -0.357 is the slope of the straight line over the whole range
    assert c == pytest.approx(2.930 / 0.00585, rel=1e-3)
    assert a == pytest.approx((0.15 + 3.136e-3 * gamma) / 0.00585, rel=1e-3)
    assert b == pytest.approx((2.930 * 1.4 * gamma + 5.318 - 0.801) / 0.00585, rel=1e-3)
    assert linear_model(LinearPlant(a=1, b=2, c=3), FourBar()) == (1, 2, 3)


def test_as_the_amplitude_falls_the_neck_tends_to_eq_28_with_order_2():
    a, b, c = linear_model(PAPER, FourBar())
    times = np.linspace(0.0, 1.0, 2001)
    unit = lsim(TransferFunction([c], [1, a, b]), np.ones(len(times)), times)[1]

    def gap(amplitude_deg: float) -> float:
        motion = moved({}, np.array([[0.0, 0.0], [0.5, amplitude_deg]]), 1.5, plant=NECK)
        return float(np.abs(motion.angle(0.5 + times) - math.radians(amplitude_deg) * unit).max())

    gaps = [gap(amplitude) for amplitude in (2.0, 1.0, 0.5, 0.25, 0.125)]
    np.testing.assert_allclose(np.log2(np.divide(gaps[:-1], gaps[1:])), 2.0, atol=0.1)


def test_the_neck_settles_where_its_torques_balance():
    motion = moved({}, np.array([[0.0, 0.0], [0.5, 18.0]]), 4.0, plant=NECK)
    theta = float(motion.angle(4.0))
    c3 = 3.3e-3 * 37 * 12 / 0.5
    servo = c3 * (math.radians(18.0) - 1.4 * THROUGH.gathered(theta))
    weight = 2.31 * 9.81 * 0.05 * math.sin(math.radians(45.0) + theta)
    assert servo + weight == pytest.approx(SPRINGS.torque(theta), abs=1e-10)


def test_a_necks_servo_torque_stays_within_its_limit():
    limit = 40.0
    motion = moved({"torque_saturation": {"limit": limit}}, np.array([[0.0, 0.0], [0.5, 18.0]]), plant=NECK)
    t = 2e-4
    assert motion.angle(0.5 + t) == pytest.approx(limit * t**2 / 2, rel=2e-3)
    theta = float(motion.angle(3.0))
    weight = 2.31 * 9.81 * 0.05 * math.sin(math.radians(45.0) + theta)
    assert 0.00585 * limit + weight == pytest.approx(SPRINGS.torque(theta), abs=1e-9)


@pytest.mark.parametrize("linkage", [{"crank": 0.02}, {"ground": 0.06}, {"coupler": 0.045}])
def test_other_linkages_move_as_well(linkage):
    angle = moved({}, plant=NECK, rig={"linkage": linkage}).angle(np.linspace(0, 3, 99))
    assert 8 < math.degrees(angle.max()) < 25
