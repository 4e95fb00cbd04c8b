"""Pictures that come as time goes by: a film at its rate, a pipe; what is recorded is what came, to the bit."""

from __future__ import annotations

import os
import threading
import time
from contextlib import suppress

import av
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.video.live_source import open_live
from anglecam.video.open_film import open_film

N, RATE_HZ = 45, 30


def _film(path, codec, pix_fmt="yuv420p", size=(160, 120)):
    """Write a film of noise and a moving bar."""
    rng = np.random.default_rng(1)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=RATE_HZ)
        stream.width, stream.height, stream.pix_fmt = *size, pix_fmt
        for k in range(N):
            picture = rng.integers(0, 60, (size[1], size[0], 3), dtype=np.uint8)
            picture[:, 3 * k : 3 * k + 10] = 220
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return path


def _frames(path):
    return [(frame.time, frame.image) for frame in open_film(path).frames()]


def _piped(film, pipe, pause=0.0, broken_at=None):
    """Write a film into a named pipe, in a thread."""

    def write():
        data = film.read_bytes()[:broken_at]
        with suppress(BrokenPipeError), pipe.open("wb") as stream:
            for start in range(0, len(data), 4096):
                stream.write(data[start : start + 4096])
                time.sleep(pause)

    os.mkfifo(pipe)
    threading.Thread(target=write, daemon=True).start()
    return pipe


@pytest.mark.parametrize(
    ("codec", "name"), [pytest.param("mjpeg", "a.avi", marks=pytest.mark.sweep), ("libx264", "b.mp4")]
)
def test_a_film_is_played_at_its_rate_and_copied(codec, name, tmp_path):
    film = _film(tmp_path / name, codec, "yuvj420p" if codec == "mjpeg" else "yuv420p")
    out = tmp_path / "out"
    out.mkdir()
    source = open_live(str(film))
    begun = time.monotonic()
    recorded = source.record(out)
    came = [(row[0], ready, time.monotonic()) for row, ready in source.rows()]
    source.close()
    assert recorded.read_bytes() == film.read_bytes()
    times, ready, at = np.array(came).T
    assert len(times) == N
    assert np.allclose(np.diff(ready), np.diff(times), atol=1e-9)  # due at its rate, whatever the machine does
    assert (at >= ready).all()
    assert at[-1] - begun >= times[-1] - times[0]


@pytest.mark.parametrize(
    ("codec", "name", "kept"),
    [
        ("mjpeg", "a.avi", "live.avi"),
        ("libx264", "b.mkv", "live.mov"),
        ("libx264", "c.ts", "live.mov"),
        ("ffv1", "d.mkv", "live.mkv"),
    ],
)
def test_a_pipe_is_recorded_to_the_bit(codec, name, kept, tmp_path):
    film = _film(tmp_path / name, codec, "yuvj420p" if codec == "mjpeg" else "yuv420p")
    source = open_live(str(_piped(film, tmp_path / "live")))
    recorded = source.record(tmp_path)
    rows = [row for row, _ in source.rows()]
    source.close()
    assert recorded == tmp_path / kept
    shown = _frames(recorded)
    assert [t for t, _ in shown] == pytest.approx([t for t, _ in rows], abs=1e-6)
    first = shown[0][0] - _frames(film)[0][0]
    for (t, image), (u, its) in zip(_frames(film), shown, strict=True):
        assert abs(t + first - u) < 1e-6
        assert np.array_equal(image, its)


def test_a_pipe_that_breaks_off_leaves_what_came(tmp_path):
    film = _film(tmp_path / "a.avi", "mjpeg", "yuvj420p")
    size = film.stat().st_size
    source = open_live(str(_piped(film, tmp_path / "live", broken_at=size // 2)))
    recorded = source.record(tmp_path)
    rows = list(source.rows())
    source.close()
    assert 10 < len(rows) < N
    assert len(_frames(recorded)) in (len(rows), len(rows) - 1)  # the last packet may be a half


def test_a_source_that_is_stopped_has_ended(tmp_path):
    film = _film(tmp_path / "a.avi", "mjpeg", "yuvj420p")
    source = open_live(str(film))
    source.record(tmp_path / "..")
    rows = source.rows()
    next(rows)
    source.stop()
    assert len(list(rows)) < N - 2
    source.close()


def test_a_recording_never_replaces_another_one(tmp_path):
    film = _film(tmp_path / "a.avi", "mjpeg", "yuvj420p")
    (tmp_path / "live.avi").write_bytes(b"of yesterday")
    source = open_live(str(_piped(film, tmp_path / "live")))
    assert source.record(tmp_path).name == "live-2.avi"
    assert len(list(source.rows())) == N
    source.close()
    assert (tmp_path / "live.avi").read_bytes() == b"of yesterday"


@pytest.mark.parametrize(
    "source",
    ["nothing.avi", "/dev/null", "99", "http://127.0.0.1:9/film", "nonsense://x", "folder"],
)
def test_what_cannot_be_opened_is_said_in_a_line(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError) as told:
        open_live(source)
    assert "\n" not in str(told.value)
    assert source in str(told.value)


@pytest.mark.parametrize(("codec", "name"), [("mjpeg", "a.mjpeg"), ("libx264", "b.h264")])
def test_pictures_without_time_stamps_are_refused(codec, name, tmp_path):
    film = _film(tmp_path / name, codec, "yuvj420p" if codec == "mjpeg" else "yuv420p")
    with pytest.raises(InputError, match="without time stamps; send them in a container"):
        open_live(str(_piped(film, tmp_path / "pipe")))


def test_a_pipe_without_a_film_is_said_in_a_line(tmp_path):
    text = tmp_path / "text"
    text.write_text("no film\n" * 2000)
    with pytest.raises(InputError, match=r"pipe.*cannot be opened") as told:
        open_live(str(_piped(text, tmp_path / "pipe")))
    assert "\n" not in str(told.value)
