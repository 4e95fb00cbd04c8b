"""A folder of numbered pictures is a film at the declared rate."""

from __future__ import annotations

from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from anglecam.errors import InputError, RigError
from anglecam.io.rig import RigFrames
from anglecam.video.open_film import open_film
from anglecam.workflow.clip import measure_source, open_source
from support import things
from support.encoded import INTERLACED_DCT

AT_50_HZ = RigFrames(rate_hz=50.0)


def _numbered(folder, pictures, ending=".png", first=1):
    folder.mkdir(exist_ok=True)
    for number, picture in enumerate(pictures, start=first):
        cv2.imwrite(str(folder / f"run_{number:04d}{ending}"), picture)
    return folder


def _random(count=4, shape=(48, 64, 3), dtype=np.uint8):
    top = np.iinfo(dtype).max + 1
    return [np.random.default_rng(k).integers(0, top, shape, dtype) for k in range(count)]


@pytest.mark.parametrize("ending", [".png", ".tif", ".bmp", ".TIFF"])
def test_lossless_pictures_are_read_unchanged(tmp_path, ending):
    pictures = _random()
    film = open_film(_numbered(tmp_path / "run", pictures, ending), AT_50_HZ)
    assert film.size == (64, 48)
    frames = list(film.frames())
    np.testing.assert_allclose([frame.time for frame in frames], np.arange(4) / 50.0)
    for frame, picture in zip(frames, pictures, strict=True):
        np.testing.assert_array_equal(frame.image, picture)


@pytest.mark.parametrize("ending", [".png", ".tif"])
def test_grey_pictures_of_16_bits_are_read(tmp_path, ending):
    pictures = _random(shape=(48, 64), dtype=np.uint16)
    film = open_film(_numbered(tmp_path / "grey", pictures, ending), AT_50_HZ)
    for frame, picture in zip(film.frames(brightness=True), pictures, strict=True):
        np.testing.assert_array_equal(frame.image[..., 0], picture >> 8)
    for frame, picture in zip(film.frames(), pictures, strict=True):
        assert np.abs(frame.image - (picture >> 8)[..., None].astype(int)).max() <= 1


def test_jpeg_is_read_and_a_missing_or_broken_picture_keeps_its_row(tmp_path):
    folder = _numbered(tmp_path / "run", [np.full((48, 64, 3), 20 * k, np.uint8) for k in range(1, 7)], ".jpg")
    (folder / "run_0003.jpg").unlink()
    (folder / "run_0005.jpg").write_bytes(b"no picture")
    frames = list(open_film(folder, AT_50_HZ).frames())
    assert [f.index for f in frames if f.image is None] == [2, 4]
    np.testing.assert_allclose([f.time for f in frames], np.arange(6) / 50.0)
    np.testing.assert_allclose([f.image.mean() for f in frames if f.image is not None], [20, 40, 80, 120], atol=2.0)


def test_a_picture_of_a_phone_held_upright_is_shown_upright(tmp_path):
    """EXIF orientation 6: the camera was turned, and viewers turn the picture clockwise."""
    stored = np.zeros((48, 64, 3), np.uint8)
    stored[:24, 32:] = 255  # above right
    folder = _numbered(tmp_path / "run", [stored] * 2, ".jpg")
    for path in folder.iterdir():
        jpeg = path.read_bytes()
        entry = b"\x12\x01\x03\x00\x01\x00\x00\x00\x06\x00\x00\x00"
        exif = b"Exif\x00\x00II*\x00\x08\x00\x00\x00\x01\x00" + entry + bytes(4)
        path.write_bytes(jpeg[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + jpeg[2:])
    film = open_film(folder, AT_50_HZ)
    assert film.size == (48, 64)
    image = next(film.frames()).image
    assert image[48, 36].min() > 240  # below right
    assert image[16, 36].max() < 15


def test_a_progressive_png_is_not_taken_for_an_interlaced_film(tmp_path):
    """PNG may transmit its lines in an interlaced order; FFmpeg flags them as it flags fields."""
    encoder = av.CodecContext.create("png", "w")
    encoder.width, encoder.height, encoder.pix_fmt, encoder.time_base = 64, 48, "rgb24", Fraction(1, 30)
    encoder.flags |= INTERLACED_DCT
    (picture,) = _random(1)
    frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format="rgb24")
    for k in range(2):
        frame.pts = k
        (packet,) = encoder.encode(frame)
        (tmp_path / f"a{k}.png").write_bytes(bytes(packet))
    film = open_film(tmp_path, AT_50_HZ)
    for shown in film.frames():
        np.testing.assert_array_equal(shown.image, picture)
    assert film.interlaced == 0


def test_pictures_of_two_sizes_are_two_films(tmp_path):
    folder = _numbered(tmp_path / "run", [*_random(3), *_random(3, shape=(64, 64, 3))])
    with pytest.raises(InputError, match=r"run: pictures of 64 × 64 px at 0\.08 s"):
        list(open_film(folder, AT_50_HZ).frames())


def test_the_rate_is_required_for_pictures_and_refused_for_a_film(tmp_path):
    folder = _numbered(tmp_path / "run", _random())
    with pytest.raises(RigError, match=r"run: numbered pictures have no times: declare frames: \{rate_hz"):
        open_film(folder)
    film = things.film(tmp_path / "film.mkv", things.ball((200, 40, 40), 9.0), np.zeros(2))
    with pytest.raises(RigError, match="time stamps of its own"):
        open_film(film, AT_50_HZ)
    with pytest.raises(InputError, match="no numbered pictures"):
        open_film(tmp_path, AT_50_HZ)


def test_nothing_to_decode_is_one_line(tmp_path):
    folder = _numbered(tmp_path / "run", _random(3))
    for path in folder.iterdir():
        path.write_bytes(b"")
    with pytest.raises(InputError, match="none of its 3 pictures can be decoded"):
        open_film(folder, AT_50_HZ)


@pytest.mark.parametrize("inside", [True, False])
def test_pictures_are_measured_with_the_rig_file_in_their_folder_or_beside_it(tmp_path, monkeypatch, inside):
    monkeypatch.setattr(things, "SIZE", (240, 200))
    swing = 20.0 * np.sin(np.arange(40) / 5.0)
    drawn = things.film(tmp_path / "drawn.mkv", things.ball((200, 40, 40), 9.0, (120.0, 20.0), 140.0), swing)
    folder = _numbered(tmp_path / "swing", [frame.image for frame in open_film(drawn).frames()])
    rig = (folder if inside else tmp_path) / "rig.yaml"
    rig.write_text("frames: {rate_hz: 50, from: 10, to: 29}\nmouth: {rgb: [200, 40, 40]}\n")
    series = measure_source(open_source(folder)).series
    assert series.name == "swing"
    assert series.first_frame == 10
    np.testing.assert_allclose(series.time, np.arange(10, 30) / 50.0)
    off = np.degrees(series.angle) - swing[10:30]
    assert np.std(off) < 0.1
