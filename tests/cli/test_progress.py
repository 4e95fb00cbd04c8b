"""Whoever waits sees what is going on: every stage has a name, stages come in order, and counts end at their total."""

from __future__ import annotations

import re
import sys
from io import StringIO
from itertools import groupby

import numpy as np
import pytest
from rich.console import Console

from anglecam.batch import progress as batch
from anglecam.batch.records import ClipRecord
from anglecam.batch.row import Row
from anglecam.cli import app, progress
from anglecam.errors import InputError
from anglecam.progress import Stage
from anglecam.workflow.clip import measure_source, open_source
from support import things

SWING_DEG = 20.0 * np.sin(np.arange(60) / 5.0)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return things.film(tmp_path_factory.mktemp("film") / "swing.mkv", things.ball((200, 40, 40), 12.0), SWING_DEG)


def test_measuring_reports_its_stages_in_order_with_their_counts(clip):
    seen: list[Stage] = []
    measure_source(open_source(clip), progress=seen.append)
    assert all(stage.name for stage in seen)
    stages = [list(same) for _, same in groupby(seen, key=lambda stage: stage.name)]
    names = [stage[0].name for stage in stages]
    assert names[:2] == ["reading pictures to learn what moves", "looking whether the camera moves"]
    ordered = [
        names.index(name) for name in ("looking for the mark", "measuring", "working out angles and uncertainties")
    ]
    assert ordered == sorted(ordered)
    assert len(names) - 1 == ordered[-1]
    counts = {stage[0].name: [one.done for one in stage] for stage in stages if stage[-1].done}
    assert counts["reading pictures to learn what moves"] == list(range(61))
    for name, done in counts.items():
        assert done == sorted(done), name
    assert all(one.total is None or one.done <= one.total for one in seen)
    measuring = next(stage for stage in stages if stage[0].name == "measuring")
    assert (measuring[-1].done, measuring[-1].total) == (60, 60)


def test_the_terminal_shows_each_stage_from_loading_to_the_last_file(clip, tmp_path, monkeypatch):
    terminal = Console(file=StringIO(), force_terminal=True, width=120)
    shown = _recorded(monkeypatch, terminal)
    monkeypatch.setattr(sys, "argv", ["anglecam", "measure", str(clip), "--out", str(tmp_path), "--overlay"])
    with pytest.raises(SystemExit) as left:
        app.main()
    assert left.value.code == 0
    titles = list(dict.fromkeys(shown))
    assert titles[0] == "loading"
    assert titles[1] == "swing.mkv: reading pictures to learn what moves"
    assert titles[-3:] == [
        "swing.mkv: writing the series and its plot",
        "swing.mkv: writing the page",
        "swing.mkv: drawing the overlay",
    ]
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", terminal.file.getvalue())
    assert "loading" in text
    assert "drawing the overlay" in text
    assert "0/?" not in text


def test_of_two_clips_of_one_name_the_second_is_refused_before_the_first_is_measured(
    clip, tmp_path, monkeypatch, capfd
):
    second = tmp_path / clip.name
    second.write_bytes(clip.read_bytes())
    said = []

    def open_files(files):
        said.append(capfd.readouterr().err)
        raise InputError(f"{files.path}: not measured")

    monkeypatch.setattr("anglecam.workflow.clip.open_files", open_files)
    monkeypatch.setattr(sys, "argv", ["anglecam", "measure", str(clip), str(second), "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as left:
        app.main()
    assert left.value.code == 1
    assert said == [f"{second}: {clip} has the same name; measure them to separate folders\n"]
    assert capfd.readouterr().err == f"{clip}: not measured\n"


def test_a_batch_shows_what_it_does_before_and_after_its_clips(monkeypatch):
    terminal = Console(file=StringIO(), force_terminal=True, width=160)
    monkeypatch.setattr(batch, "errors", terminal)
    with batch.show_progress(quiet=False) as display:
        display.begin("reading the records of earlier batches")
        display.begin_jobs(3, 1)
        terminal.print("between")  # draws the bars anew
        display.add_clip(ClipRecord("a.avi", Row("a.avi"), "a"), unchanged=False)
        display.begin("writing the index")
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", terminal.file.getvalue())
    assert re.search(r"looking for clips.*measuring.*0 of 3.*writing the index.*1 of 3", text, re.DOTALL)


def _recorded(monkeypatch, terminal: Console) -> list[str]:
    """Show progress on another terminal; return the list of what is shown."""
    shown: list[str] = []
    show = progress._Shown.show

    def record(self, stage: Stage) -> None:
        shown.append(stage.title)
        show(self, stage)

    monkeypatch.setattr(progress, "errors", terminal)
    monkeypatch.setattr(progress._Shown, "show", record)
    return shown
