"""`benchmarks/outcomes` on rows made by hand: what is worse, in which order it is shown, and how a run goes on."""

import sys

import pytest

from benchmarks.outcomes import __main__ as command
from benchmarks.outcomes.compare import Factors, changes, same, summary, table
from benchmarks.outcomes.store import read_rows, write_rows

FACTORS = Factors(figure=1.1, cpu=1.5)
RIGHT = {
    "status": "ok",
    "message": "",
    "verdict": "right",
    "ok_share": 1.0,
    "error_deg": 0.10,
    "sigma_deg": 0.1,
    "error_over_sigma": 1.0,
    "film": "f",
    "cpu_s": 10.0,
    "yardstick_s": 0.5,
    "commit": "a",
}
REFUSED = {"status": "refused", "message": "nothing moves", "verdict": "refused", "ok_share": 0.0, "film": "f"}


def compared(before, after):
    return changes({"one": before}, {"one": after}, FACTORS)


def test_worse_comes_first_the_most_serious_before_the_others_and_better_last():
    after = {
        "faster": {**RIGHT, "cpu_s": 2.0},
        "slower": {**RIGHT, "cpu_s": 90.0},
        "fewer rows": {**RIGHT, "ok_share": 0.5},
        "less sure": {**RIGHT, "error_over_sigma": 2.0},
        "less accurate": {**RIGHT, "error_deg": 0.2},
        "least accurate": {**RIGHT, "error_deg": 0.9},
        "refused": REFUSED,
        "wrong": {**RIGHT, "verdict": "wrong"},
        "another film": {**RIGHT, "film": "g"},
    }
    found = changes(dict.fromkeys(after, RIGHT), after, FACTORS)
    assert [change.name for change in found] == [
        "wrong",
        "refused",
        "least accurate",
        "less accurate",
        "less sure",
        "fewer rows",
        "slower",
        "another film",
        "faster",
    ]
    assert [change.worse for change in found] == 7 * [True] + 2 * [False]
    assert [line.split(" | ")[0] for line in table(found).splitlines()[2:]] == 7 * ["| worse"] + ["| "] + ["| better"]


def test_an_answer_where_there_was_none_is_better_and_the_reverse_is_worse():
    (lost,), (won,) = compared(RIGHT, REFUSED), compared(REFUSED, RIGHT)
    assert lost.worse
    assert lost.after == "refused: nothing moves"
    assert won.growth == -lost.growth


@pytest.mark.parametrize("status", ["internal error", "timeout", "died"])
def test_a_row_without_a_truth_is_worse_when_its_process_fails(status):
    unjudged = {key: value for key, value in RIGHT.items() if key != "verdict"}
    (change,) = compared(unjudged, {"status": status, "message": "why"})
    assert (change.kind, change.worse) == ("outcome", True)


@pytest.mark.parametrize(("before", "after", "worse"), [(1.0, 0.5, True), (0.5, 1.9, False), (0.5, 2.5, True)])
def test_error_over_sigma_counts_by_its_distance_from_one(before, after, worse):
    found = compared({**RIGHT, "error_over_sigma": before}, {**RIGHT, "error_over_sigma": after})
    assert any(change.worse for change in found) == worse


def test_changes_within_the_factors_are_not_listed_but_not_called_the_same():
    after = {**RIGHT, "error_deg": 0.105, "cpu_s": 14.0}
    assert compared(RIGHT, after) == []
    assert not same(RIGHT, after)
    assert same(RIGHT, {**RIGHT, "cpu_s": 14.0, "commit": "b", "peak_mib": 7})


def test_cpu_time_counts_against_the_yardstick_of_the_same_process():
    assert compared(RIGHT, {**RIGHT, "cpu_s": 20.0, "yardstick_s": 1.0}) == []
    (change,) = compared(RIGHT, {**RIGHT, "cpu_s": 10.0, "yardstick_s": 0.25})
    assert (change.kind, change.worse) == ("CPU", True)


def test_other_effects_are_listed_and_a_larger_error_on_what_was_held_out_is_worse():
    friction = {"coulomb_friction": {"friction_deg_per_s2": {"value": 340.0, "sigma": 3.0}}}
    before = {"status": "ok", "loop_verdict": "attributed", "effects": friction, "error_deg": 0.1}
    after = {**before, "loop_verdict": "unexplained", "effects": {}, "error_deg": 0.4}
    assert [(change.kind, change.worse) for change in compared(before, after)] == [
        ("error", True),
        ("verdict of the loop", False),
        ("effects", False),
    ]
    larger = {"coulomb_friction": {"friction_deg_per_s2": {"value": 400.0, "sigma": 3.0}}}
    (size,) = compared(before, {**before, "effects": larger})
    assert (size.before, size.after) == ("340", "400")


def test_what_is_not_measured_again_is_counted():
    stored = {"one": RIGHT, "two": RIGHT, "three": RIGHT}
    measured = {"one": RIGHT, "two": REFUSED}
    line = summary("drawn", stored, measured, changes(stored, measured, FACTORS))
    assert line.startswith("drawn: 2 of 3 stored rows measured again, 1 with the same result")
    assert line.endswith("1 worse, 0 better")


@pytest.fixture
def three_films(monkeypatch, tmp_path):
    """Replace the sets by one of three films; return the names in the order in which they are measured."""
    measured, outcome = [], {"a": RIGHT, "b": RIGHT, "c": RIGHT}

    def row_of(one, name, places):
        if outcome[name] is None:
            raise KeyboardInterrupt
        measured.append(name)
        return outcome[name]

    monkeypatch.setattr(command, "SETS", {"drawn": command.Set(lambda places: ["a", "b", "c"], None)})
    monkeypatch.setattr(command, "row_of", row_of)
    monkeypatch.setattr(command, "file_of", lambda name: tmp_path / "stored" / f"{name}.json")
    monkeypatch.setattr(command, "CACHE", tmp_path / "cache")
    monkeypatch.setattr(command, "origin", lambda: {"commit": "b", "date": "today"})
    return measured, outcome


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["outcomes", *arguments])
    return command.main()


def test_a_run_that_is_interrupted_goes_on_where_it_stopped(three_films, monkeypatch):
    measured, outcome = three_films
    outcome["b"] = None
    with pytest.raises(KeyboardInterrupt):
        run(monkeypatch, "--write")
    assert list(read_rows(command.file_of("drawn"))) == ["a"]
    outcome["b"] = REFUSED
    assert run(monkeypatch, "--write") == 0
    assert measured == ["a", "b", "c"]
    rows = read_rows(command.file_of("drawn"))
    assert [row["status"] for row in rows.values()] == ["ok", "refused", "ok"]
    assert {row["commit"] for row in rows.values()} == {"b"}


def test_the_exit_status_says_whether_something_is_worse(three_films, monkeypatch, capsys):
    measured, outcome = three_films
    write_rows(command.file_of("drawn"), {"a": RIGHT, "b": REFUSED})
    assert run(monkeypatch, "--compare") == 0
    assert measured == ["a", "b"]
    assert "| better | b | outcome | refused: nothing moves | right |" in capsys.readouterr().out
    outcome["a"] = REFUSED
    assert run(monkeypatch, "--compare") == 0  # the code is the same, so nothing is measured again
    assert run(monkeypatch, "--compare", "--again") == 1
    assert "| worse | a | outcome | right | refused: nothing moves |" in capsys.readouterr().out
    assert read_rows(command.file_of("drawn"))["a"] == RIGHT
