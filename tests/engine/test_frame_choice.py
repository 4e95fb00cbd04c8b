"""Frames are chosen where something moves; frames at rest show nothing new."""

from __future__ import annotations

import cv2
import numpy as np

from anglecam.engine.frame_choice import spread_over_motion, thumbnail


def _film(turns: np.ndarray) -> list[np.ndarray]:
    """Return thumbnails of a bar that turns, 160 × 120, with noise of two grey levels."""
    rng = np.random.default_rng(0)
    pictures = []
    for turn in turns:
        picture = np.full((120, 160), 150.0)
        end = np.array([80.0, 60.0]) + 45.0 * np.array([np.cos(turn), np.sin(turn)])
        cv2.line(picture, (80, 60), tuple(end.round().astype(int).tolist()), 60.0, 5, cv2.LINE_AA)
        noisy = np.clip(picture + rng.normal(0.0, 2.0, picture.shape), 0, 255).astype(np.uint8)
        pictures.append(thumbnail(noisy))
    return pictures


def test_frames_at_rest_are_left_out():
    turns = np.concatenate([np.zeros(100), np.sin(0.3 * np.arange(60))])
    chosen = spread_over_motion(_film(turns), 40)
    assert len(chosen) == 40
    assert (chosen < 100).sum() <= 2
    assert np.diff(chosen[chosen >= 100]).max() <= 4


def test_frames_are_evenly_spread_where_all_move():
    chosen = spread_over_motion(_film(np.sin(0.3 * np.arange(120))), 40)
    assert len(chosen) == 40
    assert chosen[0] == 0
    assert np.diff(chosen).max() <= 5


def test_frames_at_rest_are_not_taken_where_few_move():
    turns = np.concatenate([np.zeros(90), np.linspace(0.0, 0.8, 10)])
    chosen = spread_over_motion(_film(turns), 40)
    assert 9 <= len(chosen) <= 12
    assert (chosen >= 90).sum() >= 9


def test_a_film_at_rest_has_one_frame():
    assert spread_over_motion(_film(np.zeros(7)), 40).tolist() == [0]
