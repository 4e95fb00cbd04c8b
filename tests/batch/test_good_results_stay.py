"""Good results stay, whatever goes wrong: in the first batch or in a later one.

Every good file that was there before a trouble is there after it, with equal bytes or as a newer good result; and the
batch after the trouble has the files of one without.
"""

from __future__ import annotations

import contextlib
import shutil

import pytest

from support.batch_trials import (
    MON,
    SHELF,
    STORE,
    TRIALS,
    TUE,
    Call,
    call_batch,
    disk_full,
    good,
    killed_scheduler,
    make_lab,
    only_another_version,
    other_version,
    restored,
    statuses,
)
from support.tiny import results

pytestmark = pytest.mark.usefixtures("measured_here")

HERE = [trial for trial in TRIALS if trial.cause is not only_another_version]
"""`test_dask.py` sees a batch of another version refused before it measures; `benchmarks/batch_trials.py` runs all.

Of those in the sweep, `test_dask.py` also loses a scheduler, and `test_trouble.py` fills a disk."""


def but(*causes):
    """Return the trials, some of those that need processes of their own with the mark of the sweep."""
    return [pytest.param(t, marks=pytest.mark.sweep) if t.cause in causes else t for t in HERE]


@pytest.fixture(scope="module")
def made(tmp_path_factory, measured_here):
    return make_lab(tmp_path_factory.mktemp("stay"))


@pytest.fixture
def lab(made):
    """Give the lab, and bring its folder back to what it was."""
    with restored(made):
        yield made


def assert_says(call, said):
    assert call.status == said.status
    assert len(call.lines) == len(said.lines)
    for line, part in zip(call.lines, said.lines, strict=True):
        assert part in line


@pytest.mark.parametrize(
    "trial", but(killed_scheduler, disk_full, other_version), ids=lambda trial: trial.cause.__name__
)
def test_trouble_in_the_first_batch_costs_only_what_it_concerns(trial, made, tmp_path):
    out = tmp_path / "out"
    with restored(made):
        assert_says(trial.cause(made, out), trial.first)
    expected = {name: {content} for name, content in made.files.items()}
    for name, content in made.newer.items():
        expected[name].add(content)
    assert all(content in expected[name] for name, content in good(out).items())
    assert call_batch(*made.asked, "--jobs", 1, "--out", out, "--retry-failed") == Call(0, ())
    assert results(out) == made.files


@pytest.mark.parametrize(
    "trial", but(killed_scheduler, disk_full, other_version), ids=lambda trial: trial.cause.__name__
)
def test_trouble_in_a_second_batch_leaves_every_good_file(trial, made, tmp_path):
    out = shutil.copytree(made.out, tmp_path / "out")
    with restored(made):
        assert_says(trial.cause(made, out), trial.second)
    before = good(made.out)
    assert good(out) in (before, before | made.newer)
    assert statuses(out) == {name: "stale" if name in trial.stale else "ok" for name in (MON, TUE, SHELF)}
    assert call_batch(*made.asked, "--jobs", 1, "--out", out) == Call(0, ())
    assert results(out) == made.files


def test_results_that_are_stale_are_removed_on_request_only_and_listed(lab, tmp_path, batch_here):
    out = shutil.copytree(lab.out, tmp_path / "out")
    lab.clip.write_text("not a film\n" * 50)
    (lab.folder / "tue" / "b.avi").rename(tmp_path / "b.avi")
    (lab.folder / "tue" / "notes.txt").touch()
    call = batch_here(*lab.asked, "--out", out, "--quiet")
    assert call.returncode == 1
    assert good(out) == good(lab.out)
    call = batch_here(*lab.asked, "--out", out, "--quiet", "--prune")
    assert call.returncode == 1
    cause = "not a readable video file (Invalid data found when processing input)"
    assert call.stdout.splitlines() == [
        f"removed mon/a.angles.csv, mon/a.bodies.json, mon/a.html, mon/a.png, mon/a.thumb.webp: {lab.clip}: {cause}; "
        "the earlier results stay, "
        "but these have changed: clip",
        "removed tue/b.angles.csv, tue/b.bodies.json, tue/b.html, tue/b.png, tue/b.thumb.webp: "
        f"{lab.folder}/tue/b.avi: no such clip any more; its results stay",
    ]
    assert set(good(out)) == {name for name in good(lab.out) if name.startswith("shelf/")}
    with (out / "index.csv").open() as stream:
        assert [line.partition(",")[0] for line in stream] == ["path", str(lab.clip), f"{STORE}/shelf/c.avi"]
    with contextlib.suppress(FileNotFoundError):
        (tmp_path / "b.avi").unlink()
