"""The whole way on a film that the loop has not seen, and what the expectations of all say."""

from pathlib import Path

import pytest

from benchmarks.blind.films import close, film, read_case
from benchmarks.blind.judged import true_values

CASES = sorted(path.parent for path in Path(__file__).parent.glob("*/spec.yaml"))
SMALL = ("0029",)
"""Run every time; a small film with an effect goes the whole way through the command line in tests/test_cli.py."""


@pytest.mark.parametrize("name", SMALL)
def test_a_small_film_gets_the_verdict_that_its_truth_asks_for(name, tmp_path):
    case = read_case(Path(__file__).parent / name)
    film(case, tmp_path / "kept")
    line = close(case, tmp_path / "kept")
    assert line["verdict"] == case.verdict
    assert tuple(line["found"]) == case.effects
    assert line["right"], line["wrong"]


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.name)
def test_expectations_are_what_the_truth_of_the_spec_says(path):
    case = read_case(path)
    values = true_values(case.spec, case.true)
    assert case.effects == tuple(values)
    assert [p["value"] for p in case.parameters] == pytest.approx(list(values.values()), rel=1e-5)
    assert case.verdict == ("attributed" if values else "unexplained" if case.true else "nothing_missing")
