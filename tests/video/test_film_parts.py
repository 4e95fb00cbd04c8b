"""The parts of a film, decoded by themselves, are the film's frames."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

from anglecam.io.rig import RigFrames
from anglecam.video import film_parts, film_rows
from anglecam.video.film_parts import parts_of
from anglecam.video.from_key import IrregularFilmError
from anglecam.video.open_film import open_film
from support.encoded import encode, trim

COUNT, EVERY, LENGTH = 60, 4, 8
H264 = {"codec": "libx264", "options": {"g": "12", "bf": "3", "preset": "ultrafast", "sc_threshold": "0"}}
JPEG = {"codec": "mjpeg", "pix_fmt": "yuvj420p"}
KINDS = {
    "reordered.mp4": H264,
    "open.mkv": {"codec": "libx264", "options": {"g": "12", "bf": "3", "x264-params": "open-gop=1", "b": "200k"}},
    "hevc.mp4": {"codec": "libx265", "options": {"x265-params": "keyint=12:log-level=none", "preset": "ultrafast"}},
    "pictures.avi": JPEG,
    "lossless.mkv": {"codec": "ffv1", "pix_fmt": "yuv420p"},
}


@pytest.fixture(autouse=True)
def short_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let sixty small frames be a long film, and eight of them a part."""
    monkeypatch.setattr(film_parts, "LENGTH", LENGTH)
    monkeypatch.setattr(film_rows, "MOST_BYTES", 20 * 64 * 96)


def _pictures() -> list[np.ndarray]:
    wall = np.random.default_rng(0).integers(0, 255, (16, 24, 3), np.uint8).repeat(4, axis=0).repeat(4, axis=1)
    return [np.roll(wall, k, axis=1) for k in range(COUNT)]


def _of_parts(path: Path, wanted: RigFrames | None = None) -> list[tuple[int, float, np.ndarray]]:
    film = open_film(path, wanted)
    parts = parts_of(film, EVERY)
    assert parts is not None
    assert len(parts) > 3
    found = []
    for part in range(len(parts)):
        pictures = list(parts.pictures(film, part))
        start = parts.starts[part]
        assert start % EVERY == 0
        if part > 0:
            assert pictures[0].index == start - 1
        found += [(p.index, p.time, p.colours) for p in pictures if p.index >= start]
    return found


def _agrees(found: list[tuple[int, float, np.ndarray]], path: Path, wanted: RigFrames | None = None) -> None:
    whole = list(open_film(path, wanted).frames())
    assert [index for index, _, _ in found] == [frame.index for frame in whole]
    for (_, time, colours), frame in zip(found, whole, strict=True):
        assert time == frame.time
        np.testing.assert_array_equal(colours, frame.image)


@pytest.mark.parametrize("name", KINDS)
def test_parts_are_the_frames_of_the_film(tmp_path: Path, name: str) -> None:
    path = encode(tmp_path / name, _pictures(), **KINDS[name])
    _agrees(_of_parts(path), path)


def test_a_range_of_the_frames_has_parts_of_its_own(tmp_path: Path) -> None:
    path = encode(tmp_path / "film.avi", _pictures(), **JPEG)
    wanted = RigFrames.model_validate({"from": 5, "to": 50})
    _agrees(_of_parts(path, wanted), path, wanted)


def test_a_film_whose_first_key_frame_is_hidden_has_no_parts(tmp_path: Path) -> None:
    path = trim(encode(tmp_path / "whole.mp4", _pictures(), **H264), tmp_path / "cut.mp4", 0.3)
    assert parts_of(open_film(path), EVERY) is None


def test_a_damaged_frame_ends_the_reading_of_its_part(tmp_path: Path) -> None:
    path = encode(tmp_path / "film.mov", _pictures(), **JPEG)
    with av.open(str(path)) as container:
        broken = list(container.demux(video=0))[20]
    content = bytearray(path.read_bytes())
    content[broken.pos : broken.pos + broken.size] = bytes(broken.size)
    path.write_bytes(content)
    parts = parts_of(open_film(path), EVERY)
    assert parts is not None
    (damaged,) = (part for part in range(len(parts)) if parts.starts[part] < 20 <= parts.starts[part + 1] - 1)
    with pytest.raises(IrregularFilmError):
        list(parts.pictures(open_film(path), damaged))


def test_a_film_that_is_kept_in_memory_has_no_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film_rows, "MOST_BYTES", 2**20)
    assert parts_of(open_film(encode(tmp_path / "film.avi", _pictures(), **JPEG)), EVERY) is None


def test_a_film_that_is_refreshed_in_strips_has_irregular_parts(tmp_path: Path) -> None:
    kind = {"codec": "libx264", "options": {"g": "12", "x264-params": "intra-refresh=1", "bf": "0"}}
    film = open_film(encode(tmp_path / "film.mp4", _pictures(), **kind))
    parts = parts_of(film, EVERY)
    assert parts is not None
    with pytest.raises(IrregularFilmError):
        list(parts.pictures(film, len(parts) - 1))
