"""What turns before a light changes its brightness; what is only displaced does not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy import ndimage

from anglecam.engine.sample import Sample, sample_of
from anglecam.engine.score import Proposal, score
from anglecam.engine.shading import shading_of, without_motion
from anglecam.engine.target_learning import learn_target

CENTRE = np.array([60.0, 60.0])
TURN = np.radians(97.0) * np.arange(36)
NOISE = 1.0


def _star(turn: float, shade: float, seed: int) -> np.ndarray:
    """Draw five spokes, each brighter by a share the more it points upwards, and a mark on one of them, 120 × 120."""
    back = cv2.GaussianBlur(np.random.default_rng(1).uniform(40.0, 90.0, (120, 120)), (0, 0), 3.0)
    picture = back.astype(np.float32)
    for spoke in range(5):
        along = turn + 2.0 * np.pi * spoke / 5.0
        tip = CENTRE + 45.0 * np.array([np.cos(along), -np.sin(along)])
        level = 130.0 * (1.0 + shade * np.sin(along))
        cv2.line(picture, (60, 60), tuple(np.round(tip).astype(int).tolist()), level, 9)
        if spoke == 0:
            cv2.circle(picture, tuple(np.round(0.7 * tip + 0.3 * CENTRE).astype(int).tolist()), 3, 20.0, -1)
    return picture + np.random.default_rng(seed).normal(0.0, NOISE, back.shape).astype(np.float32)


def _sample(shade: float) -> Sample:
    pictures = np.stack([_star(turn, shade, k) for k, turn in enumerate(TURN)])
    return sample_of(pictures, np.arange(len(TURN)), 1.0, np.zeros(2))


@pytest.fixture(scope="module")
def lit() -> Sample:
    return _sample(0.3)


def _gain(sample: Sample, turn: np.ndarray, *, lit: bool) -> float:
    proposal = Proposal("", CENTRE, turn)
    nothing = score(sample, "", [None] * len(turn))
    return score(sample, "", proposal.poses(sample), lit=lit).total - nothing.total


def test_with_the_light_the_true_turns_explain_more_than_those_that_jump_back_by_a_spoke(lit):
    fifth = 2.0 * np.pi / 5.0
    jumps = TURN - fifth * np.round(TURN / fifth)
    assert _gain(lit, jumps, lit=False) > _gain(lit, TURN, lit=False)  # each spoke is as bright as the last one there
    assert _gain(lit, TURN, lit=True) > _gain(lit, jumps, lit=True)


def test_how_much_the_brightness_changes_is_found(lit):
    target = learn_target(lit, Proposal("", CENTRE, TURN).poses(lit), np.arange(len(TURN)), lit=True)
    spokes = [CENTRE + 20.0 * np.array([np.cos(a), -np.sin(a)]) for a in 2.0 * np.pi * np.arange(5) / 5.0]
    for place in spokes:
        column, row = np.round(place + target.pad).astype(int)
        amplitude = float(np.hypot(*target.shading[:, row, column]))
        assert amplitude == pytest.approx(0.3 * 130.0, rel=0.15)


def test_under_even_light_hardly_any_pixel_changes():
    even = _sample(0.0)
    target = learn_target(even, Proposal("", CENTRE, TURN).poses(even), np.arange(len(TURN)), lit=True)
    inside = cv2.erode(target.visibility, np.ones((3, 3))) > 0.0
    assert (np.hypot(*target.shading)[inside] > 5.0).mean() < 0.05


def test_what_a_displaced_centre_adds_is_not_taken_for_light():
    rng = np.random.default_rng(2)
    appearance = cv2.GaussianBlur(rng.uniform(0.0, 255.0, (40, 40)), (0, 0), 2.5).astype(np.float32)
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    lights = np.column_stack([np.cos(angles), np.sin(angles)]).astype(np.float32)
    moved = np.stack([ndimage.shift(appearance, (0.2 * s, 0.2 * c), order=5) for c, s in lights])
    variance = np.full((40, 40), 1.0, np.float32)
    found = shading_of(moved, np.median(moved, axis=0), variance, lights, 0.5)[:, 4:-4, 4:-4]
    left = without_motion(found, appearance[4:-4, 4:-4], variance[4:-4, 4:-4])
    # the slopes are those of a slightly smoothed picture, so that not all of it is known
    assert np.sqrt((left**2).mean()) < np.sqrt((found**2).mean()) / 3.0
