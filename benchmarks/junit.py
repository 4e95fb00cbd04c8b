"""Reads what a run of the tests took from the JUnit file that pytest writes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

OUTCOMES = ("passed", "failed", "xfailed", "skipped")


@dataclass(frozen=True)
class Timed:
    """One test of a run."""

    name: str
    """``tests/loop/test_size.py::test_name[case]``."""
    seconds: float
    """Time of the call and of the fixtures that were set up for it, which includes fixtures that later tests share."""
    outcome: str
    """One of `OUTCOMES`."""

    @property
    def folder(self) -> str:
        """Folder below ``tests``, or the file's name at the top level."""
        return self.name.split("::")[0].split("/")[1].removesuffix(".py")


@dataclass(frozen=True)
class Run:
    """One run of pytest."""

    began: str
    """Date and time, ISO 8601."""
    seconds: float
    """From start to end; less than the sum over the tests if several processes ran them."""
    tests: tuple[Timed, ...]

    def counts(self) -> dict[str, int]:
        """Return the number of tests of each outcome."""
        found = Counter(test.outcome for test in self.tests)
        return {outcome: found[outcome] for outcome in OUTCOMES}


def read_junit(path: Path) -> Run:
    """Read a file of ``pytest --junitxml``.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    Run
        Its tests, the slowest first.
    """
    suite = next(ElementTree.parse(path).iter("testsuite"))
    tests = [
        Timed(_name(case.attrib["classname"], case.attrib["name"]), float(case.attrib["time"]), _outcome(case))
        for case in suite.iter("testcase")
    ]
    ordered = tuple(sorted(tests, key=lambda test: -test.seconds))
    return Run(suite.attrib["timestamp"][:16], float(suite.attrib["time"]), ordered)


def seconds_by(keys: Sequence[str], tests: Sequence[Timed]) -> dict[str, float]:
    """Return the sum of the tests' seconds for each key, one key a test, the largest sum first."""
    sums = dict.fromkeys(keys, 0.0)
    for key, test in zip(keys, tests, strict=True):
        sums[key] += test.seconds
    return dict(sorted(sums.items(), key=lambda item: -item[1]))


def _name(classname: str, name: str) -> str:
    return f"{classname.replace('.', '/')}.py::{name}"


def _outcome(case: ElementTree.Element) -> str:
    if case.find("failure") is not None or case.find("error") is not None:
        return "failed"
    skipped = case.find("skipped")
    if skipped is None:
        return "passed"
    return "xfailed" if skipped.attrib.get("type") == "pytest.xfail" else "skipped"
