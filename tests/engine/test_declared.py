"""What is declared becomes a proposal: the marked patch is followed, and centres near the hinted pivot are tried."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from anglecam.engine.hints import NO_HINTS, Hints
from anglecam.engine.proposals import declared
from anglecam.engine.sample import sample_of

CENTRE, ARM = np.array([80.0, 25.0]), 70.0
TURN = 0.5 * np.sin(np.arange(30))


@pytest.fixture(scope="module")
def sample():
    """Return a film of a spotted ball that swings about `CENTRE`, 160 × 120."""
    rng = np.random.default_rng(5)
    back = cv2.GaussianBlur(rng.uniform(90.0, 150.0, (120, 160)), (0, 0), 3.0)
    spots = cv2.GaussianBlur(rng.uniform(0.0, 255.0, (21, 21)), (0, 0), 2.0)
    pictures = []
    for turn in TURN:
        x, y = CENTRE + ARM * np.array([np.sin(turn), np.cos(turn)])
        onto = cv2.getRotationMatrix2D((10.0, 10.0), np.degrees(turn), 1.0)
        onto[:, 2] += [x - 10.0, y - 10.0]
        disc = cv2.circle(np.zeros((21, 21)), (10, 10), 9, 1.0, -1)
        seen, body = (cv2.warpAffine(one, onto, (160, 120)) for one in (disc, disc * spots))
        pictures.append(body + (1.0 - seen) * back + rng.normal(0.0, 2.0, back.shape))
    return sample_of(np.stack(pictures), np.arange(len(TURN)), 1.0, np.zeros(2))


def _off(proposal):
    """Return the errors of a proposal's centre, px, and of its turns, rad RMS, and in how many frames it has one."""
    error = proposal.turn - TURN
    known = np.isfinite(error)
    return np.hypot(*(proposal.centre_px - CENTRE)), float(np.std(error[known])), int(known.sum())


def test_the_marked_patch_is_followed(sample):
    at = CENTRE + ARM * np.array([np.sin(TURN[3]), np.cos(TURN[3])]) + 2.0
    found = declared.proposals(sample, Hints(mark_px=np.array([*at, *at]), mark_frame=3))
    off = [_off(one) for one in found]
    assert any(px < 4.0 and turn < 0.05 and seen > 20 for px, turn, seen in off)


def test_centres_near_the_hinted_pivot_are_tried(sample):
    off = [_off(one) for one in declared.proposals(sample, Hints(pivot_px=CENTRE + [6.0, -8.0], pivot_sigma_px=10.0))]
    assert any(px < 8.0 and turn < 0.05 for px, turn, _ in off)  # from there the fit goes on


def test_without_hints_nothing_is_declared(sample):
    assert declared.proposals(sample, NO_HINTS) == []
