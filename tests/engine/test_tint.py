"""What differs from its surroundings in colour alone is seen, and what light changes is not."""

from __future__ import annotations

import cv2
import numpy as np

from anglecam.engine.learn import looks
from anglecam.engine.sample import Stills
from anglecam.engine.tint import tint_of, tinted
from anglecam.io.rig import Rig
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from support import things

SWING = 25.0 * np.sin(2 * np.pi * np.arange(60) / 40.0)
BLUE_GREEN_RED = np.array([0.114, 0.587, 0.299])
"""Shares of the brightness."""


def _as_bright(draw, colour):
    """Draw a thing that multiplies the colours of what is behind it, and leaves its brightness as it is."""
    factors = np.array(colour) / (BLUE_GREEN_RED @ np.array(colour))

    def drawn(scene, angle):
        shape = np.zeros_like(scene)
        draw(shape, angle)
        scene[:] = np.where(shape.max(axis=2, keepdims=True) > 0, np.clip(scene * factors, 0, 255), scene)

    return drawn


def _before_shadows(draw, factor):
    """Draw a thing on which shadows with soft edges fall, each time somewhere else."""
    at = iter(np.arange(60) * 613 % 1280)

    def drawn(scene, angle):
        draw(scene, angle)
        across = np.abs(np.arange(scene.shape[1]) - next(at) - 0.3 * np.arange(scene.shape[0])[:, None])
        scene[:] = scene * (1.0 - (1.0 - factor) / (1.0 + np.exp((across[..., None] - 160.0) / 24.0)))

    return drawn


def test_a_stick_as_bright_as_the_wall_is_seen_by_its_colour(tmp_path):
    draw = _as_bright(things.stick((255, 255, 255), 12.0), (1.25, 0.95, 1.0))
    film = open_film(things.film(tmp_path / "clip.mkv", draw, SWING, relief=8.0))
    shown = film.sample(48).frames
    images, frames = [one.image for one in shown], np.array([one.index for one in shown])
    by_brightness, by_colour = (
        list(looks(Stills(images, [None] * len(images), frames, tint))) for tint in (None, tint_of(images))
    )
    assert not any(look.turns for look in by_brightness)
    first = by_colour[0].explanations[0]
    assert first.turns
    off = np.degrees(first.fit.proposal.turn) - SWING[by_colour[0].sample.frames]
    assert np.std(off) < 0.3
    assert np.hypot(*(first.fit.proposal.centre_px - (160.0, 30.0))) < 2.0


def test_a_stick_is_measured_while_shadows_pass(tmp_path):
    draw = _before_shadows(things.stick((150, 120, 60), 12.0), 0.4)
    measured = measure_clip(open_film(things.film(tmp_path / "clip.mkv", draw, SWING, relief=8.0)), Rig())
    series = measured.series
    assert measured.doubt is None
    assert series.ok.mean() > 0.9
    error = (np.degrees(series.angle) - SWING)[series.ok]
    assert np.std(error) < 0.1
    assert np.median(np.abs(error - np.median(error)) / np.degrees(series.sigma[series.ok])) < 1.0


def test_light_changes_no_tint():
    rng = np.random.default_rng(2)
    wall = np.full((80, 100, 3), (110.0, 140.0, 160.0)) + rng.normal(0.0, 5.0, (80, 100, 1))
    pictures = []
    for k in range(12):
        picture = wall.copy()
        cv2.circle(picture, (20 + 5 * k, 40), 8, (60.0, 150.0, 170.0), -1)
        light = 1.0 - 0.5 * np.exp(-(((np.arange(100) - 8.0 * k) / 20.0) ** 2))[:, None]
        pictures.append(np.clip(picture * light + rng.normal(0.0, 1.0, picture.shape), 0, 255).astype(np.uint8))
    tint = tint_of(pictures)
    seen = np.stack([tinted(picture, tint) for picture in pictures])
    assert np.abs(seen[:, :25] - 128.0).mean() < 3.0  # the wall
    assert (np.abs(seen[range(12), 40, 20 + 5 * np.arange(12)] - 128.0) > 20.0).all()  # the disc


def test_a_grey_film_has_no_tint():
    rng = np.random.default_rng(3)
    assert tint_of([np.repeat(rng.integers(0, 255, (40, 60, 1), np.uint8), 3, axis=2) for _ in range(12)]) is None
