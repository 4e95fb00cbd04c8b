"""What containers and codecs do: reordered frames, edit lists, many codecs and depths; every frame once, in order."""

from __future__ import annotations

import av
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.rig import Rig, RigFrames, RigMark, RigPivot
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from support import things
from support.encoded import encode, trim

RIG = Rig(mouth=RigMark(rgb=(200, 40, 40)), pivot=RigPivot(marker="none"))


def _greys(count: int = 40) -> list[np.ndarray]:
    """Return pictures whose grey level tells their number."""
    return [np.full((48, 64, 3), 30 + 5 * k, np.uint8) for k in range(count)]


def _numbers(film) -> list[float]:
    return [float(frame.image.mean()) for frame in film.frames()]


@pytest.mark.parametrize(
    ("codec", "options"),
    [("libx264", {"bf": "3", "g": "12"}), ("libx264", {"bf": "8", "b_strategy": "0"}), ("mpeg4", {"bf": "2"})],
)
def test_avi_with_reordered_frames_has_them_in_order_at_an_even_rate(tmp_path, codec, options):
    film = open_film(encode(tmp_path / "b.avi", _greys(), codec=codec, options=options))
    levels = _numbers(film)
    assert len(levels) == 40
    assert np.diff(levels).min() >= 0.0  # in the order in which they were filmed
    np.testing.assert_allclose(levels, [picture.mean() for picture in _greys()], atol=8.0)  # MPEG-4 errs by 7
    np.testing.assert_allclose(film.times, np.arange(40) / 30, atol=1e-9)


def test_a_lost_packet_of_reordered_avi_costs_a_row_and_the_later_times_stay_right(tmp_path):
    clip = encode(tmp_path / "b.avi", _greys(), options={"bf": "2", "g": "10", "x264-params": "scenecut=0"})
    content = bytearray(clip.read_bytes())
    at = content.index(b"movi")
    for _ in range(14):
        at = content.index(b"00dc", at + 4)
    size = int.from_bytes(content[at + 4 : at + 8], "little")
    content[at + 8 : at + 8 + size] = b"\xff" * size
    clip.write_bytes(content)
    frames = list(open_film(clip).frames())
    assert len(frames) == 40
    np.testing.assert_allclose([frame.time for frame in frames], np.arange(40) / 30, atol=1e-9)
    assert 1 <= sum(frame.image is None for frame in frames) <= 10  # to the next key frame
    late = [frame for frame in frames if frame.index >= 30]
    np.testing.assert_allclose([f.image.mean() for f in late], [30 + 5 * f.index for f in late], atol=4.5)


@pytest.mark.parametrize("reordered", ["0", "3"])
@pytest.mark.parametrize("codec", ["libx264", "libx265"])
def test_a_trimmed_clip_has_the_frames_of_its_untrimmed_part_from_zero_on(tmp_path, codec, reordered):
    options = {"g": "10", "bf": reordered, "x265-params": f"log-level=none:keyint=10:bframes={reordered}"}
    whole = open_film(encode(tmp_path / "whole.mp4", _greys(), codec=codec, options=options))
    film = open_film(trim(whole.path, tmp_path / "cut.mp4", 15 / 30))
    assert _numbers(film) == _numbers(whole)[15:]
    np.testing.assert_allclose(film.times, np.arange(25) / 30, atol=1e-4)
    assert film.undecodable == 0
    assert film.declared_frames == 25


def test_a_trimmed_clip_gives_the_angles_of_its_untrimmed_part(tmp_path, monkeypatch):
    monkeypatch.setattr(things, "SIZE", (240, 200))
    swing = 20.0 * np.sin(np.arange(60) / 5.0)
    drawn = things.film(tmp_path / "drawn.mkv", things.ball((200, 40, 40), 9.0, (120.0, 20.0), 140.0), swing)
    pictures = [frame.image for frame in open_film(drawn).frames()]
    whole = open_film(encode(tmp_path / "whole.mp4", pictures, options={"g": "12", "crf": "12"}))
    cut = open_film(trim(whole.path, tmp_path / "cut.mp4", 20 / 30))
    part = measure_clip(cut, RIG).series
    same = measure_clip(open_film(whole.path, RIG.frames.model_copy(update={"first": 20})), RIG).series
    assert part.ok.all()
    np.testing.assert_allclose(part.angle, same.angle, atol=1e-9)  # the same pictures
    np.testing.assert_allclose(part.time, same.time - 20 / 30, atol=1e-4)


def test_a_cut_file_with_an_edit_list_is_not_called_truncated_if_every_frame_is_there(tmp_path):
    whole = encode(tmp_path / "whole.mp4", _greys(), options={"g": "10"})
    clip = trim(whole, tmp_path / "cut.mp4", 15 / 30)
    with clip.open("ab") as stream:
        stream.write((1000).to_bytes(4, "big") + b"free" + bytes(100))  # a box at the end that is cut off
    film = open_film(clip)
    assert film.cut_short
    assert film.why_truncated(film.sample(8)) is None


@pytest.mark.parametrize(
    ("name", "codec", "pix_fmt", "options"),
    [
        ("hevc10.mp4", "libx265", "yuv420p10le", {"x265-params": "log-level=none"}),
        ("vp9.webm", "libvpx-vp9", "yuv420p", {}),
        ("av1.mkv", "libsvtav1", "yuv420p10le", {"preset": "12"}),
        ("anim.gif", "gif", "rgb8", {}),
        ("grey16.mkv", "ffv1", "gray16le", {}),
        ("grey10.mkv", "ffv1", "gray10le", {}),
        ("prores.mov", "prores_ks", "yuv422p10le", {}),
    ],
)
def test_codecs_and_depths_are_read(tmp_path, name, codec, pix_fmt, options):
    try:
        av.Codec(codec, "w")
    except av.codec.codec.UnknownCodecError:
        pytest.skip(f"this PyAV has no encoder {codec}")
    pictures = _greys(12)
    if pix_fmt.startswith("gray"):
        depth = 16 if "16" in pix_fmt else 10
        pictures = [np.full((48, 64), int(picture[0, 0, 0]) << (depth - 8), np.uint16) for picture in pictures]
    rate = 25 if codec == "gif" else 30
    clip = encode(tmp_path / name, pictures, codec=codec, pix_fmt=pix_fmt, options=options, rate_hz=rate)
    film = open_film(clip)
    expected = [30.0 + 5.0 * k for k in range(12)]
    coarse = 20.0 if codec == "gif" else 4.5  # GIF of eight bits has eight levels of green
    np.testing.assert_allclose(_numbers(film), expected, atol=coarse)
    np.testing.assert_allclose(film.times, np.arange(12) / rate, atol=6e-4)
    for frame in film.frames(brightness=True):
        assert frame.image.shape == (48, 64, 1)
        assert frame.image.dtype == np.uint8


def test_the_brightness_of_deep_samples_is_their_upper_eight_bits(tmp_path):
    deep = np.random.default_rng(0).integers(0, 65536, (48, 64), np.uint16)
    (frame,) = open_film(encode(tmp_path / "deep.mkv", [deep], codec="ffv1", pix_fmt="gray16le")).frames(
        brightness=True
    )
    np.testing.assert_array_equal(frame.image[..., 0], deep >> 8)


def test_a_gif_is_measured(tmp_path, monkeypatch):
    monkeypatch.setattr(things, "SIZE", (240, 200))
    swing = 20.0 * np.sin(np.arange(40) / 5.0)
    drawn = things.film(tmp_path / "drawn.mkv", things.ball((200, 40, 40), 9.0, (120.0, 20.0), 140.0), swing)
    pictures = [frame.image for frame in open_film(drawn).frames()]
    clip = encode(tmp_path / "swing.gif", pictures, codec="gif", pix_fmt="rgb8", rate_hz=25)
    series = measure_clip(open_film(clip), RIG).series
    assert series.ok.all()
    off = np.std(np.degrees(series.angle) - swing)
    assert off < 0.3  # eight levels of red and green, four of blue
    assert off < 1.5 * np.degrees(np.median(series.sigma))


def test_a_picture_of_64_px_is_measured(tmp_path, monkeypatch):
    monkeypatch.setattr(things, "SIZE", (64, 64))
    swing = 18.0 * np.sin(np.arange(60) / 6.0)
    clip = things.film(tmp_path / "small.mkv", things.ball((200, 40, 40), 3.0, (32.0, 6.0), 44.0), swing)
    series = measure_clip(open_film(clip), Rig()).series
    assert series.ok.all()
    off = np.degrees(series.angle) - swing
    assert np.std(off) < 0.1
    assert np.std(off) < 1.5 * np.degrees(np.median(series.sigma))


def test_a_small_header_is_refused_below_32_px(tmp_path):
    with pytest.raises(InputError, match="too small"):
        open_film(encode(tmp_path / "16.mkv", [np.zeros((16, 16, 3), np.uint8)] * 2))


def test_a_film_that_states_its_frames_is_not_decoded_to_find_that_it_ends_too_early(tmp_path, monkeypatch):
    film = encode(tmp_path / "film.mp4", _greys())
    count = len(open_film(film).times)
    monkeypatch.setattr("anglecam.video.open_film.FilmRows", None)  # the rows are not even begun
    with pytest.raises(InputError, match=f"{count} frames, .* frame {count} was asked for as the first"):
        open_film(film, RigFrames.model_validate({"from": count}))
