import math

import numpy as np
import pytest

from anglecam.neck.linear import passive_stiffness
from anglecam.neck.parameters import PAPER
from anglecam.neck.spring import Preload, elongation, large_angle_rate
from anglecam.neck.statics import (
    balanced,
    neutral_angle,
    neutral_torque,
    pretension,
    pretension_angle,
    slack_limit,
    stable_zero,
    static_curve,
    static_torque,
)

REACH = (-0.417, 0.5433)


def test_a_spring_slack_8_6_degrees_below_neutral_balances_the_head():
    theta_p = pretension_angle(PAPER)
    assert 45.0 - math.degrees(theta_p) == pytest.approx(8.63, abs=5e-3)
    assert neutral_torque(PAPER, theta_p) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("common", [None, 0.03])
def test_a_balanced_head_rests_at_neutral_at_large_angles_too(common):
    preload = balanced(PAPER, common=common)
    assert static_torque(PAPER, preload, 0.0) == pytest.approx(0.0, abs=1e-14)
    assert neutral_angle(PAPER, preload) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("common", [None, 0.03])
def test_the_large_angle_torque_at_neutral_is_that_of_equation_24(common):
    for theta_p in np.radians([30.0, 36.0, 44.0]):
        preload = pretension(PAPER, theta_p, common=common)
        assert static_torque(PAPER, preload, 0.0) == pytest.approx(neutral_torque(PAPER, theta_p), abs=1e-14)


def test_excess_pretension_is_the_torque_left_at_neutral():
    assert static_torque(PAPER, balanced(PAPER, common=0.03, excess=0.2), 0.0) == pytest.approx(0.2, abs=1e-14)


def test_pretension_short_by_0_31_newton_metres_lets_the_head_lean_by_four_degrees():
    preload = balanced(PAPER, common=0.0283, excess=-0.31)
    assert math.degrees(neutral_angle(PAPER, preload)) == pytest.approx(4.0, abs=0.1)
    assert math.radians(4.0) * passive_stiffness(PAPER) == pytest.approx(0.31, abs=0.01)


def test_tighter_springs_pull_the_head_back():
    excesses = np.array([-0.2, -0.1, 0.0, 0.1, 0.2])
    rests = [neutral_angle(PAPER, balanced(PAPER, common=0.03, excess=e)) for e in excesses]
    assert np.all(np.diff(rests) < 0)


def test_the_residual_torque_is_equation_25_near_neutral():
    delta = np.radians(np.linspace(-1.0, 1.0, 5))
    curve = static_curve(PAPER, balanced(PAPER, common=0.03), delta)
    np.testing.assert_allclose(curve.residual, curve.small_angle, atol=2e-4)
    assert curve.small_angle[-1] / delta[-1] == pytest.approx(5.318 - 0.801, abs=1e-3)


def test_the_papers_single_spring_gives_way_at_large_downward_angles():
    curve = static_curve(PAPER, balanced(PAPER), np.radians([-25.0, -20.0, 20.0, 25.0]))
    ratio = curve.residual / curve.small_angle
    assert np.all(ratio[:2] < 0.9)
    assert ratio[0] < ratio[1] < ratio[3]


def test_neither_of_two_springs_goes_slack_above_the_limit():
    angles = np.linspace(*REACH, 501)
    preload = balanced(PAPER, common=slack_limit(PAPER.spring, *REACH))
    both = np.stack(
        [preload.behind + elongation(PAPER.spring, angles), preload.before + elongation(PAPER.spring, -angles)]
    )
    assert both.min() == pytest.approx(0.0, abs=1e-12)


def test_stretch_counts_at_the_large_angle_rate():
    carried = large_angle_rate(PAPER.spring) * balanced(PAPER).behind * PAPER.spring.base
    assert carried == pytest.approx(PAPER.head.weight_moment * math.sin(PAPER.head.neutral), rel=1e-12)


def test_a_head_that_nothing_holds_has_no_neutral():
    with pytest.raises(ValueError, match=r"nothing balances stably between -90\.0° and 90\.0°"):
        neutral_angle(PAPER, Preload(-0.5))


def test_of_several_balances_the_stable_one_nearest_to_neutral_counts():
    assert stable_zero(lambda x: np.sin(3 * (x - 0.1)), -3.0, 3.0) == pytest.approx(0.1, abs=1e-12)
