"""On drawn samples the true motion predicts held-out frames better than anything it may be mistaken for."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from anglecam.engine.sample import Sample, Stills, in_light, sample_of, sample_stills, steady_light
from anglecam.engine.score import NOTHING, Proposal, score
from anglecam.engine.target_learning import learn_target

CENTRE = np.array([60.0, 20.0])
TURN = 0.4 * np.sin(np.arange(24))


def _bar(turn: float, seed: int, noise: float = 2.0) -> np.ndarray:
    """Draw a bar with three patches that hangs from `CENTRE`, before a background with texture, 120 × 100."""
    rng = np.random.default_rng(7)
    back = cv2.GaussianBlur(rng.uniform(60.0, 180.0, (100, 120)), (0, 0), 3.0)
    body, seen = np.zeros((100, 120)), np.zeros((100, 120))
    body[20:75, 55:66] = 30.0
    seen[20:75, 55:66] = 1.0
    for top, level in ((30, 200.0), (45, 120.0), (60, 240.0)):
        body[top : top + 8, 56:63] = level
    turned = cv2.getRotationMatrix2D((60.0, 20.0), np.degrees(turn), 1.0)
    seen, body = (cv2.warpAffine(one, turned, (120, 100), flags=cv2.INTER_LINEAR) for one in (seen, body * seen))
    picture = body + (1.0 - seen) * back + np.random.default_rng(seed).normal(0.0, noise, back.shape)
    return picture.astype(np.float32)


def _sample(turns: np.ndarray) -> Sample:
    pictures = np.stack([_bar(turn, seed) for seed, turn in enumerate(turns)])
    return sample_of(pictures, np.arange(len(turns)), 1.0, np.zeros(2))


@pytest.fixture(scope="module")
def swing() -> Sample:
    return _sample(TURN)


def test_the_true_turns_predict_better_than_others(swing):
    true = Proposal("true", CENTRE, TURN)
    best = score(swing, "true", true.poses(swing))
    for name, centre, turn in (
        ("another centre", CENTRE + [0.0, 10.0], TURN),
        ("too little", CENTRE, 0.7 * TURN),
        ("another order", CENTRE, np.roll(TURN, 1)),
        ("the other way", CENTRE, -TURN),
    ):
        other = Proposal(name, centre, turn)
        assert best.lead(score(swing, name, other.poses(swing))) > 3.0
    assert best.lead(score(swing, NOTHING, [None] * len(TURN))) > 6.0


def test_a_small_error_of_the_turn_costs_likelihood(swing):
    off = TURN + np.radians(2.0) * np.where(np.arange(len(TURN)) % 3, 1.0, -1.0)
    true, wrong = (score(swing, "", Proposal("", CENTRE, turn).poses(swing)) for turn in (TURN, off))
    assert true.lead(wrong) > 3.0


def test_a_hand_that_covers_the_way_of_a_body_is_no_rival_of_it():
    turn = np.concatenate([np.full(12, 0.35), TURN])
    pictures = [_bar(t, seed) for seed, t in enumerate(turn)]
    for picture in pictures[:12]:
        cv2.circle(picture, (60, 66), 9, 235.0, -1)
    held = sample_of(np.stack(pictures), np.arange(36), 1.0, np.zeros(2))
    true = score(held, "true", Proposal("true", CENTRE, turn).poses(held))
    hand = score(held, "hand", [np.eye(2, 3) if k < 12 else None for k in range(36)])
    assert true.lead(hand) > 10.0


def test_a_frame_in_which_neither_shows_its_body_says_nothing(swing):
    few = [pose if k % 4 < 2 else None for k, pose in enumerate(Proposal("few", CENTRE, TURN).poses(swing))]
    found, nothing = score(swing, "few", few), score(swing, NOTHING, [None] * len(TURN))
    unseen = np.arange(len(TURN)) % 4 >= 2
    better = replace(found, density=np.where(unseen[:, None, None], found.density + 1.0, found.density))
    assert found.lead(nothing) > 6.0
    assert better.over(nothing) == found.over(nothing)


@pytest.mark.parametrize("seed", range(5))
def test_where_nothing_moves_a_turn_is_no_better(seed):
    pictures = np.stack([_bar(0.0, 100 * seed + k) for k in range(24)])
    still = sample_of(pictures, np.arange(24), 1.0, np.zeros(2))
    turn = 0.3 * np.random.default_rng(seed).standard_normal(24)
    found = score(still, "turns", Proposal("turns", CENTRE, turn).poses(still))
    nothing = score(still, NOTHING, [None] * 24)
    assert found.lead(nothing) < 2.0


def test_the_body_is_seen_where_it_is_and_the_background_behind_it(swing):
    poses = Proposal("true", CENTRE, TURN).poses(swing)
    target = learn_target(swing, poses, np.arange(24))
    inside = np.zeros(target.visibility.shape, bool)
    inside[target.pad + 20 : target.pad + 75, target.pad + 55 : target.pad + 66] = True
    around = cv2.dilate(inside.astype(np.uint8), np.ones((5, 5))) > 0
    assert target.visibility[inside].mean() > 0.9
    assert target.visibility[~around].sum() < inside.sum()  # stray pixels are where body and background look alike
    expected = _bar(TURN[3], 0, noise=0.0)
    off = (target.predict(poses[3])[0] - expected)[20:80, 30:90]
    assert np.median(np.abs(off)) < 1.0


def test_light_that_changes_is_taken_out():
    gains = 1.0 + 0.2 * np.sin(np.arange(24) / 2.0)
    lit = np.stack([g * _bar(t, k) for k, (g, t) in enumerate(zip(gains, TURN, strict=True))])
    steady = np.stack([_bar(t, k) for k, t in enumerate(TURN)])
    ratio = steady_light(lit)[:, 80:, :] / steady[:, 80:, :]
    assert np.abs(np.median(ratio, axis=(1, 2)) / np.median(ratio) - 1.0).max() < 0.01


@pytest.mark.parametrize("brighter", [1.2, 1.4])
def test_a_saturated_picture_says_that_the_light_is_as_bright_at_least(brighter):
    """A bright frame shows a wall white, and what is dark before it moves: the light follows from both."""
    rng = np.random.default_rng(0)
    seen = np.full((2, 120, 160), 205.0)
    seen[:, :10, 10:20] = seen[:, :10, 140:150] = seen[0, 30:110, 78:82] = 60.0
    for row in range(30, 110):
        seen[1, row, 78 + int((110 - row) * 0.4) :][:4] = 60.0
    median, moved = np.float32(seen)
    across, down = np.meshgrid(np.linspace(-1.0, 1.0, 160), np.linspace(-1.0, 1.0, 120))
    light = brighter * (1.0 + 0.05 * across) * (1.0 - 0.15 * down**2)
    picture = np.clip(moved * light + rng.normal(0.0, 2.0, moved.shape), 0.0, 255.0)
    off = np.abs(in_light(np.float32(picture), median) / moved - 1.0)
    wall = (moved > 100.0) & (median > 100.0)
    assert off[wall].max() < 0.12
    assert off[moved < 100.0].mean() < 0.2


def test_a_sample_is_cut_to_what_changes():
    pictures = [np.full((480, 640, 3), 90, np.uint8) for _ in range(12)]
    for k, picture in enumerate(pictures):
        cv2.circle(picture, (300 + 4 * k, 200), 12, (0, 0, 200), -1)
    frames = np.arange(12)
    sample, *closer = sample_stills(Stills(pictures, [None] * 12, frames))
    shown = np.array(sample.median.shape[::-1])
    assert sample.place(np.array([322.0, 200.0])) == pytest.approx(shown / 2.0, abs=6.0 * sample.scale)
    assert sample.corner_px[0] > 250
    assert closer == []
    assert sample_stills(Stills([pictures[0]] * 12, [None] * 12, frames)) == []
