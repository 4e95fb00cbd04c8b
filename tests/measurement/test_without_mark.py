"""Clips in which no mark is found: a body with texture is followed by its features, any other by its outline."""

import cv2
import numpy as np
import pytest

from anglecam.io.rig import Rig
from anglecam.measurement import followed, mark_pass
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from support import things

SWING = 20.0 * np.sin(2 * np.pi * np.arange(60) / 40.0)
PIVOT = (160.0, 60.0)


def _plate(scene, angle):
    """Draw a plate with a texture of bumps that swings about `PIVOT`."""
    rng = np.random.default_rng(5)
    bumps = cv2.resize(rng.uniform(60, 200, (18, 14)), (112, 144), interpolation=cv2.INTER_CUBIC).clip(0, 255)
    texture = cv2.resize(bumps.astype(np.uint8), None, fx=4, fy=4, interpolation=cv2.INTER_LINEAR)
    x, y = (4.0 * p + 1.5 for p in PIVOT)
    swing = cv2.getRotationMatrix2D((0.0, 0.0), np.degrees(angle), 1.0)
    swing[:, 2] = swing[:, :2] @ [-224.0, 0.0] + (x, y)
    size = scene.shape[1::-1]
    cover = cv2.warpAffine(np.full(texture.shape, 255, np.uint8), swing, size) > 127
    scene[cover] = cv2.warpAffine(texture, swing, size)[cover][:, None]


@pytest.mark.parametrize(
    ("draw", "by", "rms_deg"),
    [
        # a plate is also measured in `tests/vision/registration/test_pivot_wander.py`
        pytest.param(_plate, ("whole body",), 0.02, marks=pytest.mark.sweep),
        (things.stick((110, 112, 110), 14.0, PIVOT, 140.0), ("body", "whole body"), 0.1),
    ],
    ids=["plate", "stick"],
)
def test_a_body_without_a_mark_is_measured(tmp_path, monkeypatch, draw, by, rms_deg):
    monkeypatch.setattr(mark_pass, "find_mark", lambda *_, **__: None)
    swing = SWING + 0.4  # never exactly upright: whole pixels of the finer scene draw a bar 0.1 px aside there
    film = open_film(things.film(tmp_path / "clip.mkv", draw, swing))
    measured = measure_clip(film, Rig())
    assert measured.by in by
    assert measured.series.ok.all()
    error = np.degrees(measured.series.angle) - swing
    error -= np.median(error)
    assert np.sqrt((error**2).mean()) < rms_deg
    assert np.sqrt(((error / np.degrees(measured.series.sigma)) ** 2).mean()) < 1.5


def _with_blinking_mark(folder, shown, rig, rgb=(40, 160, 60)):
    """Measure a stick with a mark that is shown in so many of 12 frames."""
    seen = iter(np.arange(len(SWING)) % 12 < shown)

    def blinking(scene, angle):
        things.stick((120, 90, 60), 16.0, PIVOT, 130.0)(scene, angle)
        if next(seen):
            things.disc(scene, things.hanging(PIVOT, 115.0, angle), 9.0, rgb)

    return measure_clip(open_film(things.film(folder / "clip.mkv", blinking, SWING)), rig)


def test_a_stick_is_measured_where_its_mark_comes_and_goes(tmp_path):
    measured = _with_blinking_mark(tmp_path, 5, Rig())
    assert measured.doubt is None
    error = np.degrees(measured.series.angle) - SWING
    error -= np.nanmedian(error)
    assert measured.series.ok.mean() > 0.9
    assert np.sqrt(np.nanmean(error**2)) < 0.1


@pytest.mark.parametrize(("neutral", "by"), [(-90.0, "mark"), ("auto", "body")])
def test_a_mark_with_a_declared_neutral_is_kept_where_it_comes_and_goes(tmp_path, monkeypatch, neutral, by):
    monkeypatch.setattr(followed, "register_clip", lambda *_: "off")
    measured = _with_blinking_mark(tmp_path, 9, Rig(neutral=neutral), (200, 30, 30))
    ok = measured.series.ok
    assert measured.by == by
    assert ok.mean() == pytest.approx(0.75 if by == "mark" else 1.0, abs=0.05)
    error = (np.degrees(measured.series.angle) - SWING)[ok]
    assert np.abs(error if by == "mark" else error - np.median(error)).max() < 1.0
