"""Of many proposals for one body one is fitted, of proposals for two bodies one for each, and it is followed."""

from __future__ import annotations

import cv2
import numpy as np

from anglecam.engine.competition import compete
from anglecam.engine.sample import Sample, sample_of
from anglecam.engine.score import Proposal
from anglecam.engine.tracking import candidates, search_for

CENTRES = np.array([[60.0, 40.0], [180.0, 40.0]])
TURNS = np.array([0.5 * np.sin(np.arange(24.0)), 0.4 * np.cos(0.7 * np.arange(24.0))])


def _sticks(turns: np.ndarray) -> Sample:
    """Draw a stick with a patch for each column of turns, each about its centre."""
    rng = np.random.default_rng(3)
    back = cv2.GaussianBlur(rng.uniform(60.0, 180.0, (130, 240)), (0, 0), 2.0)
    pictures = []
    for of_frame in turns.T:
        picture = back.copy()
        for (x, y), turn in zip(CENTRES, of_frame, strict=False):
            along = np.array([np.sin(turn), np.cos(turn)])
            for near, far, level in ((0.0, 60.0, 230.0), (30.0, 42.0, 20.0)):
                start, end = (np.round(16.0 * (np.array([x, y]) + d * along)).astype(int) for d in (near, far))
                cv2.line(picture, start.tolist(), end.tolist(), level, 7, cv2.LINE_AA, 4)
        pictures.append(picture + rng.normal(0.0, 2.0, back.shape))
    return sample_of(np.stack(pictures), np.arange(turns.shape[1]), 1.0, np.zeros(2))


def _off(body: int, seed: int) -> Proposal:
    """Return the motion of a stick with errors of some pixels."""
    rng = np.random.default_rng(seed)
    centre = CENTRES[body] + rng.normal(0.0, 4.0, 2)
    return Proposal(f"{body}", centre, TURNS[body] + rng.normal(0.0, 0.03, TURNS.shape[1]))


def test_of_many_proposals_for_one_body_one_is_fitted():
    found = compete(_sticks(TURNS[:1]), [_off(0, seed) for seed in range(8)])
    assert len(found) == 1
    assert found[0].turns
    assert np.hypot(*(found[0].fit.proposal.centre_px - CENTRES[0])) < 1.0


def test_of_two_bodies_each_is_fitted():
    found = compete(_sticks(TURNS), [_off(seed % 2, seed) for seed in range(8)])
    centres = np.array([one.fit.proposal.centre_px for one in found if one.turns])
    assert len(found) == 2
    for centre in CENTRES:
        assert np.hypot(*(centres - centre).T).min() < 1.0


def test_a_fitted_body_is_found_where_it_is_and_not_before_the_bare_background():
    sample = _sticks(TURNS[:1])
    fit = compete(sample, [_off(0, 1)])[0].fit
    search = search_for(sample, fit)
    for picture, turn in zip(sample.pictures, fit.proposal.turn, strict=True):
        assert abs(candidates(search, picture)[0].turn - turn) < 0.01
    noise = np.random.default_rng(5).normal(0.0, 2.0, sample.median.shape)
    assert candidates(search, (fit.target.background + noise).astype(np.float32)) == []
