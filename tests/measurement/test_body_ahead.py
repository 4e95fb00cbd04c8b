"""A long film, whose body is learnt from evenly spaced frames, is measured as a short one, in one reading."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from anglecam.measurement import registration_pass
from anglecam.measurement.clip import measure_clip
from anglecam.video import film_rows
from anglecam.video.open_film import open_film
from support.drawn import Look, draw_frames, write_clip
from support.films import FADING, rig_of

SWING = FADING.angle
N = len(SWING)
TIME = np.arange(N) / 30


@pytest.fixture(scope="module")
def look():
    return FADING.look


@pytest.fixture(scope="module")
def clip(films):
    return films.film(FADING)


@pytest.fixture(scope="module")
def short(look, films):
    return films.measured(FADING, rig_of(look)).series


@pytest.fixture
def long(monkeypatch):
    """Let the films be too long to be kept: every second frame is."""
    monkeypatch.setattr(film_rows, "MOST_BYTES", N * 640 * 480)


def _off(series, angle):
    off = np.degrees(series.angle)[series.ok] - angle[series.ok]
    return off - np.median(off), np.degrees(series.sigma)[series.ok]


def test_a_long_film_is_measured_as_a_short_one(clip, short, look, long, monkeypatch):
    readings = []
    monkeypatch.setattr(registration_pass, "learn_from_frames", lambda *args: readings.append(args))
    film = open_film(clip)
    assert film.thinned() is not None
    measured = measure_clip(film, rig_of(look))
    assert measured.by == "whole body"
    assert not readings  # what was learnt ahead is used
    series = measured.series
    assert series.ok.sum() == short.ok.sum() == N
    off, sigma = _off(series, SWING)
    of_short, _ = _off(short, SWING)
    assert off.std() < 1.3 * of_short.std()
    assert np.sqrt(np.mean((off / sigma) ** 2)) < 1.5


@pytest.mark.sweep  # one that points to the right is measured above
def test_a_body_that_points_to_the_left_is_learnt_ahead(long, tmp_path, monkeypatch):
    left = Look(facing="left", neutral_deg=2.0)  # its directions are on both sides of 180°
    path = tmp_path / "clip.avi"
    write_clip(path, draw_frames(left, SWING, TIME, seed=6))
    monkeypatch.setattr(registration_pass, "learn_from_frames", lambda *args: "not again")
    measured = measure_clip(open_film(path), rig_of(left))
    assert measured.by == "whole body"
    assert measured.series.ok.all()
    off, sigma = _off(measured.series, SWING)
    assert np.sqrt(np.mean((off / sigma) ** 2)) < 1.5


def test_frames_in_which_the_mark_is_hidden_are_measured_afterwards(look, long, tmp_path):
    frames = list(draw_frames(look, SWING, TIME, seed=4))
    marks = look.mouth(SWING)
    hidden = np.arange(70, 76)
    for k in hidden:
        x, y = np.round(marks[k]).astype(int)
        cv2.circle(frames[k], (int(x), int(y)), 26, (60, 120, 60), -1)
    path = tmp_path / "clip.avi"
    write_clip(path, iter(frames))
    series = measure_clip(open_film(path), rig_of(look)).series
    seen = np.setdiff1d(np.arange(N), hidden)
    assert series.ok[seen].all()
    off, sigma = _off(series, SWING)
    assert (np.abs(off) < 4.5 * sigma).all()


def test_a_film_whose_evenly_spaced_frames_show_too_few_poses_is_learnt_as_a_whole(look, tmp_path, monkeypatch):
    steps = np.repeat([0.0, 8.0], [60, 90])
    steps[60:76] = 8.0 * (1.0 - np.cos(np.pi * np.arange(16) / 16)) / 2.0
    path = tmp_path / "clip.avi"
    write_clip(path, draw_frames(look, steps, seed=5))
    short = measure_clip(open_film(path), rig_of(look)).series
    monkeypatch.setattr(film_rows, "MOST_BYTES", 30 * 640 * 480)
    series = measure_clip(open_film(path), rig_of(look)).series
    np.testing.assert_allclose(series.angle, short.angle, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(series.sigma, short.sigma, rtol=1e-6)
