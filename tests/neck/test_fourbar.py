import numpy as np
import pytest

from anglecam.neck.fourbar import FourBar, crank_reach, head_angle, joints, reach, servo_angle

PAPER = FourBar()


def test_table_3_follows_from_ground_55_and_coupler_41():
    angles = np.degrees(head_angle(PAPER, np.radians([62.0, 135.0, 216.0])))
    np.testing.assert_allclose(angles, [70.5, 46.8, 20.9], atol=0.05)


def test_the_printed_ground_link_contradicts_table_3():
    printed = FourBar(ground=0.041, coupler=0.041)  # Eqs. (1) and (2) have L3 in both places
    angles = np.degrees(head_angle(printed, np.radians([62.0, 135.0, 216.0])))
    np.testing.assert_allclose(angles, [80.4, 56.6, 25.6], atol=0.05)


@pytest.mark.parametrize("branch", ["open", "crossed"])
def test_the_links_close_over_the_whole_reach_on_every_branch(branch):
    low, high = reach(PAPER)
    upper = np.linspace(low, high, 2001)
    placed = joints(PAPER, np.concatenate([upper, -upper]), branch)
    for first, second, length in (("A", "C", 0.025), ("C", "D", 0.041), ("D", "B", 0.059), ("A", "B", 0.055)):
        np.testing.assert_allclose(np.hypot(*(placed[first] - placed[second]).T), length, rtol=0, atol=1e-12)


def test_the_crossed_crank_is_the_mirror_image_on_the_line_to_the_rocker():
    rocker = np.radians(np.linspace(20.0, 70.0, 51))
    here, there = joints(PAPER, rocker), joints(PAPER, rocker, "crossed")
    np.testing.assert_array_equal(here["D"], there["D"])
    along = here["D"] - here["A"]
    along /= np.hypot(*along.T)[:, None]
    arm = here["C"] - here["A"]
    mirrored = 2 * np.sum(arm * along, axis=1)[:, None] * along - arm
    np.testing.assert_allclose(there["C"] - there["A"], mirrored, rtol=0, atol=1e-12)
    assert np.all(np.hypot(*(here["C"] - there["C"]).T) > 5e-3)


def test_the_crossed_rocker_is_the_open_one_mirrored_on_the_ground_link():
    servo = np.radians(np.linspace(0.0, 360.0, 361))
    np.testing.assert_allclose(head_angle(PAPER, servo, "crossed"), -head_angle(PAPER, -servo), rtol=0, atol=1e-12)


def test_servo_angle_undoes_head_angle():
    servo = np.radians(np.linspace(62.0, 216.0, 155))
    np.testing.assert_allclose(servo_angle(PAPER, head_angle(PAPER, servo)), servo, rtol=0, atol=1e-12)


def test_the_crank_goes_round_on_two_branches_and_the_rocker_stays_on_one():
    servo = np.radians(np.linspace(-83.0, 276.0, 360))
    rocker = head_angle(PAPER, servo)
    working = servo > np.radians(57.6)
    on_open, on_crossed = servo_angle(PAPER, rocker), servo_angle(PAPER, rocker, "crossed")
    np.testing.assert_allclose(np.where(working, on_open, on_crossed), servo, rtol=0, atol=1e-11)
    low, high = reach(PAPER)
    assert np.all((low <= rocker) & (rocker <= high))  # crossed it would be between −high and −low
    taken_apart = -servo[working]
    np.testing.assert_allclose(
        servo_angle(PAPER, head_angle(PAPER, taken_apart, "crossed"), "crossed"), taken_apart, rtol=0, atol=1e-11
    )


def test_a_crank_that_is_too_long_turns_back_where_coupler_and_rocker_are_in_line():
    linkage = FourBar(ground=0.08, coupler=0.04, rocker=0.05, crank=0.03)  # triple rocker: C cannot reach beyond A
    low, high = crank_reach(linkage)
    assert low == 0.0
    assert 0.08**2 + 0.03**2 - 2 * 0.08 * 0.03 * np.cos(high) == pytest.approx(0.09**2)
    head_angle(linkage, [-high, 0.0, high])
    with pytest.raises(ValueError, match="cannot close with the crank"):
        head_angle(linkage, high + 1e-3)
    assert crank_reach(PAPER) == (0.0, np.pi)


def test_beyond_the_reach_the_links_do_not_close():
    low, high = reach(PAPER)
    np.testing.assert_allclose(np.degrees([low, high]), [15.63, 70.65], atol=0.01)
    for angle in (low - 1e-3, high + 1e-3):
        with pytest.raises(ValueError, match="cannot close with the rocker"):
            joints(PAPER, angle)
    with pytest.raises(ValueError, match="cannot close at any angle"):
        reach(FourBar(crank=0.2))
