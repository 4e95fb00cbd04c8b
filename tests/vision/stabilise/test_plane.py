"""Whether a plane that was followed moves before a camera in the hand, or is a body that turns."""

import cv2
import numpy as np
import pytest

from anglecam.vision.stabilise.plane import moves_in_the_hand, stands_still

SIZE = (480, 360)
TIME = np.linspace(0.0, 1.0, 40)


def _turned(turns_deg, pivot):
    return [np.vstack([cv2.getRotationMatrix2D(pivot, float(turn), 1.0), [0.0, 0.0, 1.0]]) for turn in turns_deg]


def _shifted(shifts):
    return [np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]) for x, y in shifts]


@pytest.mark.parametrize("pivot", [(240.0, 40.0), (240.0, -400.0)])
def test_a_body_that_turns_about_a_point_is_no_camera(pivot):
    assert not moves_in_the_hand(_turned(3.5 * np.sin(9.0 * TIME), pivot), SIZE)


def test_a_camera_that_moves_and_rolls_is_one():
    path = np.column_stack([30.0 * np.sin(5.0 * TIME), 20.0 * np.sin(3.0 * TIME)])
    moves = [a @ b for a, b in zip(_shifted(path), _turned(2.0 * np.sin(4.0 * TIME), (240.0, 180.0)), strict=True)]
    assert moves_in_the_hand([*moves, None], SIZE)


def test_noise_is_none():
    assert not moves_in_the_hand(_shifted(np.random.default_rng(1).normal(0.0, 0.8, (40, 2))), SIZE)


def test_scenery_is_found_in_its_place_or_not():
    rng = np.random.default_rng(2)
    wide = cv2.resize(rng.normal(128.0, 45.0, (60, 80)), (640, 480), interpolation=cv2.INTER_CUBIC)
    wide = np.repeat(np.clip(wide, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    rests = [np.clip(wide[:360, :480] + rng.normal(0, 2, (360, 480, 3)), 0, 255).astype(np.uint8) for _ in range(6)]
    moves = [wide[20 * k : 20 * k + 360, 30 * k : 30 * k + 480] for k in range(6)]
    assert stands_still(rests)
    assert not stands_still(moves)
