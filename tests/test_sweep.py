"""What left `make test` is counted by its outcomes, and the README shows the run that the committed file holds."""

from __future__ import annotations

import json

from benchmarks.durations import page
from benchmarks.junit import read_junit
from benchmarks.sweep import BEGIN, END, README, RESULT, summary, with_table

JUNIT = """<?xml version="1.0" encoding="utf-8"?>
<testsuites name="pytest tests"><testsuite name="pytest" errors="1" failures="1" skipped="2" tests="5" time="9.5"
 timestamp="2026-11-27T03:00:00.123456+00:00" hostname="x">
<testcase classname="tests.loop.test_size" name="test_a[1|2]" time="0.5"/>
<testcase classname="tests.loop.test_size" name="test_b" time="2.0"><failure message="no">no</failure></testcase>
<testcase classname="tests.video.test_film" name="test_c" time="0.1"><error message="no">no</error></testcase>
<testcase classname="tests.test_docs" name="test_d" time="0.2"><skipped type="pytest.xfail" message="x"/></testcase>
<testcase classname="tests.test_docs" name="test_e" time="0.0"><skipped type="pytest.skip" message="x"/></testcase>
</testsuite></testsuites>
"""


def _run(tmp_path):
    path = tmp_path / "tests.xml"
    path.write_text(JUNIT)
    return read_junit(path)


def test_a_run_is_summed_up_by_outcome_and_file(tmp_path):
    found = summary(_run(tmp_path), "abc1234")
    assert found == {
        "date": "2026-11-27",
        "commit": "abc1234",
        "passed": 1,
        "failed": 2,
        "xfailed": 1,
        "skipped": 1,
        "seconds": 10,
        "failures": ["tests/loop/test_size.py::test_b", "tests/video/test_film.py::test_c"],
        "seconds_by_file": {
            "tests/loop/test_size.py": 2.5,
            "tests/test_docs.py": 0.2,
            "tests/video/test_film.py": 0.1,
        },
    }
    text = with_table(f"before\n{BEGIN}old\n{END}after\n", found)
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "| 2026-11-27 | abc1234 | 1 | 2 | 1 | 1 | 10 |" in text
    assert "- tests/loop/test_size.py::test_b\n" in text
    assert "old" not in text


def test_durations_are_summed_by_folder_and_the_longest_come_first(tmp_path):
    text = page({"abc1234": _run(tmp_path)})
    assert "| abc1234 | 2026-11-27 03:00 | 5 | 10 | 3 |" in text
    assert "| loop | 2.5 |" in text
    assert "| test_docs | 0.2 |" in text
    assert text.index("::test_b") < text.index("::test_a[1¦2]") < text.index("::test_d")


def test_the_readme_shows_the_committed_result_and_no_other():
    text = README.read_text(encoding="utf-8")
    if RESULT.exists():
        assert text == with_table(text, json.loads(RESULT.read_text(encoding="utf-8")))
    else:
        assert f"{BEGIN}{END}" in text
