"""A film that several processes read gives the same series as one that a single process reads."""

from __future__ import annotations

import dataclasses
import os
import signal

import numpy as np
import pytest

from anglecam.io.rig import Rig, RigPivot
from anglecam.measurement import mark_pass, parallel_reading
from anglecam.measurement.clip import measure_clip
from anglecam.video import film_parts, film_rows
from anglecam.video.from_key import IrregularFilmError
from anglecam.video.open_film import open_film
from support.drawn import Look, draw_frames, write_clip

N = 192
TIME = np.arange(N) / 30
SWING = 14.0 * np.sin(2 * np.pi * 0.7 * TIME) * np.cos(0.4 * TIME)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / "clip.avi"
    write_clip(path, draw_frames(Look(), SWING, TIME, seed=3))
    return path


@pytest.fixture
def readings(monkeypatch):
    """Let the film be too long to be kept, two processes share its parts, and note how it was read."""
    monkeypatch.setattr(film_rows, "MOST_BYTES", 150 * 640 * 480)
    monkeypatch.setattr(film_parts, "LENGTH", 32)
    monkeypatch.setattr(parallel_reading, "FEWEST", 4)
    monkeypatch.setattr(parallel_reading, "PARTS_EACH", 2)
    monkeypatch.setattr(parallel_reading, "native_threads", lambda: 2)
    how = []
    in_parts, alone = parallel_reading.read_in_parts, parallel_reading.read_frames
    monkeypatch.setattr(mark_pass, "read_in_parts", lambda *args: how.append("in parts") or in_parts(*args))
    for module in (mark_pass, parallel_reading):
        monkeypatch.setattr(module, "read_frames", lambda *args: how.append("alone") or alone(*args))
    return how


def _series(clip, progress=None):
    x, y = Look().pivot
    return measure_clip(open_film(clip), Rig(pivot=RigPivot(near=(x + 5, y - 4))), progress=progress).series


@pytest.fixture
def alone(clip, readings, monkeypatch):
    with monkeypatch.context() as one_thread:
        one_thread.setattr(parallel_reading, "native_threads", lambda: 1)
        series = _series(clip)
    assert readings == ["alone"]
    readings.clear()
    return series


def _equals(one, other):
    for field in dataclasses.fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, err_msg=field.name)


def test_two_processes_measure_what_one_does(clip, alone, readings):
    done = []
    together = _series(clip, lambda frames, of: done.append((frames, of)))
    assert readings == ["in parts"]
    assert together.ok.sum() == N
    _equals(together, alone)
    assert done[-1] == (N, N)
    assert done == sorted(done)


def test_where_a_part_is_irregular_one_process_reads_the_film(clip, alone, readings, monkeypatch):
    def irregular(*_):
        raise IrregularFilmError

    monkeypatch.setattr(parallel_reading, "read_part", irregular)
    _equals(_series(clip), alone)
    assert readings == ["in parts", "alone"]


def test_where_a_process_dies_one_process_reads_the_film(clip, alone, readings, monkeypatch):
    this, read = os.getpid(), parallel_reading.read_part

    def die_elsewhere(*args):
        if os.getpid() != this:
            os.kill(os.getpid(), signal.SIGKILL)
        return read(*args)

    monkeypatch.setattr(parallel_reading, "read_part", die_elsewhere)
    _equals(_series(clip), alone)
    assert readings == ["in parts", "alone"]


def test_a_measurement_that_is_stopped_leaves_no_process(clip, readings, monkeypatch):
    pools = []
    start = parallel_reading.ProcessPoolExecutor
    monkeypatch.setattr(
        parallel_reading, "ProcessPoolExecutor", lambda *args, **keys: pools.append(start(*args, **keys)) or pools[-1]
    )

    def stop(frames, of):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _series(clip, stop)
    assert pools
    assert not pools[0]._processes
