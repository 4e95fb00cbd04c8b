"""The rows of the paper's design example, its uncertainties against drawing, and what it says when data contradict."""

from dataclasses import replace

import numpy as np
import pytest

from anglecam.neck.correlated import CorrelatedQuantities, UncertainValue, correlated
from anglecam.neck.design import (
    by_inertia,
    by_inertia_and_motor,
    by_motor,
    explained_neck,
    identified,
    known,
    sensor_gain_bound,
)
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import PAPER
from anglecam.neck.step import linear_step_figures

SYS1 = identified(25.9786, 523.7292, 507.5597)
TABLE_5 = replace(PAPER, head=replace(PAPER.head, mass=2.319), damping=0.0532)
KNOWN = known(TABLE_5).replaced(inertia=UncertainValue(0.0058))
"""Table 5 with the film's damping and the rounded inertia that the example uses."""


def test_first_way_gives_the_papers_c3_h_bound_and_negative_c4():
    found = by_inertia(SYS1, KNOWN)
    assert found["torque_gain"].value == pytest.approx(2.944, abs=5e-4)
    assert found["sensor_gain"].value == pytest.approx(1.393, abs=5e-4)
    assert found["sensor_gain_bound"].value == pytest.approx(4.259, abs=5e-4)
    assert found["back_emf_ratio"].value == pytest.approx(-0.092, abs=5e-4)
    assert found.stable


def test_second_way_gives_the_papers_damping_and_spring():
    found = by_inertia_and_motor(SYS1, KNOWN.replaced(sensor_gain=UncertainValue(1.39)))
    assert found["damping"].value == pytest.approx(0.152, abs=5e-4)
    assert found["back_emf_ratio"].value == pytest.approx(1.07e-3, abs=5e-6)
    assert found["spring"].value == pytest.approx(5.32, abs=5e-3)
    assert found.contradictions == ()


def test_table_5_has_a_torque_gain_of_2_930_and_so_c_505():
    assert PAPER.servo.torque_gain == pytest.approx(2.930, abs=5e-4)
    assert PAPER.servo.torque_gain / 0.0058 == pytest.approx(505.0, abs=0.3)
    found = by_inertia_and_motor(SYS1, KNOWN)
    assert found["torque_gain_gap"].value == pytest.approx(2.9438 - 2.9304, abs=2e-4)


def test_sys1_overshoots_by_11_5_per_cent():
    figures = linear_step_figures([507.5597], [1.0, 25.9786, 523.7292])
    assert figures.overshoot == pytest.approx(0.115, abs=5e-4)
    assert figures.rise_time == pytest.approx(0.078, abs=5e-4)
    assert figures.settling_time == pytest.approx(0.26, abs=5e-3)
    assert figures.steady_state == pytest.approx(0.969, abs=5e-4)


def test_a_contradiction_names_constant_cause_and_remedy():
    uncertain = identified(25.9786, 523.7292, 507.5597, (0.5, 5.0, 5.0))
    (result,) = by_inertia(uncertain, KNOWN).contradictions
    assert result == (
        "c4 = −0.0920 ± 0.0029 V·s/rad cannot be negative: C = 0.0532 N·m·s is too small to explain "
        "a = 25.98 ± 0.50 1/s; it takes at least 0.1507 ± 0.0029 N·m·s"
    )
    enough = KNOWN.replaced(damping=UncertainValue(0.1507 + 0.01))
    assert by_inertia(uncertain, enough).contradictions == ()
    nearly = KNOWN.replaced(damping=UncertainValue(0.150, 0.001))
    (result,) = by_inertia(uncertain, nearly).contradictions
    assert "zero lies within two standard uncertainties" in result


def test_every_impossible_constant_is_reported():
    slack = KNOWN.replaced(spring=UncertainValue(1.0), damping=UncertainValue(0.2))
    (result,) = by_inertia(SYS1, slack).contradictions
    assert result.startswith("h = ")
    assert "K·L2·L6 = 1 N·m is too small" in result
    (falls,) = by_inertia(identified(25.0, -3.0, 500.0), KNOWN.replaced(damping=UncertainValue(0.2))).contradictions
    assert "Eq. (35) does not hold" in falls
    sure = KNOWN.replaced(inertia=UncertainValue(0.007, 1e-5))
    (gap,) = by_inertia_and_motor(identified(25.9786, 523.7292, 507.5597, (0.1, 1.0, 1.0)), sure).contradictions
    assert "inertia or motor is not as stated" in gap
    with pytest.raises(ValueError, match="reverse the sign"):
        identified(26.0, 524.0, -508.0)
    with pytest.raises(ValueError, match="positive semidefinite"):
        identified(26.0, 524.0, 508.0, [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(ValueError, match="no quantity Q"):
        known(PAPER, {"Q": 1.0})


@pytest.mark.parametrize(
    "route", [by_inertia, *(pytest.param(r, marks=pytest.mark.sweep) for r in (by_inertia_and_motor, by_motor))]
)
def test_propagated_uncertainty_agrees_with_monte_carlo(route):
    # a, b and c of a fit are correlated; mass and arm are in inertia and weight alike
    sigma, correlation = np.array([0.3, 4.0, 5.0]), np.array([[1.0, 0.5, 0.7], [0.5, 1.0, 0.9], [0.7, 0.9, 1.0]])
    found = identified(26.0, 524.0, 508.0, correlation * np.outer(sigma, sigma))
    sigmas = {"M_h": 0.02, "L": 4e-4, "K": 15.0, "gamma": 0.004, "C": 0.002, "K_m": 3e-5, "R_a": 0.005, "h": 0.01}
    known_before = known(PAPER, sigmas)
    result = route(found, known_before)

    rng = np.random.default_rng(5)
    draws, drawn = 4000, {name: [] for name in result.found}
    abc = rng.multivariate_normal(found.values, found.covariance, draws)
    for i in range(draws):
        error = {s: rng.normal(0.0, u) for s, u in sigmas.items()}
        head = replace(
            PAPER.head, mass=PAPER.head.mass + error["M_h"], centre_of_mass=PAPER.head.centre_of_mass + error["L"]
        )
        servo = replace(
            PAPER.servo,
            motor_constant=PAPER.servo.motor_constant + error["K_m"],
            output_impedance=PAPER.servo.output_impedance + error["R_a"],
            sensor_gain=PAPER.servo.sensor_gain + error["h"],
        )
        neck = replace(
            PAPER,
            head=head,
            servo=servo,
            spring=replace(PAPER.spring, rate=PAPER.spring.rate + error["K"]),
            gamma=PAPER.gamma + error["gamma"],
            damping=PAPER.damping + error["C"],
        )
        once = route(identified(*abc[i]), known(neck))
        for name in drawn:
            drawn[name].append(once[name].value)
    for name, values in drawn.items():
        assert result[name].sigma == pytest.approx(np.std(values), rel=0.05, abs=1e-12), name
        assert result[name].value == pytest.approx(np.mean(values), abs=0.1 * np.std(values) + 1e-12), name


def test_shared_mass_correlates_inertia_and_weight():
    mass_alone = known(PAPER, {"M_h": 0.02})
    i, j = mass_alone.names.index("inertia"), mass_alone.names.index("weight")
    covariance = mass_alone.covariance
    assert covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("route", [by_inertia_and_motor, by_motor])
def test_relations_undo_equation_28(route):
    linear = linear_neck(PAPER)
    result = route(identified(linear.a, linear.b, linear.c), known(PAPER))
    assert result["damping"].value == pytest.approx(PAPER.damping, rel=1e-12)
    assert result["torque_gain"].value == pytest.approx(PAPER.servo.torque_gain, rel=1e-12)
    assert result["spring"].value == pytest.approx(1877.8 * 0.048 * 0.059, rel=1e-12)
    assert result["sensor_gain"].value == pytest.approx(1.4, rel=1e-12)
    assert result["sensor_gain_bound"].value == pytest.approx(sensor_gain_bound(PAPER), rel=1e-12)


def test_at_the_bound_of_equation_35_the_stiffness_is_zero():
    at_bound = replace(PAPER, servo=replace(PAPER.servo, sensor_gain=sensor_gain_bound(PAPER)))
    assert linear_neck(at_bound).stiffness == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("route", [by_inertia_and_motor, by_motor])
def test_the_explained_neck_moves_as_identified(route):
    known_before = known(PAPER)
    neck = explained_neck(route(identified(27.0, 531.0, 505.0), known_before))
    linear = linear_neck(neck)
    assert (linear.a, linear.b, linear.c) == pytest.approx((27.0, 531.0, 505.0), rel=1e-12)
    with pytest.raises(ValueError, match="cannot be negative"):
        explained_neck(by_inertia(SYS1, KNOWN))


def test_derived_quantities_stay_correlated():
    pair = correlated({"x": 2.0, "y": 3.0}, (0.1, 0.2)).derived(lambda q: {"sum": q["x"] + q["y"]})
    difference = pair.derived(lambda q: {"rest": q["sum"] - q["x"] - q["y"]})
    assert difference["rest"].sigma == pytest.approx(0.0, abs=1e-12)
    assert pair["sum"].sigma == pytest.approx(np.hypot(0.1, 0.2), rel=1e-12)
    assert isinstance(pair, CorrelatedQuantities)
    with pytest.raises(ValueError, match="both sets"):
        _ = pair + pair
