"""Films that were made to do harm, or lie about themselves, are refused in one line before they cost much."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.video.open_film import open_film


def _film(path, sizes=((64, 48),) * 12, stamps=None, codec="mjpeg", container_format=None, **tags) -> Path:
    """Film grey pictures; where the size changes, each packet is made by an encoder of its own size."""
    with av.open(str(path), "w", format=container_format) as container:
        stream = container.add_stream(codec, rate=30)
        stream.width, stream.height, stream.pix_fmt = *sizes[0], "yuvj420p" if codec == "mjpeg" else "yuv420p"
        container.metadata.update(tags)
        for k, size in enumerate(sizes):
            picture = av.VideoFrame.from_ndarray(np.full((size[1], size[0], 3), 40 + 3 * k, np.uint8), "bgr24")
            picture.pts = k if stamps is None else stamps[k]
            if size == sizes[0]:
                packets = stream.encode(picture)
            else:
                packets = _encoder(codec, size).encode(picture)
                for packet in packets:
                    packet.stream = stream
            container.mux(packets)
        container.mux(stream.encode())
    return Path(path)


def _encoder(codec, size):
    encoder = av.CodecContext.create(codec, "w")
    encoder.width, encoder.height, encoder.pix_fmt = *size, "yuvj420p" if codec == "mjpeg" else "yuv420p"
    encoder.time_base = Fraction(1, 30)
    return encoder


def _refusal(path, read=lambda path: list(open_film(path).frames())) -> str:
    with pytest.raises(InputError) as caught:
        read(path)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert path.name in line
    return line


@pytest.mark.parametrize(
    ("width", "height", "says"),
    [
        (65_535, 65_535, "more than 67,108,864 px"),
        (16_000, 16_000, "more than 67,108,864 px"),
        (60_000, 40, "60000 × 40 px"),
        (1, 48, "1 × 48 px are too small"),
    ],
)
def test_a_header_that_claims_an_absurd_size_is_refused(tmp_path, width, height, says):
    clip = _film(tmp_path / "size.avi", codec="ffv1")
    data = clip.read_bytes().replace(struct.pack("<II", 64, 48), struct.pack("<II", width, height))
    clip.write_bytes(data)
    assert says in _refusal(clip, open_film)
    assert says in _refusal(clip)


def test_8k_film_is_within_the_limits(tmp_path):
    clip = _film(tmp_path / "8k.avi", sizes=((7680, 4320),))
    (frame,) = open_film(clip).frames(brightness=True)
    assert frame.image.shape == (4320, 7680, 1)


def test_a_container_of_many_streams_is_refused(tmp_path):
    clip = tmp_path / "streams.mkv"
    with av.open(str(clip), "w") as container:
        streams = [container.add_stream("mjpeg", rate=30) for _ in range(70)]
        for stream in streams:
            stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
        picture = av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), "bgr24")
        picture.pts = 0
        for stream in streams:
            container.mux(stream.encode(picture))
    assert "it claims 70 streams" in _refusal(clip)


def test_frames_are_counted_as_they_come_and_not_as_a_header_says(tmp_path, monkeypatch):
    clip = _film(tmp_path / "long.avi")
    clip.write_bytes(clip.read_bytes().replace(struct.pack("<I", 12), struct.pack("<I", 2**31 - 1)))
    assert open_film(clip).declared_frames != 12
    assert len(list(open_film(clip).frames())) == 12
    monkeypatch.setattr("anglecam.video.decode.MOST_FRAMES", 10)
    assert "more than 10 frames" in _refusal(clip)
    assert "more than 10 frames" in _refusal(clip, lambda path: open_film(path).sample(4))


def test_a_film_longer_than_a_week_is_refused(tmp_path):
    clip = _film(tmp_path / "week.mkv", stamps=[0, 1, 2, 30 * 8 * 24 * 3600], sizes=((64, 48),) * 4)
    assert "a week is the longest" in _refusal(clip)


@pytest.mark.parametrize("codec", ["mjpeg", "mpeg4"])
def test_a_film_whose_pictures_change_their_size_is_refused(tmp_path, codec):
    clip = _film(tmp_path / "change.avi", sizes=((64, 48),) * 6 + ((96, 80),) * 6, codec=codec)
    assert "pictures of 96 × 80 px at 0.2" in _refusal(clip)


def test_one_picture_of_another_size_costs_itself_alone(tmp_path):
    sizes = [(64, 48)] * 12
    sizes[5] = (96, 80)
    frames = list(open_film(_film(tmp_path / "one.avi", sizes=sizes)).frames())
    assert [k for k, frame in enumerate(frames) if frame.image is None] == [5]


def _index_of(film: bytes, samples: int) -> bytes:
    """Have an MP4 claim that many frames of one byte, at no cost of bytes."""
    data = bytearray(film)
    for kind, at, numbers in ((b"stsz", 8, (1, samples)), (b"stsc", 16, (samples,)), (b"stts", 12, (samples, 1))):
        start = film.index(kind) + at
        data[start : start + 4 * len(numbers)] = struct.pack(f">{len(numbers)}I", *numbers)
    return bytes(data)


def test_an_index_of_many_gigabytes_is_refused_to_the_decoder(tmp_path):
    clip = _film(tmp_path / "index.mp4", codec="libx264")
    clip.write_bytes(_index_of(clip.read_bytes(), 80_000_000))  # of 4.7 GB, from two kilobytes
    Path("/proc/self/clear_refs").write_text("5")
    before = _peak()
    _refusal(clip)
    assert _peak() - before < 100 * 2**20


def _peak() -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


@pytest.mark.parametrize(
    "text",
    [
        "ffconcat version 1.0\nfile secret.avi\n",
        "#EXTM3U\n#EXT-X-VERSION:3\n#EXTINF:1,\nsecret.avi\n#EXT-X-ENDLIST\n",
        "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 5004 RTP/AVP 96\n",
    ],
)
def test_a_play_list_does_not_open_what_it_names(tmp_path, text):
    _film(tmp_path / "secret.avi")
    clip = tmp_path / "list.avi"
    clip.write_text(text)
    assert "not a readable video file" in _refusal(clip)


@pytest.mark.parametrize("name", ["concat:secret.avi|secret.avi", "subfile,,start,0,end,9,,:secret.avi", "http:x.avi"])
def test_a_name_is_a_name_and_no_instruction(tmp_path, monkeypatch, name):
    _film(tmp_path / "film.avi").rename(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert len(list(open_film(Path(name)).frames())) == 12


def test_tags_that_are_no_text_do_no_harm(tmp_path):
    clip = _film(tmp_path / "tags.mkv", title="TITLETITLE")
    data = clip.read_bytes()
    assert b"TITLETITLE" in data
    clip.write_bytes(data.replace(b"TITLETITLE", b"\xff\xfe\xc3\x28\x00TITLE"))
    assert len(list(open_film(clip).frames())) == 12
