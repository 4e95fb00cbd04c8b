from dataclasses import replace

import numpy as np
import pytest

from anglecam.neck.fourbar import NEUTRAL_SERVO, head_angle, joints, servo_angle
from anglecam.neck.linear import linear_neck, passive_stiffness
from anglecam.neck.parameters import PAPER
from anglecam.neck.sensitivity import FIG_9, figure_9, sensitivities, vary
from anglecam.neck.variation import PARAMETERS, closing_coupler, neutral_head, relinked

FIGURE = figure_9()


def test_figure_9_has_a_curve_for_every_value():
    assert [p.symbol for p in FIGURE.panels] == ["h", "K_m", "G_a", "R_a", "L_6"]
    assert [tuple(c.value for c in p.curves) for p in FIGURE.panels] == list(FIG_9.values())
    assert len(FIGURE.linkages) == len(FIG_9["L_6"])


def test_each_curve_is_equation_28_integrated():
    curve = FIGURE.panels[0].curves[2]
    assert curve.neck.servo.sensor_gain == 1.8
    time, a, b, c = FIGURE.panels[0].time, curve.linear.a, curve.linear.b, curve.linear.c
    damped = np.sqrt(b - a**2 / 4.0)
    sway = np.exp(-a * time / 2.0) * (np.cos(damped * time) + a / 2.0 / damped * np.sin(damped * time))
    np.testing.assert_allclose(curve.angle, c / b * (1.0 - sway), atol=1e-12)


def test_equation_35_ends_the_amplifiers_range_at_113():
    last = -passive_stiffness(PAPER) / (PAPER.gamma * 1.4 * PAPER.servo.torque_gain / 37.0)
    assert last == pytest.approx(113.2, abs=0.1)
    by_gain = {c.value: c for c in FIGURE.panels[2].curves}
    assert [by_gain[g].stable for g in (5.0, 37.0, 100.0, 1000.0)] == [True, True, True, False]
    assert np.isnan(by_gain[1000.0].figures.rise_time)
    assert np.isfinite(by_gain[1000.0].angle).all()
    below, above = vary(PAPER, "G_a", (last - 0.01, last + 0.01), [0.0]).curves
    assert below.stable
    assert not above.stable


def test_a_step_in_torque_constant_moves_the_response_more_than_one_in_feedback_gain():
    # the text to Fig. 9 (a) and (b)
    ranges = [np.ptp([c.figures.steady_state for c in p.curves]) for p in FIGURE.panels[:2]]
    assert ranges[0] == pytest.approx(0.273, abs=1e-3)
    assert ranges[1] == pytest.approx(0.614, abs=1e-3)


@pytest.mark.parametrize("rocker", [0.050, 0.056, 0.059, 0.065])
def test_a_changed_link_closes_at_neutral_and_gamma_follows(rocker):
    made = relinked(PAPER, rocker)
    neutral = neutral_head(PAPER.linkage)
    assert made.linkage.coupler == pytest.approx(closing_coupler(PAPER.linkage, rocker), rel=1e-15)
    assert float(head_angle(made.linkage, NEUTRAL_SERVO)) == pytest.approx(neutral, abs=1e-12)
    assert float(servo_angle(made.linkage, neutral)) == pytest.approx(NEUTRAL_SERVO, abs=1e-9)
    placed = joints(made.linkage, neutral)
    assert np.hypot(*(placed["C"] - placed["D"])) == pytest.approx(made.linkage.coupler, abs=1e-12)
    assert made.spring.arm == rocker
    ends = neutral + np.radians([15.0, -15.0])
    chord = np.diff(ends) / np.diff(servo_angle(made.linkage, ends))
    assert made.gamma == pytest.approx(float(chord[0]), rel=0.1)


def test_the_papers_own_link_gives_the_papers_own_gamma():
    made = relinked(PAPER, 0.059)
    assert made.linkage.coupler == pytest.approx(0.041, abs=1e-15)
    assert made.gamma == pytest.approx(-0.36, abs=1e-3)


def test_panel_f_is_the_four_bar():
    for curve in FIGURE.linkages:
        np.testing.assert_array_equal(curve.theta_f, head_angle(curve.linkage, curve.theta_s))
    np.testing.assert_allclose([c.linkage.rocker for c in FIGURE.linkages], FIG_9["L_6"])


def test_gain_sensitivities_are_those_of_the_formula():
    linear = linear_neck(PAPER)
    result = {s.symbol: s.steady_state for s in sensitivities()}
    active = PAPER.gamma * linear.gain * 1.4 / linear.stiffness
    assert result["h"] == pytest.approx(-active, rel=1e-6)
    assert result["G_a"] == pytest.approx(1.0 - active, rel=1e-6)
    assert result["R_a"] == pytest.approx(-1.0 + active, rel=1e-6)
    assert result["K"] == pytest.approx(-PAPER.spring.rate * 0.048 * 0.059 / linear.stiffness, rel=1e-6)
    assert result["C"] == pytest.approx(0.0, abs=1e-9)
    assert set(result) == set(PARAMETERS)


def test_overshoot_sensitivity_is_that_of_the_damping_ratio():
    linear = linear_neck(PAPER)
    zeta = linear.a / 2.0 / np.sqrt(linear.b)
    by_zeta = -np.pi * zeta / (1.0 - zeta**2) ** 1.5
    result = {s.symbol: s for s in sensitivities(PAPER, ("C", "K"))}
    assert result["C"].overshoot == pytest.approx(by_zeta * 0.15 / linear.damping, rel=1e-6)
    share = PAPER.spring.rate * 0.048 * 0.059 / linear.stiffness
    assert result["K"].overshoot == pytest.approx(-0.5 * by_zeta * share, rel=1e-6)


def test_rise_time_sensitivity_predicts_a_five_per_cent_change():
    (result,) = sensitivities(PAPER, ("C",))
    low, high = (vary(PAPER, "C", (0.15 * f,), [0.0]).curves[0].figures.rise_time for f in (0.975, 1.025))
    assert np.log(high / low) / np.log(1.025 / 0.975) == pytest.approx(result.rise_time, rel=2e-3)


def test_where_there_is_no_sensitivity_there_is_none():
    damped = replace(PAPER, damping=0.5)
    assert np.isnan(sensitivities(damped, ("C",))[0].overshoot)
    with pytest.raises(ValueError, match="unstable"):
        sensitivities(replace(PAPER, servo=replace(PAPER.servo, sensor_gain=5.0)), ("C",))
    with pytest.raises(ValueError, match="no parameter Q"):
        vary(PAPER, "Q", (1.0,), [0.0])
