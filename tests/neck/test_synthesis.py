"""Necks made to a wish: verified by Eq. (28), by their linkage and by the design relations run backwards."""

import math

import numpy as np
import pytest

from anglecam.neck.constraints import Constraint, least
from anglecam.neck.design import by_inertia_and_motor, identified, known, sensor_gain_bound
from anglecam.neck.fourbar import head_angle, servo_angle
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import PAPER
from anglecam.neck.pd import PdGains, close_loop, linear_plant
from anglecam.neck.pd_tuning import NodTarget
from anglecam.neck.step import linear_step_figures
from anglecam.neck.synthesis import Wish, design_constraints, synthesise


def test_an_adults_nod_is_met_by_spring_link_and_gains():
    wish = Wish(NodTarget())
    made = synthesise(wish)
    assert made.feasible
    assert made.unmet == ()
    linear = linear_neck(made.neck)
    loop = close_loop(linear_plant(linear), made.gains)
    assert loop.figures.rise_time == pytest.approx(0.3, rel=0.0201)
    assert loop.figures.overshoot <= 0.00501
    assert made.neck.servo.sensor_gain < sensor_gain_bound(made.neck)  # Eq. (35)
    assert made.command_gain * made.figures.steady_state == pytest.approx(1.0, rel=1e-9)
    # Eq. (34) backwards: what was put in is what the relations find
    found = by_inertia_and_motor(identified(linear.a, linear.b, linear.c), known(made.neck))
    assert found["damping"].value == pytest.approx(made.neck.damping, rel=1e-9)
    spring = made.neck.spring
    assert found["spring"].value == pytest.approx(spring.rate * spring.base * spring.arm, rel=1e-9)
    # the range is there
    middle = float(head_angle(made.neck.linkage, math.radians(135.0)))
    ends = servo_angle(made.neck.linkage, [middle + wish.down - 1e-9, middle - wish.up + 1e-9])
    np.testing.assert_allclose(head_angle(made.neck.linkage, ends), [middle + wish.down, middle - wish.up], atol=1e-8)
    assert np.ptp(ends) <= math.pi


def test_constraints_are_listed_with_value_limit_and_whether_they_bind():
    made = synthesise(Wish(NodTarget(0.1, 0.02)))
    by_name = {(c.name, c.at_least): c for c in made.constraints}
    assert by_name["overshoot", False].active
    assert by_name["overshoot", False].value == pytest.approx(0.025, abs=1e-4)
    assert by_name["rise time", False].active
    assert not by_name["stiffness with servo, Eq. (35)", True].active
    assert all(c.met for c in made.constraints)


def test_damping_may_take_the_controllers_place():
    made = synthesise(Wish(NodTarget(0.1, 0.05)), free=("K", "L_6", "h", "G_a", "C"))
    assert made.feasible
    assert made.gains == PdGains()
    assert made.changes["C"][1] > 0.15
    assert made.neck.damping == made.changes["C"][1]
    assert made.neck.linkage.coupler != PAPER.linkage.coupler  # L3 closed the chain


def test_a_wish_already_granted_changes_nothing():
    linear = linear_neck(PAPER)
    now = linear_step_figures([linear.c], [1.0, linear.a, linear.b])
    made = synthesise(Wish(NodTarget(now.rise_time, now.overshoot)))
    assert made.feasible
    for before, after in made.changes.values():
        assert after == pytest.approx(before, rel=1e-6, abs=1e-9)


def test_a_range_beyond_the_links_is_named():
    made = synthesise(Wish(NodTarget(0.1, 0.1), up=0.7), free=("K", "L_6", "K_d"))
    assert not made.feasible
    (line,) = (u for u in made.unmet if u.startswith("range upward"))
    assert "≥ 40.11 °" in line
    assert "cannot be met" in line
    (row,) = (c for c in made.constraints if c.name == "range upward")
    assert f"nearest found: {math.degrees(row.value):.4g} °" in line  # the numbers of the table
    assert len(made.unmet) == sum(not c.met for c in made.constraints)


def test_a_rise_faster_than_the_motor_can_is_named():
    made = synthesise(Wish(NodTarget(0.02, 0.0)), free=("h", "K_d"))
    assert not made.feasible
    assert any(line.startswith("rise time ≤ 0.0204 s") for line in made.unmet)


def test_the_papers_servo_cannot_hold_its_head_at_25_degrees():
    rows = design_constraints(Wish(NodTarget(), stall_torque=0.47), PAPER, PdGains())
    assert rows[-1].value == pytest.approx(0.71, abs=5e-3)
    assert not rows[-1].met
    made = synthesise(Wish(NodTarget(), stall_torque=0.47))
    assert made.feasible
    assert made.constraints[-1].active


def test_the_torque_at_the_shaft_is_reported_without_a_limit():
    row = design_constraints(Wish(NodTarget()), PAPER, PdGains())[-1]
    assert row.name == "servo torque at the end (shaft)"
    assert row.value == pytest.approx(0.71, abs=5e-3)
    assert row.met
    assert not row.active


def test_the_papers_links_reach_less_than_25_degrees_down():
    rows = {c.name: c for c in design_constraints(Wish(NodTarget()), PAPER, PdGains())}
    assert math.degrees(rows["range downward"].value) == pytest.approx(23.89, abs=0.01)
    assert math.degrees(rows["range upward"].value) == pytest.approx(31.13, abs=0.01)
    assert math.degrees(rows["pretension angle, Eq. (24)"].value) == pytest.approx(36.4, abs=0.1)


def test_names_of_free_quantities_and_bounds_are_checked():
    with pytest.raises(ValueError, match="Q cannot be free"):
        synthesise(Wish(NodTarget()), free=("Q",))
    with pytest.raises(ValueError, match="nothing is free"):
        synthesise(Wish(NodTarget()), free=())
    with pytest.raises(ValueError, match="bounds are positive"):
        synthesise(Wish(NodTarget()), bounds={"K": (2.0, 1.0)})


def test_the_optimum_of_a_known_problem_is_found():
    # least x² + y² with x·y ≥ 4: (2, 2)
    def evaluate(x):
        return float(x @ x), (Constraint("product", "1", float(x[0] * x[1]), 4.0, True, 1.0),)

    best = least(evaluate, np.array([0.1, 0.1]), np.array([9.0, 9.0]), [np.array([8.0, 1.0])])
    np.testing.assert_allclose(best.at, [2.0, 2.0], atol=1e-4)
    assert best.constraints[0].active


def test_of_two_limits_that_exclude_each_other_both_are_named():
    def evaluate(x):
        return float(x @ x), (
            Constraint("low", "m", float(x[0]), 1.0, False, 1.0),
            Constraint("high", "m", float(x[0]), 2.0, True, 1.0),
            Constraint("free", "m", float(x[0]), 0.0, True, 1.0),
        )

    best = least(evaluate, np.zeros(1), np.full(1, 5.0), [np.zeros(1)])
    assert best.at[0] == pytest.approx(1.5, abs=1e-3)
    assert [line.split()[0] for line in best.unmet] == ["low", "high"]
    assert "low ≤ 1 m cannot be met while all else holds (nearest found: 1.5 m)" in best.unmet[0]
