import numpy as np
import pytest
from scipy.integrate import quad

from anglecam.neck.fourbar import FourBar, crank_reach, head_angle, joints, reach, servo_angle
from anglecam.neck.transmission import (
    bend,
    grashof,
    limits,
    slope,
    straight_line,
    transmission_angle,
    worst_transmission_angle,
)
from synth.motion.linkage import transmission

PAPER = FourBar()
CRANK_ROCKER, ROCKER_CRANK = PAPER, FourBar(ground=0.055, coupler=0.041, rocker=0.025, crank=0.059)
DOUBLE_CRANK = FourBar(ground=0.025, coupler=0.059, rocker=0.041, crank=0.055)
DOUBLE_ROCKER = FourBar(ground=0.055, coupler=0.025, rocker=0.041, crank=0.059)
TRIPLE_ROCKER = FourBar(ground=0.08, coupler=0.04, rocker=0.05, crank=0.03)


def test_figure_4_is_a_straight_line_of_slope_minus_0_357():
    line = straight_line(PAPER, np.radians(60.0), np.radians(220.0))
    assert line.slope == pytest.approx(-0.357, abs=5e-4)
    assert np.degrees(line.intercept) == pytest.approx(95.2, abs=0.05)
    assert line.r_squared == pytest.approx(0.9937, abs=1e-4)
    # the paper's own, Fig. 4
    assert line.slope == pytest.approx(-0.36, abs=0.005)
    assert np.degrees(line.intercept) == pytest.approx(95.0, abs=0.5)
    assert line.r_squared == pytest.approx(0.9945, abs=1e-3)


def test_the_printed_ground_link_gives_another_line():
    line = straight_line(FourBar(ground=0.041, coupler=0.041), np.radians(60.0), np.radians(220.0))
    assert line.slope == pytest.approx(-0.389, abs=5e-4)
    assert np.degrees(line.intercept) == pytest.approx(108.6, abs=0.05)
    assert line.r_squared == pytest.approx(0.9955, abs=1e-4)


@pytest.mark.parametrize("branch", ["open", "crossed"])
@pytest.mark.parametrize("linkage", [CRANK_ROCKER, DOUBLE_CRANK], ids=grashof)
def test_the_slope_is_the_derivative_of_the_head_angle(linkage, branch):
    servo, step = np.radians(np.linspace(3.0, 359.0, 357)), 1e-4

    def rocker(at):
        return np.unwrap(head_angle(linkage, at, branch))

    # five points: what they leave out is step⁴/30 of the fifth derivative
    h = step
    first = (rocker(servo - 2 * h) - 8 * rocker(servo - h) + 8 * rocker(servo + h) - rocker(servo + 2 * h)) / (12 * h)
    np.testing.assert_allclose(slope(linkage, servo, branch), first, rtol=0, atol=1e-9)


@pytest.mark.parametrize("branch", ["open", "crossed"])
@pytest.mark.parametrize("linkage", [CRANK_ROCKER, DOUBLE_CRANK], ids=grashof)
def test_the_bend_is_the_derivative_of_the_slope(linkage, branch):
    servo, h = np.radians(np.linspace(3.0, 359.0, 357)), 1e-4
    ahead, behind = slope(linkage, servo + h, branch), slope(linkage, servo - h, branch)
    far_ahead, far_behind = slope(linkage, servo + 2 * h, branch), slope(linkage, servo - 2 * h, branch)
    difference = (far_behind - 8 * behind + 8 * ahead - far_ahead) / (12 * h)
    np.testing.assert_allclose(bend(linkage, servo, branch), difference, rtol=0, atol=1e-9)


def test_slope_and_bend_are_those_of_the_simulated_neck():
    truth = transmission(PAPER)
    for nod in np.radians([-23.0, -10.0, 0.0, 12.0, 25.0]):
        servo = servo_angle(PAPER, truth.neutral_rocker - nod)
        here = truth.at(nod)
        assert slope(PAPER, servo) == pytest.approx(here.gamma, rel=1e-12)
        # there by the head's angle: dγ/dθ = −(dγ/dθ_s)/γ
        assert -bend(PAPER, servo) / slope(PAPER, servo) == pytest.approx(here.bend, rel=1e-10)


def test_the_slope_at_table_3s_angles():
    np.testing.assert_allclose(slope(PAPER, np.radians([62.0, 135.0, 216.0])), [-0.0643, -0.4224, -0.1786], atol=5e-5)


def test_the_slope_sums_up_to_the_heads_travel():
    low, high = np.radians([60.0, 220.0])
    travel = head_angle(PAPER, high) - head_angle(PAPER, low)
    assert quad(lambda servo: slope(PAPER, servo), low, high)[0] == pytest.approx(float(travel), abs=1e-12)


@pytest.mark.parametrize("branch", ["open", "crossed"])
def test_between_its_dead_centres_the_crank_carries_the_rocker_over_its_whole_reach(branch):
    found = limits(PAPER, branch)
    assert found.kind == "crank-rocker"
    np.testing.assert_allclose(np.degrees(found.rocker), [15.63, 70.65], atol=0.005)
    expected = {"open": (57.51, 276.52), "crossed": (-83.48, 57.51)}[branch]
    np.testing.assert_allclose(np.degrees(found.crank), expected, atol=0.005)
    np.testing.assert_allclose(np.sort(head_angle(PAPER, found.crank)), found.rocker, rtol=0, atol=1e-12)
    np.testing.assert_allclose(slope(PAPER, found.crank), 0.0, atol=1e-7)
    inside = np.linspace(*found.crank, 1001)[1:-1]
    assert np.all(slope(PAPER, inside) < 0 if branch == "open" else slope(PAPER, inside) > 0)
    placed = joints(PAPER, np.array(found.rocker), branch)
    crank, coupler = placed["C"] - placed["A"], placed["D"] - placed["C"]
    np.testing.assert_allclose(crank[:, 0] * coupler[:, 1] - crank[:, 1] * coupler[:, 0], 0.0, atol=1e-10)


@pytest.mark.parametrize("branch", ["open", "crossed"])
@pytest.mark.parametrize("linkage", [PAPER, ROCKER_CRANK, DOUBLE_CRANK, DOUBLE_ROCKER, TRIPLE_ROCKER], ids=grashof)
def test_the_limits_of_every_class_are_those_of_a_fine_sweep(linkage, branch):
    found = limits(linkage, branch)
    sweep = np.linspace(*found.rocker, 200001)
    cranks = servo_angle(linkage, sweep, branch)
    np.testing.assert_allclose(found.crank, [cranks.min(), cranks.max()], rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("kind", "linkage"),
    [
        ("crank-rocker", CRANK_ROCKER),
        ("rocker-crank", ROCKER_CRANK),
        ("double-crank", DOUBLE_CRANK),
        ("double-rocker", DOUBLE_ROCKER),
        ("triple-rocker", TRIPLE_ROCKER),
        ("change-point", FourBar(ground=0.05, coupler=0.05, rocker=0.03, crank=0.03)),
    ],
)
def test_grashofs_class_says_which_links_turn_fully(kind, linkage):
    assert grashof(linkage) == kind
    crank_turns, rocker_turns = (
        np.allclose(span(linkage), (0.0, np.pi), rtol=0, atol=1e-7) for span in (crank_reach, reach)
    )
    assert crank_turns == (kind in ("crank-rocker", "double-crank", "change-point"))
    assert rocker_turns == (kind in ("rocker-crank", "double-crank", "change-point"))


@pytest.mark.parametrize("branch", ["open", "crossed"])
def test_the_transmission_angle_is_that_between_the_drawn_links(branch):
    low, high = reach(PAPER)
    rocker = np.linspace(low, high, 301)
    placed = joints(PAPER, rocker, branch)
    coupler, arm = placed["C"] - placed["D"], placed["B"] - placed["D"]
    cosine = np.sum(coupler * arm, axis=1) / (0.041 * 0.059)
    np.testing.assert_allclose(
        transmission_angle(PAPER, servo_angle(PAPER, rocker, branch)), np.arccos(cosine), rtol=0, atol=1e-12
    )


def test_the_paper_neck_transmits_worst_at_the_low_end_of_its_range():
    worst = worst_transmission_angle(PAPER, np.radians(60.0), np.radians(220.0))
    assert np.degrees([worst.theta_s, worst.mu]) == pytest.approx([60.0, 53.36], abs=0.005)
    anywhere = worst_transmission_angle(PAPER, 0.0, 2 * np.pi)
    assert np.degrees(anywhere.mu) == pytest.approx(28.24, abs=0.005)


@pytest.mark.parametrize("linkage", [PAPER, DOUBLE_CRANK], ids=grashof)
def test_no_angle_in_a_range_transmits_worse_than_the_worst(linkage):
    rng = np.random.default_rng(5)
    for low, span in zip(rng.uniform(-7.0, 7.0, 50), rng.uniform(0.0, 7.0, 50), strict=True):
        worst = worst_transmission_angle(linkage, low, low + span)
        sweep = transmission_angle(linkage, np.linspace(low, low + span, 5001))
        off = np.abs(sweep - np.pi / 2).max()
        assert abs(worst.mu - np.pi / 2) == pytest.approx(off, abs=1e-5)
        assert abs(worst.mu - np.pi / 2) >= off - 1e-12
        assert low <= worst.theta_s <= low + span
    with pytest.raises(ValueError, match="is empty"):
        worst_transmission_angle(linkage, 1.0, 0.5)
