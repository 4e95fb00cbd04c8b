"""Measuring while filming, from a pipe whose writer waits until something is learnt, and a film played at its rate."""

from __future__ import annotations

import csv
import os
import threading
import time
from contextlib import suppress

import av
import numpy as np
import pytest

from anglecam.data.command import Command
from anglecam.data.series import OK
from anglecam.errors import AnglecamError, RigError
from anglecam.io.rig import Rig, RigFrames, RigMark, RigPivot
from anglecam.io.session import read_session
from anglecam.video.live_source import open_live
from anglecam.workflow import live as workflow
from anglecam.workflow.live import measure_live
from support.drawn import Look, Recording, draw_session

LOOK = Look()
SECONDS, RATE_HZ = 6.0, 30
FIRST = 75
"""Frames that are written at once: enough to learn from."""
PATIENCE_S = 240.0
"""For learning, on a machine that does other things besides."""


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    folder = tmp_path_factory.mktemp("session")
    recordings = [Recording("random", "random", duration_s=SECONDS, rest_s=0.3)]
    return draw_session(folder, look=LOOK, recordings=recordings, seed=2)["random"]


@pytest.fixture(scope="module")
def brief(tmp_path_factory):
    """Draw a film of which less is played than is learnt from."""
    recordings = [Recording("random", "random", duration_s=1.5, rest_s=0.3)]
    return draw_session(tmp_path_factory.mktemp("brief"), look=LOOK, recordings=recordings, seed=2)["random"]


def _rig():
    x, y = LOOK.pivot
    return Rig(pivot=RigPivot(near=(x + 5, y - 4)), mouth=RigMark(rgb=LOOK.lips_rgb))


def _command(truth):
    return Command(truth.command[:, 0], np.radians(truth.command[:, 1]))


class _Writer:
    """Writes a film into a pipe: its first frames, then one now and then until something is learnt, then the rest."""

    def __init__(self, film, pipe) -> None:
        self.learnt = threading.Event()
        os.mkfifo(pipe)
        threading.Thread(target=self._write, args=(film, pipe), daemon=True).start()

    def _write(self, film, pipe) -> None:
        options = {"format": "matroska", "options": {"flush_packets": "1"}}
        with (
            suppress(OSError),
            av.open(str(film)) as source,
            pipe.open("wb") as stream,
            av.open(stream, "w", **options) as target,
        ):
            copy = target.add_stream_from_template(source.streams.video[0])
            began = time.monotonic()
            for number, packet in enumerate(source.demux(video=0)):
                if not packet.size:
                    continue
                if number > FIRST and time.monotonic() - began < PATIENCE_S:
                    self.learnt.wait(1.0)
                    time.sleep(0.02)
                packet.stream = copy
                target.mux(packet)


@pytest.fixture(scope="module")
def lived(truth, tmp_path_factory):
    """Measure the film while a pipe delivers it."""
    folder = tmp_path_factory.mktemp("live")
    writer = _Writer(truth.clip, folder / "head")

    def show(row, cause) -> None:
        if row.status not in ("learning", "late"):
            writer.learnt.set()

    source = open_live(str(folder / "head"))
    return measure_live(source, folder, _rig(), _command(truth), show), folder


def _column(path, name):
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    return np.array([float(row[name] or "nan") for row in rows])


def test_every_frame_is_measured_at_once_or_counted(lived, truth):
    result, folder = lived
    n = len(truth.time_s)
    assert len(result.rows) == len(result.measurement.series.angle) == n
    counted = sum(result.count(status) for status in ("learning", "late", OK))
    assert counted == n
    assert len(result.latencies) == result.count(OK) > 50
    assert (result.latencies > 0.0).all()
    assert (folder / "head.live.csv").read_text().count("\n") == n + 1


def test_at_once_and_afterwards_agree_within_the_stated_uncertainty(lived, truth):
    result, _ = lived
    assert result.disagreement < 1.5
    ok = np.array([row.status == OK for row in result.rows])
    angle, sigma = (np.degrees([getattr(row, name) for row in result.rows])[ok] for name in ("angle", "sigma"))
    off = angle - truth.angle_deg[ok]
    assert np.sqrt(np.mean(((off - np.median(off)) / sigma) ** 2)) < 1.5


def test_the_filter_runs_along(lived):
    result, folder = lived
    last = [row for row in result.rows if row.status == OK][-1]
    assert (np.abs(np.array(last.parameters) - [26.0, 524.0, 508.0]) < 2.5 * np.array(last.parameter_sigmas)).all()
    assert np.allclose(_column(folder / "head.live.csv", "b_per_s2")[last.frame], last.parameters[1], rtol=1e-6)
    shown = _column(folder / "head.live.csv", "b_per_s2_sigma")
    assert shown[last.frame] < 0.9 * np.nanmax(shown)


def test_the_recording_has_the_files_of_measure(lived, truth):
    result, folder = lived
    assert result.film == folder / "head.mkv" or result.film == folder / "head.mov"
    made = {path.name for path in folder.iterdir()}
    assert {"head.angles.csv", "head.png", "head.responses.json", "head.live.csv", "head.live.png"} <= made
    off = _column(folder / "head.angles.csv", "angle_deg") - truth.angle_deg
    sigma = _column(folder / "head.angles.csv", "sigma_deg")
    assert np.sqrt(np.nanmean(((off - np.nanmedian(off)) / sigma) ** 2)) < 1.5
    session = read_session(folder)
    assert [recording.name for recording in session.recordings] == ["head"]
    assert not session.notes


@pytest.mark.sweep  # that a frame is measured or counted is also claimed by the tests before
def test_frames_that_cannot_keep_up_are_counted(truth, tmp_path, monkeypatch):
    writer = _Writer(truth.clip, tmp_path / "head")
    monkeypatch.setattr(workflow, "LATE_S", 0.0)  # every frame is later than that

    def show(row, cause) -> None:
        if row.status != "learning":
            writer.learnt.set()

    result = measure_live(open_live(str(tmp_path / "head")), tmp_path, _rig(), None, show)
    assert result.count("late") > 50
    assert result.count("learning") + result.count("late") == len(truth.time_s)
    assert len(result.latencies) == 0
    assert result.measurement.series.ok.all()  # the recording is whole


def test_where_nothing_is_learnt_the_recording_is_measured(brief, tmp_path):
    causes = []
    rig = Rig(pivot=_rig().pivot, mouth=RigMark(rgb=(20, 250, 20)))
    with pytest.raises(AnglecamError, match=r"random\.avi"):
        measure_live(open_live(str(brief.clip)), tmp_path, rig, None, lambda row, cause: causes.append(cause))
    assert (tmp_path / "random.avi").read_bytes() == brief.clip.read_bytes()
    statuses = (tmp_path / "random.live.csv").read_text()
    assert statuses.count("learning") == len(brief.time_s)
    assert all("random.avi" in cause for cause in causes if cause is not None)


def test_while_nothing_is_learnt_the_cause_is_shown(truth, tmp_path):
    writer, causes = _Writer(truth.clip, tmp_path / "head"), []
    rig = Rig(pivot=_rig().pivot, mouth=RigMark(rgb=(20, 250, 20)))

    def show(row, cause) -> None:
        causes.append(cause)
        if cause is not None:
            writer.learnt.set()

    with pytest.raises(AnglecamError, match="head"):
        measure_live(open_live(str(tmp_path / "head")), tmp_path, rig, None, show)
    assert causes[-1] is not None
    assert "head" in causes[-1]


def test_a_range_of_frames_is_refused(truth, tmp_path):
    rig = Rig(frames=RigFrames.model_validate({"from": 3}))
    with pytest.raises(RigError, match="no end yet"):
        measure_live(open_live(str(truth.clip)), tmp_path, rig, None, lambda *_: None)
