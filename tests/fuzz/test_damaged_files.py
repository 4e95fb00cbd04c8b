"""A short run of `benchmarks/fuzz`: damaged files are read, or refused in one line that names them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from benchmarks.fuzz import clips, texts
from benchmarks.fuzz.trial import FINDING, REFUSED, RESULT, judge

SEED = 7
ONE_OF_EACH = [len(clips.FILMS) * k + k % len(clips.FILMS) for k in range(len(clips.DAMAGES))]
"""Numbers of one clip for every damage; the containers take turns."""


def _judged(generator, numbers: Iterable[int], folder: Path) -> tuple[list[str], dict[str, set[str]]]:
    """Return what was found, and for each kind of damage which outcomes there were."""
    readers, findings, outcomes = generator.readers(), [], {}
    for number in numbers:
        ((_, case),) = generator.cases(1, SEED, first=number)
        path = folder / f"{number}-{case.name}"
        path.write_bytes(case.content)
        outcome = judge(readers[case.reader], path, generator.MOST_BYTES)
        outcomes.setdefault(case.damage, set()).add(outcome.kind)
        if outcome.kind == FINDING:
            findings.append(f"{path.name}, {case.damage}: {outcome.said}")
    return findings, outcomes


@pytest.mark.parametrize("count", [100, pytest.param(250, marks=pytest.mark.sweep)])
def test_damaged_texts_are_read_or_refused_in_one_line(tmp_path, count):
    findings, outcomes = _judged(texts, range(count), tmp_path)
    assert not findings, "\n".join(findings)
    assert set(outcomes) == set(texts.DAMAGES)
    assert set.union(*outcomes.values()) == {RESULT, REFUSED}


@pytest.mark.parametrize(
    "numbers", [ONE_OF_EACH, pytest.param(range(60), marks=pytest.mark.sweep)], ids=["one of each", "60"]
)
def test_damaged_clips_are_measured_or_refused_in_one_line(tmp_path, numbers):
    findings, outcomes = _judged(clips, numbers, tmp_path)
    assert not findings, "\n".join(findings)
    assert set(outcomes) == set(clips.DAMAGES)
    assert set.union(*outcomes.values()) == {RESULT, REFUSED}


def test_a_number_gives_the_same_damage_every_time():
    for generator in (clips, texts):
        again = dict(generator.cases(3, SEED, first=20))
        assert again == {number: case for number, case in generator.cases(40, SEED) if number in again}
