"""One line and an exit status for what is wrong in a call, a neck file or a data file."""

from __future__ import annotations

from pathlib import Path

import pytest

VERBS = ("kinematics", "statics", "response", "design", "pd", "sensitivity")
WRONG_CALLS = [
    (("kinematics", "--angle", "40"), "a nod of 40.00° is beyond the neck's"),
    (("design", "--a", "26"), "give all of --a, --b and --c"),
    (("design", "--a", "26", "--b", "524", "--c", "-3"), "c = -3 rad/(s²·V) is not positive"),
    (("design", "--wish-rise", "-1"), "cannot be wanted"),
    (("design", "--wish-rise", "0.3", "--free", "Q"), "Q cannot be free"),
    (("response", "--step", "0"), "a step has a height"),
    (("kinematics", "--angle", "nan"), "not a number"),
    (("pd", "--kp", "nan"), "a gain is a finite number"),
    (("kinematics", "--neck", "nowhere.yaml"), "nowhere.yaml: cannot be read"),
]


@pytest.mark.parametrize(("arguments", "says"), WRONG_CALLS)
def test_a_wrong_call_is_one_line_and_exit_status_2(run, arguments, says):
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert says in err
    assert len(err.splitlines()) == 1


def test_a_wrong_neck_file_is_one_line_that_names_it_and_exit_status_2(run, tmp_path):
    neck = tmp_path / "neck.yaml"
    neck.write_text("spring: {rate: 3}\n")
    for verb in VERBS:
        status, _, err = run(verb, "--neck", neck)
        assert (status, len(err.splitlines())) == (2, 1)
        assert "neck.yaml: unknown key spring.rate" in err
    neck.write_text("linkage: {coupler_m: 0.2}\n")
    status, _, err = run("kinematics", "--neck", neck)
    assert (status, len(err.splitlines())) == (2, 1)
    assert "neck.yaml: the four links cannot close" in err


def test_a_wrong_data_file_is_one_line_and_exit_status_1(run, tmp_path):
    bad = tmp_path / "bad.json"
    bad.write_text("{}")
    calls = [("response", "--model", bad), ("design", "--model", bad), ("pd", "--model", bad), ("pd", "--like", bad)]
    calls += [("power", tmp_path / "none.csv"), ("response", "--measured", tmp_path / "none.angles.csv")]
    for arguments in calls:
        status, out, err = run(*arguments)
        assert (status, out, len(err.splitlines())) == (1, "", 1), err
        assert Path(arguments[-1]).name in err
