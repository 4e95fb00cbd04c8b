"""Every verb of `anglecam neck`: its tables, numbers, figures and help."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from anglecam.neck.correlated import UncertainValue
from anglecam.neck_design.text import with_sigma

FIGURES = {
    "kinematics": {"linkage", "turning"},
    "statics": {"statics"},
    "response": {"step", "series"},
    "design": {"design"},
    "pd": {"pd"},
    "sensitivity": {"sensitivity"},
}


@pytest.mark.parametrize("verb", FIGURES)
def test_each_verb_prints_tables_and_writes_numbers_and_figures(run, tmp_path, verb):
    status, out, err = run(verb, "--out", tmp_path / "made")
    assert (status, err) == (0, "")
    assert "━" in out
    json.loads((tmp_path / "made" / f"{verb}.json").read_text())
    pictures = sorted((tmp_path / "made").glob("*.png"))
    assert {p.stem for p in pictures} == FIGURES[verb]
    assert all(p.read_bytes().startswith(b"\x89PNG") for p in pictures)


def test_json_has_no_rounding_errors_of_the_arithmetic(run):
    out = run("statics", "--json")[1]
    assert '"nod_deg": -15.0,' in out


def test_an_uncertainty_of_rounding_size_counts_as_exact():
    assert with_sigma(UncertainValue(6.0, 1e-14)) == "6"
    assert with_sigma(UncertainValue(6.0, 0.01)) == "6.000 ± 0.010"


def test_help_has_whole_lines(run):
    out = run("--help")[1]
    assert not any(line.rstrip().endswith(("Fig.", "Eq.", "Eqs.")) for line in out.splitlines())
    assert "list[float]" not in run("pd", "--help")[1]


def test_the_installed_command_knows_the_verbs():
    done = subprocess.run(
        [Path(sys.executable).parent / "anglecam", "neck", "--help"], capture_output=True, text=True, check=True
    )
    assert all(verb in done.stdout for verb in (*FIGURES, "power"))
