"""A pivot that wanders from frame to frame: its variance, and the angle of a body filmed by a shaking hand."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from anglecam.io.rig import Rig
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from anglecam.vision.registration.pivot_wander import frame_displacements, pivot_wander
from support.drawn import write_clip

FRAMES, BIRGE2 = 100, 4.0
FINER, SHAKE_PX = 4, 0.2


def equations(wander_px: float, seed: int, seen: float = 10.0):
    """Draw normal matrices and scores of frames whose place is displaced and whose scores are noisy."""
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(FRAMES, 3, 8)) * np.array([300.0, seen, seen])[:, None]
    normal = roots @ roots.transpose(0, 2, 1)
    off = np.column_stack([rng.normal(0.0, 1e-3, FRAMES), rng.normal(0.0, wander_px, (FRAMES, 2))])
    noise = np.sqrt(BIRGE2) * np.einsum("nij,nj->ni", roots, rng.normal(size=(FRAMES, 8)))
    return normal, np.einsum("nij,nj->ni", normal, off) + noise


@pytest.mark.parametrize("wander", [0.2, 0.5, 3.0])
def test_the_wander_is_found_beside_turn_and_noise(wander):
    found = [pivot_wander(*equations(wander, seed), BIRGE2) for seed in range(20)]
    assert np.mean(found) == pytest.approx(wander, rel=0.06)
    assert np.std(found) < 0.15 * wander


def test_a_pivot_at_rest_does_not_wander():
    assert [pivot_wander(*equations(0.0, seed), BIRGE2) for seed in range(200)] == [0.0] * 200
    # where a frame's place is known to 0.7 px only, the likeliest wander is often above the least that counts
    assert [pivot_wander(*equations(0.0, seed, seen=1.0), BIRGE2) for seed in range(200)] == [0.0] * 200


def test_a_wander_within_the_errors_of_codecs_is_noise():
    assert [pivot_wander(*equations(0.05, seed, seen=100.0), BIRGE2) for seed in range(20)] == [0.0] * 20


def test_each_frame_s_displacement_is_found_beside_its_turn():
    rng = np.random.default_rng(3)
    off = np.column_stack([rng.normal(0.0, 1e-3, FRAMES), rng.normal(0.0, 0.5, (FRAMES, 2))])
    normal, _ = equations(0.5, 3)
    found = frame_displacements(normal, np.einsum("nij,nj->ni", normal, off), BIRGE2, 0.5)
    assert np.std(found - off[:, 1:]) < 0.03  # the prior, for pixels of twice the noise, shrinks it by 2 %


def test_a_plate_before_a_blank_wall_in_a_shaking_hand_has_an_honest_angle(tmp_path):
    rng = np.random.default_rng(0)
    turn = np.radians(25.0 * np.sin(np.linspace(0.0, 12.0, 90)))
    shake = rng.normal(0.0, SHAKE_PX, (90, 2))
    spots = rng.uniform([100.0, -60.0], [240.0, 60.0], (30, 2))
    write_clip(tmp_path / "clip.avi", [_plate(a, s, spots, rng) for a, s in zip(turn, shake, strict=True)])
    measured = measure_clip(open_film(tmp_path / "clip.avi"), Rig())
    assert measured.angles.registered is not None
    assert measured.angles.registered.appearance.wander_px == pytest.approx(SHAKE_PX, rel=0.2)
    error = measured.series.angle - turn
    error -= error.mean()
    assert np.std(error) < 0.7 * SHAKE_PX / 170.0  # the shake's effect on the line from the pivot to the plate
    assert 0.7 < np.sqrt(np.mean((error / measured.series.sigma) ** 2)) < 1.4


def _plate(turn: float, shake_px: np.ndarray, spots_px: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw a spotted plate on a rod, finer than the picture, and let the pixels average it."""
    outline = np.array([[0, -6], [90, -6], [90, -70], [250, -70], [250, 70], [90, 70], [90, 6], [0, 6]], float)
    c, s = np.cos(turn), np.sin(turn)
    to_picture = np.array([[c, -s], [s, c]])
    fine = np.full((480 * FINER, 640 * FINER), 170, np.uint8)

    def fixed(places: np.ndarray) -> np.ndarray:
        return np.round(((places @ to_picture + [160.0, 240.0] + shake_px) + 0.5) * FINER * 16 - 8).astype(np.int32)

    cv2.fillPoly(fine, [fixed(outline)], 120, cv2.LINE_AA, 4)
    for k, spot in enumerate(fixed(spots_px)):
        cv2.circle(fine, spot.tolist(), 6 * FINER * 16, 60 + 5 * k, -1, cv2.LINE_AA, 4)
    grey = cv2.resize(fine, (640, 480), interpolation=cv2.INTER_AREA).astype(float)
    noisy = grey[..., None] + rng.normal(0.0, 2.0, (480, 640, 3))
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)
