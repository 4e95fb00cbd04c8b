"""A frame that is read by itself equals the one that PyAV decodes in its place, in whatever order frames are read."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from anglecam.video import frame_reader
from anglecam.video.frame_index import index_frames
from anglecam.video.frame_reader import FrameReader
from anglecam.video.open_film import open_film
from support.encoded import encode, trim

COUNT = 40
ORDER = [39, 0, 21, 20, 19, 5, 6, 7, 38, 1, 12, 30, 2]
H264 = {"codec": "libx264", "options": {"g": "12", "bf": "3", "preset": "ultrafast", "sc_threshold": "0"}}
KINDS = {
    "reordered.mp4": H264,
    "open.mkv": {"codec": "libx264", "options": {"g": "12", "bf": "3", "x264-params": "open-gop=1", "b": "200k"}},
    "refreshed.mp4": {"codec": "libx264", "options": {"g": "12", "x264-params": "intra-refresh=1", "bf": "0"}},
    "hevc.mp4": {"codec": "libx265", "options": {"x265-params": "keyint=12:log-level=none", "preset": "ultrafast"}},
    "pictures.avi": {"codec": "mjpeg", "pix_fmt": "yuvj420p"},
    "reordered.avi": {"codec": "mpeg4", "options": {"g": "12", "bf": "2"}},
    "lossless.mkv": {"codec": "ffv1", "pix_fmt": "yuv420p"},
}


def _pictures() -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 255, (64, 96, 3), np.uint8), (0, 0), 2.0)
    pictures = []
    for k in range(COUNT):
        picture = np.roll(wall, k, axis=1)
        cv2.putText(picture, str(k), (10, 50), cv2.FONT_HERSHEY_SIMPLEX, 1.4, (255, 255, 255), 3)
        pictures.append(picture)
    return pictures


def _decoded(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)]


@pytest.mark.parametrize("name", KINDS)
def test_any_frame_is_the_one_that_pyav_decodes_there(tmp_path: Path, name: str) -> None:
    path = encode(tmp_path / name, _pictures(), **KINDS[name])
    film, expected = open_film(path), _decoded(path)
    reader = FrameReader(film)
    assert len(reader.times) == len(expected) == COUNT
    np.testing.assert_allclose(reader.times, film.times, atol=1e-9)
    frames = [frame.image for frame in film.frames()]
    for number in ORDER:
        image = reader.picture(number).colours
        assert image is not None
        np.testing.assert_array_equal(image, frames[number])
        if "yuvj" not in KINDS[name].get("pix_fmt", ""):  # of JPEG, anglecam's colours are not FFmpeg's
            np.testing.assert_array_equal(image, expected[number])


def test_frames_are_counted_from_where_an_edit_list_starts(tmp_path: Path) -> None:
    path = trim(encode(tmp_path / "whole.mp4", _pictures(), **H264), tmp_path / "cut.mp4", 0.5)
    film = open_film(path)
    reader, frames = FrameReader(film), list(film.frames())
    assert len(reader.times) == len(frames) == 25
    for number in (24, 0, 10, 9, 17):
        np.testing.assert_array_equal(reader.picture(number).colours, frames[number].image)
        assert reader.picture(number).time == pytest.approx(frames[number].time, abs=1e-9)


def test_an_intact_film_is_sought_and_not_decoded_from_its_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = open_film(encode(tmp_path / "film.mp4", _pictures(), **H264))
    monkeypatch.setattr(film.rows, "read", lambda: pytest.fail("decoded from the start"))
    FrameReader(film).picture(COUNT - 1)


def test_what_seeking_cannot_find_is_decoded_from_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film = open_film(encode(tmp_path / "film.mp4", _pictures(), **KINDS["refreshed.mp4"]))
    assert index_frames(film.path) is not None
    from_start = []
    read = film.rows.read
    monkeypatch.setattr(film.rows, "read", lambda: from_start.append(True) or read())
    FrameReader(film).picture(COUNT - 1)
    assert from_start == [True]


def test_a_damaged_film_keeps_its_rows(tmp_path: Path) -> None:
    path = encode(tmp_path / "film.avi", _pictures(), **KINDS["pictures.avi"])
    with av.open(str(path)) as container:
        broken = list(container.demux(video=0))[20]
    content = bytearray(path.read_bytes())
    content[broken.pos + 8 : broken.pos + 8 + broken.size] = bytes(broken.size)
    path.write_bytes(content)
    film = open_film(path)
    frames = [frame.image for frame in film.frames()]
    assert frames[20] is None
    reader = FrameReader(film)
    for number in (30, 20, 19, 21, len(frames) - 1):
        found = reader.picture(number).colours
        if frames[number] is None:
            assert found is None
        else:
            np.testing.assert_array_equal(found, frames[number])


def test_kept_pictures_are_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film = open_film(encode(tmp_path / "film.mp4", _pictures(), **H264))
    frames = [frame.image for frame in film.frames()]
    monkeypatch.setattr(frame_reader, "_MOST_BYTES", 40_000)  # four pictures
    reader = FrameReader(film)
    for number in [*ORDER, *ORDER[::-1]]:
        np.testing.assert_array_equal(reader.picture(number).colours, frames[number])


def test_a_frame_that_is_not_there_is_an_index_error(tmp_path: Path) -> None:
    reader = FrameReader(open_film(encode(tmp_path / "film.mp4", _pictures(), **H264)))
    with pytest.raises(IndexError):
        reader.picture(COUNT)
