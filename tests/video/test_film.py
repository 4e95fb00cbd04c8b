"""A short film is decoded once however often a measurement reads it, and nobody else sees what it keeps."""

from __future__ import annotations

import itertools
import threading
import weakref
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.video import film as rereading
from anglecam.video.film import decoded_once, reread
from anglecam.video.frames import read_frames, sample_frames
from support.drawn import Look, draw_frames, write_clip

FILM = Path("film.avi")
BYTES = 1000
"""Of one picture."""


class Picture:
    """What of a decoded picture counts here; it can be asked whether it is still there."""

    planes = (SimpleNamespace(buffer_size=BYTES - 300), SimpleNamespace(buffer_size=300))


class Decoder:
    """Decodes a film of twelve frames, the fourth of which is lost, and counts how often it is asked to."""

    def __init__(self):
        self.asked = 0
        self.pictures = []

    def __call__(self, path):
        self.asked += 1
        for k in range(12):
            picture = None if k == 3 else Picture()
            if picture is not None:
                self.pictures.append(weakref.ref(picture))
            yield k / 30, picture


def test_a_short_film_is_decoded_once_and_gone_when_the_block_ends():
    decode = Decoder()
    with decoded_once():
        first = list(reread(FILM, decode))
        assert all(one is other for one, other in zip(first, reread(FILM, decode), strict=True))
        assert decode.asked == 1
        del first
        list(reread(Path("other.avi"), decode))
        assert decode.asked == 2
        assert all(picture() is not None for picture in decode.pictures)
    assert all(picture() is None for picture in decode.pictures)
    list(reread(FILM, decode))
    assert decode.asked == 3


def test_nothing_of_a_film_that_is_too_long_is_kept(monkeypatch):
    monkeypatch.setattr(rereading, "MOST_BYTES", 10 * BYTES)  # there are eleven pictures
    decode = Decoder()
    with decoded_once():
        for asked in (1, 2, 3):
            assert len(list(reread(FILM, decode))) == 12
            assert decode.asked == asked
            assert all(picture() is None for picture in decode.pictures)


def test_the_limit_holds_for_all_films_of_a_block_together(monkeypatch):
    monkeypatch.setattr(rereading, "MOST_BYTES", 21 * BYTES)
    decode = Decoder()
    with decoded_once():
        for name in ("a", "b", "a", "b"):
            list(reread(Path(name), decode))
    assert decode.asked == 3


def test_a_reading_that_was_broken_off_is_not_taken_for_the_film():
    decode = Decoder()
    with decoded_once():
        assert len(list(itertools.islice(reread(FILM, decode), 5))) == 5
        assert len(list(reread(FILM, decode))) == 12


def test_a_fault_is_told_at_every_reading():
    def decode(path):
        yield 0.0, Picture()
        raise InputError(f"{path}: timestamps do not increase")

    with decoded_once():
        for _ in range(2):
            with pytest.raises(InputError, match="do not increase"):
                list(reread(FILM, decode))


def test_another_thread_has_films_of_its_own():
    decode = Decoder()
    with decoded_once():
        list(reread(FILM, decode))
        other = threading.Thread(target=lambda: list(reread(FILM, decode)))
        other.start()
        other.join()
    assert decode.asked == 2


def test_frames_from_memory_are_those_from_the_file(tmp_path):
    clip = tmp_path / "clip.avi"
    write_clip(clip, draw_frames(Look(), np.arange(8.0)))
    with decoded_once():
        list(read_frames(clip))
        film = clip.read_bytes()
        clip.write_bytes(b"")
        kept = [*read_frames(clip), *read_frames(clip, brightness=True), *sample_frames(clip, 4).frames]
    clip.write_bytes(film)
    again = [*read_frames(clip), *read_frames(clip, brightness=True), *sample_frames(clip, 4).frames]
    assert [(f.index, f.time, f.predicted) for f in kept] == [(f.index, f.time, f.predicted) for f in again]
    for one, other in zip(kept, again, strict=True):
        np.testing.assert_array_equal(one.image, other.image)
