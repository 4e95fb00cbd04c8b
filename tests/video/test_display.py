"""The picture is as a player shows it: turned, mirrored, with square pixels; angles are those of the shown picture."""

from __future__ import annotations

from fractions import Fraction

import cv2
import numpy as np
import pytest

from anglecam.camera.shutter import rig_as_shown
from anglecam.errors import InputError, RigError
from anglecam.io.rig import Rig, RigCamera, RigMark, RigPivot
from anglecam.measurement.clip import measure_clip
from anglecam.video.display import Display
from anglecam.video.open_film import open_film
from support import things
from support.encoded import LOSSLESS, encode

TURNS = (0, 90, 180, 270)
ONE = 1 << 16
SWING_DEG = 20.0 * np.sin(np.arange(40) / 5.0)
PIVOT, LENGTH = (120.0, 20.0), 140.0
RIG = Rig(mouth=RigMark(rgb=(200, 40, 40)), pivot=RigPivot(marker="none"))


def _pictures(monkeypatch, folder) -> list[np.ndarray]:
    """Draw a red ball that swings, 240 × 200 px."""
    monkeypatch.setattr(things, "SIZE", (240, 200))
    clip = things.film(folder / "drawn.mkv", things.ball((200, 40, 40), 9.0, PIVOT, LENGTH), SWING_DEG)
    return [frame.image for frame in open_film(clip).frames()]


def _stored(shown: np.ndarray, turn: int, mirrored: bool) -> np.ndarray:
    """Return the picture that is shown as ``shown`` when it is turned counter-clockwise and then mirrored."""
    return np.ascontiguousarray(np.rot90(shown[:, ::-1] if mirrored else shown, -turn // 90))


def _measured(clip):
    series = measure_clip(open_film(clip), RIG).series
    assert series.ok.all()
    return series


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("turn", TURNS)
def test_every_orientation_is_shown_upright_and_no_pixel_changes(tmp_path, turn, mirrored):
    upright = np.random.default_rng(turn).integers(0, 256, (48, 64, 3), np.uint8)
    clip = encode(
        tmp_path / "phone.mp4", [_stored(upright, turn, mirrored)] * 3, rotation=turn, hflip=mirrored, **LOSSLESS
    )
    film = open_film(clip)
    assert film.size == (64, 48)
    for frame in film.frames():
        np.testing.assert_array_equal(frame.image, upright)
    brightness = [frame.image for frame in film.frames(brightness=True)]
    assert brightness[0].shape == (48, 64, 1)


def test_angles_do_not_depend_on_how_the_phone_was_held(tmp_path, monkeypatch):
    pictures = _pictures(monkeypatch, tmp_path)
    upright = _measured(encode(tmp_path / "0.mp4", pictures, **LOSSLESS))
    for turn, mirrored in ((90, False), (180, False), (270, False), (90, True), (0, True)):
        stored = [_stored(picture, turn, mirrored) for picture in pictures]
        series = _measured(encode(tmp_path / "t.mp4", stored, rotation=turn, hflip=mirrored, **LOSSLESS))
        np.testing.assert_allclose(np.degrees(series.angle), np.degrees(upright.angle), atol=1e-6)
        np.testing.assert_allclose(series.mark_px, upright.mark_px, atol=1e-6)


def test_the_same_pictures_shown_mirrored_give_the_opposite_angle(tmp_path, monkeypatch):
    pictures = _pictures(monkeypatch, tmp_path)
    upright = _measured(encode(tmp_path / "up.mp4", pictures, **LOSSLESS))
    mirrored = _measured(encode(tmp_path / "selfie.mp4", pictures, hflip=True, **LOSSLESS))
    np.testing.assert_allclose(mirrored.angle, -upright.angle, atol=float(np.median(upright.sigma)))
    np.testing.assert_allclose(mirrored.mark_px[:, 0], 239.0 - upright.mark_px[:, 0], atol=0.05)


@pytest.mark.parametrize(
    "matrix",
    [
        [int(0.8 * ONE), int(0.6 * ONE), 0, int(-0.6 * ONE), int(0.8 * ONE), 0, 0, 0, 1 << 30],
        [ONE, 0, 0, ONE // 2, ONE, 0, 0, 0, 1 << 30],
        [0, 0, 0, 0, 0, 0, 0, 0, 1 << 30],
    ],
)
def test_a_film_that_players_show_aslant_is_refused_in_one_line(tmp_path, matrix):
    clip = encode(tmp_path / "slant.mp4", [np.zeros((48, 64, 3), np.uint8)] * 2, matrix=matrix)
    with pytest.raises(InputError, match=r"slant\.mp4: .*no multiple of 90°"):
        open_film(clip)


@pytest.mark.parametrize(
    "aspect",
    [Fraction(4, 3), *(pytest.param(f, marks=pytest.mark.sweep) for f in (Fraction(3, 4), Fraction(496, 495)))],
)
def test_a_clip_of_pixels_that_are_not_square_gives_the_angle_of_its_square_twin(tmp_path, monkeypatch, aspect):
    square = _pictures(monkeypatch, tmp_path)
    across, down = min(1.0, 1.0 / float(aspect)), min(1.0, float(aspect))
    narrow = [cv2.resize(p, None, fx=across, fy=down, interpolation=cv2.INTER_AREA) for p in square]
    height, width = (side - side % 2 for side in narrow[0].shape[:2])
    narrow = [picture[:height, :width] for picture in narrow]
    series = _measured(encode(tmp_path / "dv.mp4", narrow, aspect=aspect, **LOSSLESS))
    twin = _measured(encode(tmp_path / "square.mp4", square, **LOSSLESS))

    def error(measured) -> np.ndarray:
        off = np.degrees(measured.angle) - SWING_DEG
        return off - off.mean()

    assert np.std(error(twin)) < 0.03
    assert np.std(error(series)) < 2.0 * np.std(error(twin)) + 0.01  # ignoring the aspect of 4:3 costs 3°
    assert np.sqrt(np.mean((error(series) / np.degrees(series.sigma)) ** 2)) < 1.5
    np.testing.assert_allclose(series.mark_px, twin.mark_px, atol=0.1)


def test_a_turned_film_of_wide_pixels_is_stretched_along_its_stored_rows():
    display = Display((720, 576), Fraction(16, 15), transposed=True)
    assert display.size == (576, 768)
    assert display.show(np.zeros((576, 720, 3), np.uint8)).shape == (768, 576, 3)
    np.testing.assert_allclose(display.square([575.0, 719.0]), [575.0, 719.5 * 16 / 15 - 0.5])


def test_pixels_of_an_absurd_aspect_are_refused(tmp_path):
    clip = encode(tmp_path / "high.mp4", [np.zeros((128, 256, 3), np.uint8)] * 2, aspect=Fraction(1, 200))
    with pytest.raises(InputError, match="256 × 25600 px"):
        open_film(clip)


def test_the_shutters_rows_are_those_of_the_sensor(tmp_path):
    rig = Rig(camera=RigCamera(row_time_s=1e-5))
    blank = [np.zeros((48, 64, 3), np.uint8)] * 2
    for turn, row_time in ((0, 1e-5), (180, -1e-5)):
        film = open_film(encode(tmp_path / f"{turn}.mp4", blank, rotation=turn))
        assert rig_as_shown(rig, film).camera.row_time_s == pytest.approx(row_time)
    high = open_film(encode(tmp_path / "high.mp4", blank, aspect=Fraction(1, 2)))
    assert rig_as_shown(rig, high).camera.row_time_s == pytest.approx(0.5e-5)
    with pytest.raises(RigError, match="row_time_s"):
        rig_as_shown(rig, open_film(encode(tmp_path / "90.mp4", blank, rotation=90)))
