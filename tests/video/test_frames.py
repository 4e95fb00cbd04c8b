"""Reading clips: times are the file's own, every frame has its row, and what is wrong is said in one line."""

from __future__ import annotations

from fractions import Fraction

import av
import numpy as np
import pytest

from anglecam.data.series import AngleSeries
from anglecam.errors import InputError
from anglecam.video.open_film import open_film
from anglecam.video.overlay import write_overlay
from support import broken

TICKS = 30_000


def _write(path, stamps, codec="libx264", options=None, size=(64, 48)):
    """Film a grey level that tells the frame's number, at the given stamps of 1/30000 s."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=30, options=options or {})
        stream.width, stream.height = size
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 30 if codec == "mjpeg" else TICKS)
        for k, stamp in enumerate(stamps):
            image = np.full((size[1], size[0], 3), 40 + 3 * k, np.uint8)
            picture = av.VideoFrame.from_ndarray(image, format="bgr24")
            picture.pts = k if codec == "mjpeg" else int(stamp)
            picture.time_base = stream.time_base
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


@pytest.fixture
def avi(tmp_path):
    return _write(tmp_path / "good.avi", range(40), codec="mjpeg")


@pytest.mark.parametrize("ending", ["mp4", "mov"])
@pytest.mark.parametrize("reordered", ["0", "3"])
def test_times_at_a_varying_rate_are_the_files_own(tmp_path, ending, reordered):
    stamps = np.cumsum([0, *np.tile([900, 1100, 1001, 2500], 10)])
    clip = _write(tmp_path / f"vary.{ending}", stamps, options={"bf": reordered})
    frames = list(open_film(clip).frames())
    assert [f.index for f in frames] == list(range(len(stamps)))
    np.testing.assert_allclose([f.time for f in frames], stamps / TICKS, atol=1e-6)
    levels = [float(f.image.mean()) for f in frames]
    assert np.diff(levels).min() > 1.0  # in the order in which they were filmed


def test_times_of_reordered_frames_in_avi_start_at_the_clips_start(tmp_path):
    clip = tmp_path / "xvid.avi"
    with av.open(str(clip), "w") as container:
        stream = container.add_stream("mpeg4", rate=30, options={"bf": "2"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for k in range(20):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.full((48, 64, 3), 8 * k, np.uint8), "bgr24")))
        container.mux(stream.encode())
    times = [f.time for f in open_film(clip).frames()]
    np.testing.assert_allclose(times, np.arange(20) / 30, atol=1e-9)


def test_a_packet_that_does_not_decode_keeps_its_row(avi):
    content = bytearray(avi.read_bytes())
    at = content.index(b"movi")
    for _ in range(8):
        at = content.index(b"00dc", at + 4)
    size = int.from_bytes(content[at + 4 : at + 8], "little")
    content[at + 8 : at + 8 + size] = bytes(size)  # the chunk's header stays, the picture does not
    avi.write_bytes(content)
    frames = list(open_film(avi).frames())
    assert [f.index for f in frames if f.image is None] == [7]
    np.testing.assert_allclose([f.time for f in frames], np.arange(40) / 30, atol=1e-9)
    assert open_film(avi).sample(100).decoded == 39


def test_sampled_frames_are_spread_over_the_whole_clip(avi):
    sample = open_film(avi).sample(16)
    assert sample.count == sample.decoded == 40
    assert 8 <= len(sample.frames) <= 16
    assert sample.frames[0].index == 0
    assert sample.frames[-1].index >= 36


@pytest.mark.parametrize("make", [broken.empty_clip, broken.text_clip, broken.zero_frame_clip])
def test_a_file_that_is_no_film_is_one_line_with_the_cause(tmp_path, make):
    clip = make(tmp_path)
    cause = {"empty": "empty file", "text": "not a readable video file", "zero_frames": "no frames"}[clip.stem]
    with pytest.raises(InputError) as error:
        list(open_film(clip).frames())
    assert str(error.value).startswith(f"{clip}: {cause}")
    assert "\n" not in str(error.value)


def test_a_missing_file_and_a_file_with_sound_alone_are_told_apart(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        open_film(tmp_path / "nowhere.avi")
    sound = tmp_path / "sound.avi"
    with av.open(str(sound), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        samples = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        samples.sample_rate = 8000
        container.mux(stream.encode(samples))
    with pytest.raises(InputError, match="no video stream"):
        open_film(sound)


@pytest.mark.parametrize(("ending", "codec"), [("avi", "mjpeg"), ("mkv", "libx264"), ("mp4", "libx264")])
def test_a_cut_file_is_told_from_a_whole_one(tmp_path, ending, codec):
    options = {"g": "1"} if codec == "libx264" else {}
    clip = _write(tmp_path / f"whole.{ending}", np.arange(40) * 1000, codec, options)
    if ending == "mp4":  # its index to the front, or nothing can be read of what is left
        front = tmp_path / "front.mp4"
        with av.open(str(clip)) as source, av.open(str(front), "w", options={"movflags": "faststart"}) as target:
            stream = target.add_stream_from_template(source.streams.video[0])
            for packet in source.demux(video=0):
                if packet.dts is not None:
                    packet.stream = stream
                    target.mux(packet)
        clip = front
    assert not open_film(clip).cut_short
    content = clip.read_bytes()
    cut = tmp_path / f"cut.{ending}"
    cut.write_bytes(content[: int(0.7 * len(content))])
    assert open_film(cut).cut_short
    assert 10 <= sum(f.image is not None for f in open_film(cut).frames()) < 40


def test_an_mp4_without_its_index_says_so(tmp_path):
    clip = _write(tmp_path / "whole.mp4", np.arange(40) * 1000)
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(clip.read_bytes()[:-400])
    with pytest.raises(InputError, match="truncated: its index is missing"):
        open_film(cut)


def test_a_count_that_lies_in_an_intact_file_is_no_failure(avi):
    content = bytearray(avi.read_bytes())
    at = content.index(b"avih") + 8 + 16
    content[at : at + 4] = (4000).to_bytes(4, "little")
    avi.write_bytes(content)
    assert not open_film(avi).cut_short
    assert sum(1 for _ in open_film(avi).frames()) == 40


def test_the_overlay_has_every_frame_at_its_own_time(tmp_path):
    stamps = np.cumsum([300, *np.tile([1000, 1001, 2100], 5)])
    clip = _write(tmp_path / "vary.mp4", stamps, size=(66, 50))
    n = len(stamps)
    places = np.column_stack([np.full(n, 40.0), np.full(n, 20.0)])
    status = ("no_mouth", *["ok"] * (n - 1))
    series = AngleSeries("vary", stamps / TICKS, np.zeros(n), np.ones(n), status, np.zeros(n), places, places - 20.0)

    class Measured:
        contours_px = (None,) * n

    Measured.series = series
    write_overlay(open_film(clip), Measured(), tmp_path / "new" / "vary.overlay.mp4")
    with av.open(str(tmp_path / "new" / "vary.overlay.mp4")) as film:
        assert film.streams.video[0].codec_context.name == "h264"
        assert film.streams.video[0].codec_context.pix_fmt == "yuv420p"
    read = list(open_film(tmp_path / "new" / "vary.overlay.mp4").frames())
    np.testing.assert_allclose([f.time for f in read], [f.time for f in open_film(clip).frames()], atol=1.2e-5)
