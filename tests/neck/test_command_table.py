from dataclasses import replace

import numpy as np
import pytest

from anglecam.neck.command_table import (
    FIGURE_13,
    TABLE_3,
    CommandScale,
    command_of_nod,
    command_of_servo,
    nod_limits,
    nod_of_command,
    resolution,
    servo_of_command,
    table_3,
)
from anglecam.neck.fourbar import FourBar, head_angle
from anglecam.neck.transmission import bend, limits

PAPER = FourBar()
ALL = np.arange(255)


def test_table_3_row_by_row():
    rows = table_3(PAPER)
    assert [row.position for row in rows] == ["upward", "neutral", "down"]
    assert [abs(row.counts) for row in rows] == [127, 0, 125]
    assert [row.command for row in rows] == [254, 127, 2]
    np.testing.assert_allclose(np.degrees([row.theta_s for row in rows]), [216.0, 135.0, 62.0], atol=1e-9)
    np.testing.assert_allclose(np.degrees([row.theta_a for row in rows]), [81.0, 0.0, -73.0], atol=1e-9)
    exact = np.degrees([row.theta_f for row in rows])
    np.testing.assert_allclose(exact, [20.9, 46.8, 70.5], atol=0.05)
    np.testing.assert_allclose(exact, [20.0, 45.0, 70.0], atol=1.8)  # as printed
    np.testing.assert_allclose(np.degrees([row.nod for row in rows]), [25.87, 0.0, -23.75], atol=0.005)
    np.testing.assert_allclose([row.nod for row in rows], rows[1].theta_f - np.array([row.theta_f for row in rows]))


def test_the_straight_line_overstates_both_ends_of_table_3():
    up, neutral, down = table_3(PAPER)
    np.testing.assert_allclose(
        np.degrees([row.theta_f_line for row in (up, neutral, down)]), [18.21, 47.10, 73.13], atol=0.005
    )
    assert np.degrees(up.nod_line - up.nod) == pytest.approx(3.01, abs=0.005)
    assert np.degrees(down.nod_line - down.nod) == pytest.approx(-2.28, abs=0.005)


def test_commands_survive_the_way_to_the_servo_and_the_head_and_back():
    for scale in (TABLE_3, FIGURE_13):
        np.testing.assert_array_equal(command_of_servo(servo_of_command(ALL, scale), scale), ALL)
    np.testing.assert_array_equal(command_of_nod(nod_of_command(ALL, PAPER), PAPER), ALL)


def test_a_wanted_nod_is_met_within_half_a_count():
    wanted = np.linspace(*nod_limits(PAPER), 40001)
    command = command_of_nod(wanted, PAPER)
    missed = np.abs(nod_of_command(command, PAPER) - wanted)
    curved = np.abs(bend(PAPER, servo_of_command(ALL))).max() * (TABLE_3.up / 2) ** 2 / 2
    assert np.all(missed <= resolution(command, PAPER) / 2 + curved)
    assert np.degrees(missed.max()) == pytest.approx(0.134, abs=0.001)


def test_a_count_turns_the_head_by_the_slope_times_the_servos_step():
    nods, steps = nod_of_command(ALL, PAPER), resolution(ALL, PAPER)
    away = np.delete(ALL[1:-1], 126)  # at the middle the servo's rate changes
    np.testing.assert_allclose((nods[away + 1] - nods[away - 1]) / 2, steps[away], rtol=2e-3)
    assert np.degrees(resolution(127, PAPER)) == pytest.approx(0.269, abs=5e-4)
    assert np.degrees(resolution(254, PAPER)) == pytest.approx(0.114, abs=5e-4)
    assert np.degrees(resolution(2, PAPER)) == pytest.approx(0.0375, abs=5e-5)


def test_no_single_rate_passes_through_the_three_rows():
    rows = table_3(PAPER)
    command, servo = [row.command for row in rows], np.degrees([row.theta_s for row in rows])
    rate, start = np.polyfit(command, servo, 1)
    assert rate == pytest.approx(0.611, abs=5e-4)
    assert np.abs(rate * np.array(command) + start - servo).max() == pytest.approx(2.26, abs=0.01)


def test_at_figure_13s_rate_table_3s_lowest_command_is_past_the_dead_centre():
    assert np.degrees(FIGURE_13.up) == pytest.approx(180 / 255)
    servo = servo_of_command(2, FIGURE_13)
    assert np.degrees(servo) == pytest.approx(46.8, abs=0.05)
    assert servo < limits(PAPER).crank[0]
    lowest, highest = nod_limits(PAPER, FIGURE_13)
    assert nod_of_command(2, PAPER, FIGURE_13) > lowest  # the head has turned back
    assert lowest == pytest.approx(float(head_angle(PAPER, TABLE_3.neutral)) - limits(PAPER).rocker[1], abs=1e-12)
    assert np.degrees(highest) == pytest.approx(27.29, abs=0.005)


def test_the_limits_themselves_can_be_commanded():
    for scale in (TABLE_3, FIGURE_13):
        low, high = nod_limits(PAPER, scale)
        reached = nod_of_command(command_of_nod([low, high], PAPER, scale), PAPER, scale)
        np.testing.assert_allclose(reached, [low, high], rtol=0, atol=np.radians(0.02))


def test_a_nod_beyond_the_reach_names_itself_and_the_limits():
    with pytest.raises(ValueError, match=r"a nod of 30\.00° is beyond the neck's -23\.81° to 25\.87°"):
        command_of_nod(np.radians([10.0, 30.0]), PAPER)
    with pytest.raises(ValueError, match=r"a nod of -24\.00° is beyond the neck's -23\.89°"):
        command_of_nod(np.radians(-24.0), PAPER, FIGURE_13)
    with pytest.raises(ValueError, match="a nod of nan° is beyond"):
        command_of_nod(np.nan, PAPER)
    with pytest.raises(ValueError, match=r"servo angle 217\.0° is beyond the commands' 60\.8° to 216\.0°"):
        command_of_servo(np.radians(217.0))


@pytest.mark.parametrize("command", [-1, 255, 12.5, np.nan])
def test_only_a_byte_below_255_is_a_command(command):
    with pytest.raises(ValueError, match="is not a whole number from 0 to 254"):
        servo_of_command([127, command])


def test_a_neutral_past_a_dead_centre_has_no_limits():
    with pytest.raises(
        ValueError, match=r"neutral at a servo angle of 50\.0° is not between the dead centres at 57\.5°"
    ):
        nod_limits(PAPER, replace(TABLE_3, neutral=np.radians(50.0)))


def test_a_measured_scale_takes_the_tables_place():
    scale = CommandScale(neutral=np.radians(130.0), up=np.radians(0.6), down=np.radians(0.5))
    np.testing.assert_allclose(np.degrees(servo_of_command([127, 137, 107], scale)), [130.0, 136.0, 120.0])
