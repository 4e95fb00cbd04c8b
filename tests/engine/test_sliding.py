"""A slide is fitted as well as the turn that it may be mistaken for."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from anglecam.engine.refine import refine
from anglecam.engine.sample import Sample, sample_of
from anglecam.engine.score import Proposal, score
from anglecam.engine.sliding import slide_of

SHIFT = 14.0 * np.sin(0.7 * np.arange(32))
FAR = np.array([60.0, 400.0])


def _box(shift: np.ndarray, turn: float, seed: int) -> np.ndarray:
    """Draw a box with two patches, 120 × 90, that is turned about `FAR` and shifted, before a wall."""
    rng = np.random.default_rng(seed)
    wall = cv2.GaussianBlur(np.random.default_rng(7).uniform(120.0, 180.0, (90, 120)), (0, 0), 3.0)
    body, seen = np.zeros((90, 120)), np.zeros((90, 120))
    body[38:56, 46:74], seen[38:56, 46:74] = 40.0, 1.0
    body[42:48, 50:56], body[46:52, 62:70] = 220.0, 140.0
    turned = cv2.getRotationMatrix2D(tuple(FAR.tolist()), np.degrees(turn), 1.0)
    turned[:, 2] += shift
    seen, body = (cv2.warpAffine(one, turned, (120, 90), flags=cv2.INTER_LINEAR) for one in (seen, body * seen))
    return (body + (1.0 - seen) * wall + rng.normal(0.0, 2.0, wall.shape)).astype(np.float32)


def _sample(pictures: list[np.ndarray]) -> Sample:
    return sample_of(np.stack(pictures), np.arange(len(pictures)), 1.0, np.zeros(2))


def test_what_slides_is_found_where_it_is():
    axis = np.array([14.0, 4.0]) / 14.0
    sample = _sample([_box(s * axis, 0.0, k) for k, s in enumerate(SHIFT)])
    fit = refine(sample, Proposal("far", FAR, -SHIFT / 350.0))
    assert fit is not None
    lever = np.hypot(*(fit.proposal.centre_px - [60.0, 47.0]))
    off = replace(fit.proposal, turn=fit.proposal.turn + 1.5 / lever * np.cos(2.0 * np.arange(32)))
    slide = slide_of(sample, replace(fit, proposal=off))
    found = np.array([pose[:, 2] @ axis / (axis @ axis) for pose in slide.poses if pose is not None])
    assert np.std(found - SHIFT[fit.seen]) < 0.5  # the step of the search; 1.1 where it begins
    assert score(sample, "turns", fit.proposal.poses(sample)).lead(slide.score) < 5.0


def test_the_line_of_a_slide_is_found_where_that_of_the_turns_is_another():
    axis = np.array([14.0, 4.0]) / 14.0
    sample = _sample([_box(s * axis, 0.0, k) for k, s in enumerate(SHIFT)])
    fit = refine(sample, Proposal("far", FAR, -SHIFT / 350.0))
    assert fit is not None
    lever = np.hypot(*(fit.proposal.centre_px - [60.0, 47.0]))
    aside = replace(fit.proposal, centre_px=fit.proposal.centre_px + 0.1 * lever * axis)  # a line that is 6° off
    across = np.array([-axis[1], axis[0]]) / np.hypot(*axis)

    def off_px(poses):
        found = np.array([pose[:, :2] @ [60.0, 47.0] + pose[:, 2] for pose in poses if pose is not None])
        return np.abs((found - found.mean(axis=0)) @ across).max()

    assert off_px(aside.poses(sample)) > 1.0
    assert off_px(slide_of(sample, replace(fit, proposal=aside)).poses) < 0.3


def test_what_turns_is_not_taken_for_a_slide():
    sample = _sample([_box(np.zeros(2), 0.07 * np.sin(0.7 * k), k) for k in range(32)])
    fit = refine(sample, Proposal("far", FAR, 0.07 * np.sin(0.7 * np.arange(32))))
    assert fit is not None
    turns = score(sample, "turns", fit.proposal.poses(sample))
    assert turns.lead(slide_of(sample, fit).score) > 10.0
