"""A short film is decoded once however often it is read, and the pictures are released with it."""

from __future__ import annotations

import itertools
import weakref
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.rig import RigFrames
from anglecam.video import decode as decode_module
from anglecam.video import film_rows, row_cache
from anglecam.video import picture as picture_module
from anglecam.video.display import Display
from anglecam.video.film import Film
from anglecam.video.film_rows import FilmRows
from anglecam.video.open_film import open_film
from support.drawn import Look, draw_frames, write_clip
from support.encoded import encode

BYTES = 1000
"""Of one picture."""


class Picture:
    """A decoded picture as far as it counts here; a weak reference shows whether it still exists."""

    planes = (SimpleNamespace(buffer_size=BYTES - 300), SimpleNamespace(buffer_size=300))
    pict_type = None
    interlaced_frame = False
    format = SimpleNamespace(name="bgr0")


class Decoder:
    """Decodes a film of twelve frames, the fourth of which is lost, and counts how often it is called."""

    def __init__(self):
        self.calls = 0
        self.pictures = []

    def __call__(self, wants):
        self.calls += 1
        for k in range(12):
            picture = None if k == 3 else Picture()
            if picture is not None:
                self.pictures.append(weakref.ref(picture))
            yield k / 30, picture


@pytest.fixture
def decoder(monkeypatch):
    decoder = Decoder()
    monkeypatch.setattr(picture_module, "to_colours", lambda picture: np.zeros((2, 2, 3), np.uint8))
    return decoder


def new_film(decode, **wanted):
    display = Display((2, 2))
    frames = RigFrames.model_validate(wanted)
    path = Path("film.avi")
    return Film(path, display, 12, "ffv1", coarse_colour=False, cut_short=False, rows=FilmRows(path, decode, frames))


def test_a_short_film_is_decoded_once_and_its_pictures_are_released_with_it(decoder):
    film = new_film(decoder)
    for _ in range(2):
        assert [frame.index for frame in film.frames()] == list(range(12))
    assert film.sample(4).count == 12
    assert decoder.calls == 1
    assert all(picture() is not None for picture in decoder.pictures)
    del film
    assert all(picture() is None for picture in decoder.pictures)


def test_a_long_film_is_decoded_at_every_reading_and_evenly_spaced_pictures_are_kept(decoder, monkeypatch):
    monkeypatch.setattr(film_rows, "MOST_BYTES", 10 * BYTES)  # there are eleven pictures
    monkeypatch.setattr(film_rows, "_FEWEST", 4)
    film = new_film(decoder)
    for calls in (1, 2, 3):
        assert len(list(film.frames())) == 12
        assert decoder.calls == calls
        in_memory = [picture() is not None for picture in decoder.pictures]
        assert in_memory == [k in (0, 2, 3, 5, 7, 9) for k in range(11)] + [False] * 11 * (calls - 1)  # row 3 has none


@pytest.mark.parametrize(("room", "most", "calls"), [(11, 12, 1), (10, 12, 2), (11, 11, 2), (0, 12, 2)])
def test_a_long_film_that_had_to_be_decoded_to_be_sampled_is_kept_as_far_as_memory_is_free(
    decoder, monkeypatch, room, most, calls
):
    monkeypatch.setattr(film_rows, "MOST_BYTES", 10 * BYTES)
    monkeypatch.setattr(film_rows, "_FEWEST", 4)
    monkeypatch.setattr(film_rows, "cache_room", lambda: room * BYTES)  # there are eleven pictures in twelve rows
    monkeypatch.setattr(row_cache, "MOST_ROWS", most)
    film = new_film(decoder)
    assert [frame.index for frame in film.sample(8).frames] == [0, 2, 4, 6, 8, 10]
    assert [frame.index for frame in film.frames(only={1, 10})] == [1, 10]
    assert decoder.calls == calls
    frames = list(film.frames())
    assert [frame.time for frame in frames] == pytest.approx([k / 30 for k in range(12)])
    assert [frame.index for frame in frames if frame.image is None] == [3]
    assert film.thinned() is not None
    kept = [picture() is not None for picture in decoder.pictures[:11]]
    assert all(kept) == (calls == 1)
    del film, frames
    assert all(picture() is None for picture in decoder.pictures)


def test_a_long_film_is_thinned_to_the_frames_that_are_kept(decoder, monkeypatch):
    monkeypatch.setattr(film_rows, "MOST_BYTES", 10 * BYTES)
    monkeypatch.setattr(film_rows, "_FEWEST", 4)
    film = new_film(decoder)
    thinned = film.thinned()
    assert [frame.time for frame in thinned.frames()] == pytest.approx([k / 30 for k in range(0, 12, 2)])
    assert [frame.index for frame in thinned.frames(only={1, 3})] == [1, 3]
    assert thinned.thinned() is None
    assert decoder.calls == 1


def test_pictures_that_are_not_needed_are_not_decoded(monkeypatch, tmp_path):
    clip = tmp_path / "clip.avi"
    write_clip(clip, draw_frames(Look(), np.linspace(-8.0, 8.0, 40)))
    whole = [frame.image for frame in open_film(clip).frames()]
    monkeypatch.setattr(film_rows, "MOST_BYTES", 4 * whole[0].size)
    decoded = []
    to_packets = decode_module._decoded_packets

    def counted(*args):
        for packet, pictures in to_packets(*args):
            decoded.extend(pictures or ())
            yield packet, pictures

    monkeypatch.setattr(decode_module, "_decoded_packets", counted)
    film = open_film(clip)
    decoded.clear()
    sample = film.sample(8)
    assert sample.count == 40
    assert len(decoded) == 10
    assert [frame.index for frame in sample.frames] == list(range(0, 40, 8))
    for frame in sample.frames:
        np.testing.assert_array_equal(frame.image, whole[frame.index])
    decoded.clear()
    assert [frame.index for frame in film.frames(only={5, 17})] == [5, 17]
    assert len(decoded) == 2
    assert len(list(film.frames())) == 40


def test_a_film_with_fewer_frames_than_its_container_states_is_sampled_as_densely(monkeypatch, tmp_path):
    clip = tmp_path / "clip.avi"
    write_clip(clip, draw_frames(Look(), np.linspace(-8.0, 8.0, 40)))
    monkeypatch.setattr(film_rows, "MOST_BYTES", 30 * 640 * 480)
    rows = open_film(clip).rows
    assert (rows.kept.stride, len(rows.kept.rows)) == (2, 20)
    claimed = FilmRows(clip, lambda wants: decode_module.decode(clip, wants), None, True, 4000, 640 * 480 * 3 // 2)
    assert (claimed.kept.stride, len(claimed.kept.rows)) == (2, 20)


def test_of_a_long_film_whose_pictures_are_predicted_key_frames_alone_are_sampled(monkeypatch, tmp_path):
    clip = tmp_path / "clip.mp4"
    wall = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (240, 320, 3), np.uint8), (0, 0), 2.0)
    encode(clip, (np.roll(wall, k, axis=1) for k in range(300)), options={"g": "2"})
    whole = list(open_film(clip).frames())
    monkeypatch.setattr(film_rows, "MOST_BYTES", 30 * whole[0].image.size)
    film = open_film(clip)
    sample = film.sample(60)
    assert not film.rows.is_read
    assert sample.count == 300
    assert 20 <= len(sample.frames) <= 60
    indices = [frame.index for frame in sample.frames]
    assert all(index % 2 == 0 for index in indices)
    assert np.diff([-1, *indices, 300]).max() <= 16
    for frame in sample.frames:
        assert frame.time == whole[frame.index].time
        np.testing.assert_array_equal(frame.image, whole[frame.index].image)
    assert [frame.time for frame in film.frames()] == [frame.time for frame in whole]


@pytest.mark.parametrize("damage", [0, *(pytest.param(k, marks=pytest.mark.sweep) for k in (1, 2, 3))])
def test_a_damaged_film_has_the_rows_that_one_thread_decodes(tmp_path, monkeypatch, damage):
    clip = tmp_path / "clip.mp4"
    encode(clip, draw_frames(Look(), np.linspace(-8.0, 8.0, 60)), options={"bf": "3", "g": "20"})
    content, rng = bytearray(clip.read_bytes()), np.random.default_rng(damage)
    for k in rng.integers(len(content) // 4, 3 * len(content) // 4, 3):
        content[k] ^= 0x55
    clip.write_bytes(content)

    def rows(threads):
        monkeypatch.setenv("OMP_NUM_THREADS", str(threads))
        return [(time, None if p is None else p.to_ndarray().tobytes()) for time, p in decode_module.decode(clip)]

    assert rows(2) == rows(1)


def test_times_and_lost_frames_are_known_after_one_reading(decoder):
    film = new_film(decoder)
    np.testing.assert_allclose(film.times, np.arange(12) / 30)
    assert film.undecodable == 1
    assert film.interlaced == 0
    assert decoder.calls == 1


def test_an_interrupted_reading_is_not_taken_for_the_whole_film(decoder):
    film = new_film(decoder)
    assert len(list(itertools.islice(film.frames(), 5))) == 5
    assert len(list(film.frames())) == 12


def test_an_error_is_raised_at_every_reading(monkeypatch):
    def decode(wants):
        yield 0.0, Picture()
        raise InputError("film.avi: timestamps do not increase")

    monkeypatch.setattr(picture_module, "to_colours", lambda picture: np.zeros((2, 2, 3), np.uint8))
    film = new_film(decode)
    for _ in range(2):
        with pytest.raises(InputError, match="do not increase"):
            list(film.frames())


def test_frames_from_memory_equal_those_from_the_file(tmp_path):
    clip = tmp_path / "clip.avi"
    write_clip(clip, draw_frames(Look(), np.arange(8.0)))
    film = open_film(clip)
    list(film.frames())
    content = clip.read_bytes()
    clip.write_bytes(b"")
    kept = [*film.frames(), *film.frames(brightness=True), *film.sample(4).frames]
    clip.write_bytes(content)
    again = [
        frame
        for frames in (
            open_film(clip).frames(),
            open_film(clip).frames(brightness=True),
            open_film(clip).sample(4).frames,
        )
        for frame in frames
    ]
    assert [(f.index, f.time, f.predicted) for f in kept] == [(f.index, f.time, f.predicted) for f in again]
    for one, other in zip(kept, again, strict=True):
        np.testing.assert_array_equal(one.image, other.image)


@pytest.mark.parametrize(
    ("wanted", "frames"),
    [
        ({"from": 5}, range(5, 12)),
        ({"to": 5}, range(6)),
        ({"from": 2, "to": 4}, range(2, 5)),
        ({"from": 11, "to": 99}, range(11, 12)),
    ],
)
@pytest.mark.parametrize("room", [100, 0])
def test_a_range_has_its_frames_at_their_times_in_the_film(decoder, monkeypatch, wanted, frames, room):
    monkeypatch.setattr(film_rows, "MOST_BYTES", room * BYTES)
    film = new_film(decoder, **wanted)
    for _ in range(2):
        read = list(film.frames())
        np.testing.assert_allclose([frame.time for frame in read], np.array(frames) / 30)
        assert [film.first_frame + frame.index for frame in read] == list(frames)
        assert film.sample(4).count == len(frames)
    assert film.undecodable == (3 in frames)


def test_a_film_that_ends_before_the_range_says_so_at_every_reading(decoder):
    film = new_film(decoder, **{"from": 12})
    for _ in range(2):
        with pytest.raises(InputError, match="frame 12 was asked for as the first"):
            list(film.frames())


def test_a_range_of_a_cut_file_is_complete_where_its_last_frame_is_there(decoder):
    for last, complete in ((9, True), (20, False)):
        film = replace(new_film(decoder, to=last), cut_short=True, declared_frames=24)
        assert (film.why_truncated(film.sample(4)) is None) == complete
