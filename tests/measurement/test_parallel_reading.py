"""What several processes find in a film is what a single process finds."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

from anglecam.measurement import mark_pass, parallel_reading
from anglecam.measurement.frame_reading import read_frames
from anglecam.measurement.parallel_reading import read_in_parts, readers_for
from anglecam.video import film_parts, film_rows
from anglecam.video.from_key import IrregularFilmError
from anglecam.video.open_film import open_film
from support.films import FADING, rig_of

N = len(FADING.angles_deg)


@pytest.fixture(scope="module")
def patched():
    """Let the film be too long to be kept, and two processes share its parts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(film_rows, "MOST_BYTES", 60 * 640 * 480)
        patch.setattr(film_parts, "LENGTH", 16)
        patch.setattr(parallel_reading, "FEWEST", 4)
        patch.setattr(parallel_reading, "PARTS_EACH", 2)
        patch.setattr(parallel_reading, "native_threads", lambda: 2)
        yield


@pytest.fixture(scope="module")
def clip(films):
    return films.film(FADING)


@pytest.fixture(scope="module")
def found(patched, clip):
    """Return what a sample of the frames shows, and what two processes find in all of them."""
    sought = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mark_pass, "read_in_parts", lambda *args: sought.append(args[2]) or read_in_parts(*args))
        film = open_film(clip)
        detections = mark_pass.detect_mark(film, rig_of(FADING.look))
    assert len(sought) == 1
    assert film.rows.is_read
    assert film.undecodable == 0
    return sought[0], detections


@pytest.fixture(scope="module")
def alone(clip, found):
    film = open_film(clip)
    film.sample(32)
    return read_frames(film, found[0])


@pytest.fixture
def calls(monkeypatch):
    """Note when one process reads the film."""
    made = []
    monkeypatch.setattr(parallel_reading, "read_frames", lambda *args: made.append("alone") or read_frames(*args))
    return made


def _together(clip, sought, progress=None):
    film = open_film(clip)
    with readers_for(film) as readers:
        assert readers is not None
        return read_in_parts(readers, film, sought, progress)


def _equals(one, other):
    for name in ("time", "decoded", "repeated", "interlaced", "begun"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for ours, theirs in zip(one.turns, other.turns, strict=True):
        assert (ours.turn, ours.noise) == (theirs.turn, theirs.noise)
    for ours, theirs in zip(one.regions, other.regions, strict=True):
        np.testing.assert_array_equal([r.centre_px for r in ours], [r.centre_px for r in theirs])


def test_two_processes_find_what_one_does(found, alone):
    _, detections = found
    np.testing.assert_array_equal(detections.time, alone.time)
    np.testing.assert_array_equal([one.turn for one in detections.turns.found], [one.turn for one in alone.turns])
    assert np.isfinite(detections.turns.begun).all()
    assert detections.status.count("ok") == N


def test_progress_ends_with_all_frames(clip, found, alone, calls):
    done = []
    _equals(_together(clip, found[0], done.append), alone)
    assert done[-1] == N
    assert done == sorted(done)
    assert not calls


def test_where_a_part_is_irregular_one_process_reads_the_film(clip, found, alone, calls, monkeypatch):
    def irregular(*_):
        raise IrregularFilmError

    monkeypatch.setattr(parallel_reading, "read_part", irregular)
    _equals(_together(clip, found[0]), alone)
    assert calls == ["alone"]


def test_where_a_process_dies_one_process_reads_the_film(clip, found, alone, calls, monkeypatch):
    this, read = os.getpid(), parallel_reading.read_part

    def die_elsewhere(*args):
        if os.getpid() != this:
            os.kill(os.getpid(), signal.SIGKILL)
        return read(*args)

    monkeypatch.setattr(parallel_reading, "read_part", die_elsewhere)
    _equals(_together(clip, found[0]), alone)
    assert calls == ["alone"]


def test_a_reading_that_is_stopped_leaves_no_process(clip, found):
    def stop(frames):
        raise KeyboardInterrupt

    film = open_film(clip)
    pools = []

    def read():
        with readers_for(film) as readers:
            pools.append(readers.pool)
            read_in_parts(readers, film, found[0], stop)

    with pytest.raises(KeyboardInterrupt):
        read()
    assert not pools[0]._processes


def test_one_thread_reads_alone(clip, patched, monkeypatch):
    monkeypatch.setattr(parallel_reading, "native_threads", lambda: 1)
    with readers_for(open_film(clip)) as readers:
        assert readers is None
