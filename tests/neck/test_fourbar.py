import numpy as np
import pytest

from anglecam.neck import FourBar, head_angle, joints, reach, servo_angle, straight_line

PAPER = FourBar()


def test_table_3_follows_from_ground_55_and_coupler_41():
    angles = np.degrees(head_angle(PAPER, np.radians([62.0, 135.0, 216.0])))
    np.testing.assert_allclose(angles, [70.5, 46.8, 20.9], atol=0.05)


def test_the_printed_ground_link_contradicts_table_3():
    printed = FourBar(ground=0.041, coupler=0.041)  # Eqs. (1) and (2) have L3 in both places
    angles = np.degrees(head_angle(printed, np.radians([62.0, 135.0, 216.0])))
    np.testing.assert_allclose(angles, [80.4, 56.6, 25.6], atol=0.05)


def test_figure_4_is_a_straight_line_of_slope_minus_0_357():
    line = straight_line(PAPER, np.radians(60.0), np.radians(220.0))
    assert line.slope == pytest.approx(-0.357, abs=5e-4)
    assert np.degrees(line.intercept) == pytest.approx(95.2, abs=0.05)
    assert line.r_squared == pytest.approx(0.9937, abs=1e-4)


def test_the_links_close_to_a_nanometre_over_the_whole_reach():
    low, high = reach(PAPER)
    placed = joints(PAPER, np.linspace(low, high, 2001))
    for first, second, length in (("A", "C", 0.025), ("C", "D", 0.041), ("D", "B", 0.059), ("A", "B", 0.055)):
        np.testing.assert_allclose(np.hypot(*(placed[first] - placed[second]).T), length, atol=1e-9)


def test_servo_angle_undoes_head_angle():
    servo = np.radians(np.linspace(62.0, 216.0, 155))
    np.testing.assert_allclose(servo_angle(PAPER, head_angle(PAPER, servo)), servo, atol=1e-9)


def test_beyond_the_reach_the_links_do_not_close():
    low, high = reach(PAPER)
    np.testing.assert_allclose(np.degrees([low, high]), [15.63, 70.65], atol=0.01)
    for angle in (low - 1e-3, high + 1e-3):
        with pytest.raises(ValueError, match="cannot close with the rocker"):
            joints(PAPER, angle)
    with pytest.raises(ValueError, match="cannot close at any angle"):
        reach(FourBar(crank=0.2))
