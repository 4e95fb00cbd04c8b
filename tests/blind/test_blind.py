"""One rendered film from pixels to verdict, and the expectations of all cases against their specs."""

from pathlib import Path

import pytest

from benchmarks.blind.films import close, film, read_case
from benchmarks.blind.judged import true_values

CASES = sorted(path.parent for path in Path(__file__).parent.glob("*/spec.yaml"))
SMALL = ("0029",)
"""Filmed in the sweep; `tests/cli/test_app.py` closes the loop on a small film with an effect."""


@pytest.mark.sweep
@pytest.mark.parametrize("name", SMALL)
def test_a_small_film_gets_the_expected_verdict(name, tmp_path):
    case = read_case(Path(__file__).parent / name)
    film(case, tmp_path / "kept")
    line = close(case, tmp_path / "kept")
    assert line["verdict"] == case.verdict
    assert tuple(line["found"]) == case.effects
    assert line["right"], line["wrong"]


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.name)
def test_expectations_agree_with_the_truth_of_the_spec(path):
    case = read_case(path)
    values = true_values(case.spec, case.true)
    assert case.effects == tuple(values)
    assert [p["value"] for p in case.parameters] == pytest.approx(list(values.values()), rel=1e-5)
    assert case.verdict == ("attributed" if values else "unexplained" if case.true else "nothing_missing")
