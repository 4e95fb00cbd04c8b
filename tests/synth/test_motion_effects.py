"""Each effect of actuator and load against closed forms."""

import math

import numpy as np
import pytest

from anglecam.neck import FourBar, servo_angle
from support.moved import PLANT, STEP, UNDAMPED, let_go, moved
from synth.effects.coulomb_friction import CoulombFriction, build_friction
from synth.motion.linkage import transmission

B, C = PLANT["b"], PLANT["c"]
RATE = math.sqrt(B)
HALF = math.pi / RATE
"""Half a period of the undamped rig, s."""
SLOW = {"a": 120.0, "b": B, "c": C}
"""Overdamped: it approaches its final angle without overshoot."""
LEVEL = math.radians(15.0)


def test_dry_friction_takes_2_f_over_b_from_every_half_swing_and_then_holds():
    friction, start = 12.0, 0.25
    motion = let_go({"coulomb_friction": {"torque": friction}}, math.degrees(start))
    loss = 2 * friction / B
    swings = int((start - friction / B) // loss) + 1
    turning = motion.angle(0.5 + HALF * np.arange(swings + 1))
    expected = (start - loss * np.arange(swings + 1)) * (-1.0) ** np.arange(swings + 1)
    np.testing.assert_allclose(turning, expected, atol=1e-9)
    stuck = motion.angle(np.linspace(0.5 + swings * HALF + 1e-6, 3.0, 50))
    assert np.ptp(stuck) == 0.0
    assert abs(stuck[0]) <= friction / B


def test_dry_friction_may_differ_between_the_two_directions():
    motion = let_go({"coulomb_friction": {"torque": 12.0, "downward": 5.0}}, math.degrees(0.25))
    first, second = motion.angle(0.5 + HALF * np.array([1, 2]))
    assert first == pytest.approx(-(0.25 - 2 * 5.0 / B), abs=1e-9)  # the first half swing is downwards
    assert second == pytest.approx(-first - 2 * 12.0 / B, abs=1e-9)


def test_a_stuck_head_waits_for_the_breakaway_torque():
    effects = {"coulomb_friction": {"torque": 4.0, "breakaway": 10.0}, "rate_limit": {"r_deg_per_s": 30.0}}
    motion = moved(effects, STEP)
    away = 0.7 + 10.0 / (C * math.radians(30.0))  # the ramp reaches breakaway here
    assert motion.angle(away - 1e-6) == 0.0
    shortly = 1e-3  # from then on 10 − 4 rad/s² are left, and the ramp adds to it
    grown = 6.0 * shortly**2 / 2 + C * math.radians(30.0) * shortly**3 / 6
    assert motion.angle(away + shortly) == pytest.approx(grown, rel=0.02)


def test_stribecks_curve_joins_breakaway_and_sliding():
    effect = CoulombFriction(torque=5, downward=4, breakaway=9, stribeck_deg_per_s=math.degrees(0.1))
    friction = build_friction(effect)
    assert friction.sliding(+1, 1e-9) == pytest.approx(-9.0)
    assert friction.sliding(-1, -1e-9) == pytest.approx(9.0)
    assert friction.sliding(+1, 0.1) == pytest.approx(-5 - 4 / math.e)
    assert friction.sliding(-1, -10.0) == pytest.approx(4.0)
    costs = [friction.sliding(+1, speed) for speed in np.linspace(0, 1, 500)]
    assert (np.diff(costs) >= 0).all()
    assert np.abs(np.diff(costs)).max() < 0.1


def test_a_slow_ramp_through_stribeck_friction_gives_stick_slip():
    effects = {
        "coulomb_friction": {"torque": 4.0, "breakaway": 10.0, "stribeck_deg_per_s": 2.0},
        "rate_limit": {"r_deg_per_s": 5.0},
    }
    motion = moved(effects, STEP, 3.5, plant={**PLANT, "a": 5.0})
    times = np.linspace(0.0, 3.5, 35001)
    stands = motion.speed(times) == 0.0
    stops = np.count_nonzero(np.diff(stands.astype(int)) == 1)
    assert stops >= 3
    angle = motion.angle(times)
    assert (np.diff(angle) >= -1e-12).all()
    # it leaves each stop when the ramp's torque exceeds the breakaway
    leaves = times[1:][np.diff(stands.astype(int)) == -1]
    ramp = np.radians(5.0) * (leaves - 0.7)
    np.testing.assert_allclose(C * ramp - B * motion.angle(leaves), 10.0, atol=0.02)


def test_drag_dissipates_the_energy_of_the_closed_form():
    # on the way down d(ω²)/dθ = −2bθ + 2qω², so that (1 + 2qθ)·e^(−2qθ) is the same at both turning points
    q, start = 2.0, 0.25
    motion = let_go({"quadratic_drag": {"q": q}}, math.degrees(start))
    turned = motion.angle(np.linspace(0.5, 0.8, 60001)).min()

    def kept(theta: float) -> float:
        return (1 + 2 * q * theta) * math.exp(-2 * q * theta)

    assert turned > -0.24
    assert kept(turned) == pytest.approx(kept(start), abs=1e-8)


def test_a_saturated_servo_without_feedback_responds_as_to_a_smaller_step():
    limit = 60.0  # of the 133 rad/s² of 15°
    motion = moved({"torque_saturation": {"limit": limit, "share": 0.0}})
    smaller = moved({}, np.array([[0.0, 0.0], [0.7, math.degrees(limit / C)]]))
    times = np.linspace(0, 3, 1501)
    np.testing.assert_allclose(motion.angle(times), smaller.angle(times), atol=1e-10)


def test_a_saturated_servo_has_constant_torque_until_its_error_is_small_enough():
    limit, a = 60.0, PLANT["a"]
    motion = moved({"torque_saturation": {"limit": limit}})
    since = np.linspace(0, 0.05, 51)
    even = limit / a * (since - (1 - np.exp(-a * since)) / a)
    assert C * LEVEL - B * even[-1] > limit
    np.testing.assert_allclose(motion.angle(0.7 + since), even, atol=1e-11)
    assert motion.angle(3.0) == pytest.approx(C / B * LEVEL, abs=1e-9)


def test_a_dead_zone_leaves_the_head_short_by_its_width():
    width = math.radians(0.8)
    motion = moved({"dead_zone": {"half_width_deg": 0.8}}, until=6.0, plant=SLOW)
    assert motion.angle(6.0) == pytest.approx(C / B * (LEVEL - width), abs=1e-9)
    small = np.array([[0.0, 0.0], [0.7, 0.7]])
    assert np.abs(moved({"dead_zone": {"half_width_deg": 0.8}}, small).angle(np.linspace(0, 3, 99))).max() == 0.0


def test_dead_zone_and_limit_together_give_five_straight_lines():
    effects = {"dead_zone": {"half_width_deg": 0.8}, "torque_saturation": {"limit": 60.0}}
    motion = moved(effects, until=6.0, plant=SLOW)
    since = np.linspace(0, 0.1, 51)
    even = 60.0 / 120.0 * (since - (1 - np.exp(-120.0 * since)) / 120.0)
    np.testing.assert_allclose(motion.angle(0.7 + since), even, atol=1e-11)
    assert motion.angle(6.0) == pytest.approx(C / B * (LEVEL - math.radians(0.8)), abs=1e-9)


def test_a_one_sided_spring_makes_one_half_swing_shorter():
    motion = let_go({"one_sided_spring": {"stiffness": 400.0}}, 12.0)
    above, below = math.pi / math.sqrt(B + 400.0), HALF
    bottom = -math.radians(12.0) * math.sqrt((B + 400.0) / B)
    period = above + below
    times = 0.5 + np.array([above / 2, above / 2 + below / 2, period, 5 * period])
    expected = [0.0, bottom, math.radians(12.0), math.radians(12.0)]
    np.testing.assert_allclose(motion.angle(times), expected, atol=1e-9)


def test_head_and_appendage_swing_in_two_normal_modes():
    share, own = 0.2, 2 * math.pi * 5.0
    effects = {"elastic_coupling": {"frequency_hz": 5.0, "damping_ratio": 0.0, "inertia_share": share}}
    motion = let_go(effects, 12.0)
    # with both angles measured in the room: M = diag(1, s), K from the two springs
    mass = np.diag([1.0, share])
    stiffness = np.array([[B + share * own**2, -share * own**2], [-share * own**2, share * own**2]])
    squares, shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    start = np.linalg.solve(shapes, np.full(2, math.radians(12.0)))
    times = np.linspace(0.5, 3.0, 1001)
    head, tip = shapes @ (start[:, None] * np.cos(np.sqrt(squares)[:, None] * (times - 0.5)))
    np.testing.assert_allclose(motion.angle(times), head, atol=1e-9)
    np.testing.assert_allclose(motion.appendage(times), tip - head, atol=1e-9)


def test_an_appendage_keeps_swinging_on_a_head_that_sticks():
    own, zeta = 2 * math.pi * 5.0, 0.02
    effects = {"elastic_coupling": {"frequency_hz": 5.0}, "coulomb_friction": {"torque": 20.0, "breakaway": 60.0}}
    motion = moved(effects, STEP, 4.0)
    times = np.linspace(2.0, 4.0, 2001)
    assert np.ptp(motion.angle(times)) == 0.0
    psi = motion.appendage(times)
    peaks = np.flatnonzero((psi[1:-1] > psi[:-2]) & (psi[1:-1] > psi[2:])) + 1
    decay = np.log(psi[peaks[0]] / psi[peaks[-1]]) / (times[peaks[-1]] - times[peaks[0]])
    assert psi[peaks[0]] > 1e-3
    assert decay == pytest.approx(zeta * own, rel=0.01)
    assert np.diff(times[peaks]).mean() == pytest.approx(2 * math.pi / (own * math.sqrt(1 - zeta**2)), rel=0.003)


def test_oil_warms_with_time_and_then_damps_less():
    effects = {"time_varying_parameter": {"share": 0.6, "time_s": 1.5}}
    plant = {"a": 4.0, "b": B, "c": C}
    motion = let_go(effects, 15.0, 6.0, plant)
    times = np.linspace(0.5, 6.0, 55001)
    omega, warm = motion.speed(times), motion.state(times)[4]
    np.testing.assert_allclose(warm, 1 - np.exp(-(times - 0.5) / 1.5), atol=1e-6)
    energy = omega**2 / 2 + B * motion.angle(times) ** 2 / 2
    lost = 4.0 * (1 - 0.6 * warm) * omega**2
    taken = np.concatenate([[0.0], np.cumsum((lost[1:] + lost[:-1]) / 2 * np.diff(times))])
    np.testing.assert_allclose(energy + taken, energy[0], rtol=1e-5)
    assert warm[-1] > 0.5


def test_gravity_and_linkage_geometry_conserve_energy():
    effects = {"gravity_geometry": {"strength": 190.0, "gravity_deg": 45.0}, "linkage_geometry": {"share": 0.7}}
    motion = let_go(effects, 14.0, 10.5)
    times = np.linspace(0.5, 10.5, 5001)
    theta, omega = motion.angle(times), motion.speed(times)
    neutral, crank = math.radians(45.0), servo_angle(FourBar(), transmission(FourBar()).neutral_rocker - theta)
    phi = -transmission(FourBar()).neutral_gamma * (crank - math.radians(135.0))
    gravity = np.cos(neutral + theta) + theta * math.sin(neutral) + theta**2 / 2 * math.cos(neutral)
    energy = omega**2 / 2 + B * (0.7 * phi**2 + 0.3 * theta**2) / 2 + 190.0 * gravity
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-7 * B * theta[0] ** 2 / 2)


def test_through_the_linkage_the_head_settles_at_the_commanded_crank_angle():
    plant = {"a": 60.0, "b": C, "c": C}
    motion = moved({"linkage_geometry": {}}, plant=plant)
    through = transmission(FourBar())
    crank = through.at(float(motion.angle(3.0))).crank
    assert -through.neutral_gamma * crank == pytest.approx(LEVEL, abs=1e-9)
    assert math.degrees(motion.angle(3.0)) < 14.8


@pytest.mark.parametrize(
    "effects",
    [
        pytest.param({"linkage_geometry": {"share": 0.6}}, marks=pytest.mark.sweep),
        {"gravity_geometry": {"strength": 190.0, "gravity_deg": 45.0}},
    ],
)
def test_geometry_vanishes_with_the_amplitude_in_the_second_order(effects):
    times = np.linspace(0.7, 2.0, 400)

    def gap(amplitude: float) -> float:
        rows = np.array([[0.0, 0.0], [0.7, amplitude]])
        return float(np.abs(moved(effects, rows).angle(times) - moved({}, rows).angle(times)).max())

    orders = np.log2([gap(a) / gap(a / 2) for a in (0.8, 0.4, 0.2, 0.1)])
    np.testing.assert_allclose(orders, 2.0, atol=0.1)  # small enough for the next order to be negligible


def test_without_effects_nothing_is_added_to_the_undamped_rig():
    times = np.linspace(0.5, 3.0, 301)
    expected = LEVEL * np.cos(RATE * (times - 0.5))
    np.testing.assert_allclose(let_go({}, 15.0, plant=UNDAMPED).angle(times), expected, atol=1e-9)
