"""Whether a camera stands still, from frames spread over a clip."""

import cv2
import numpy as np
import pytest

from anglecam.vision.stabilise.scenery import find_scenery


def test_no_pictures_show_no_scenery():
    assert find_scenery([]) is None


def _room_with_a_plate(rolls_deg, swings_deg):
    """Picture bumps with a large textured plate in front that swings about its upper edge, all rolled by the camera."""
    rng = np.random.default_rng(3)
    wall, texture = (
        cv2.resize(rng.uniform(90, 200, shape), size, interpolation=cv2.INTER_CUBIC)
        for shape, size in (((24, 32), (400, 300)), ((17, 15), (200, 220)))
    )
    for roll, swing in zip(rolls_deg, swings_deg, strict=True):
        picture = wall.copy()
        motion = cv2.getRotationMatrix2D((100.0, 10.0), float(swing), 1.0)
        motion[:, 2] += (100.0, 30.0)
        cover = cv2.warpAffine(np.ones(texture.shape), motion, (400, 300)) > 0.5
        picture[cover] = cv2.warpAffine(texture, motion, (400, 300), flags=cv2.INTER_CUBIC)[cover]
        rolled = cv2.getRotationMatrix2D((199.5, 149.5), float(roll), 1.0)
        seen = cv2.warpAffine(picture, rolled, (400, 300), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        yield np.clip(seen + rng.normal(0.0, 2.0, seen.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("amplitude_deg", [0.0, 1.5])
def test_a_camera_that_rolls_around_its_middle_is_told_from_a_large_body_that_swings(amplitude_deg):
    k = np.arange(24)
    rolls = amplitude_deg * np.sin(k / 3.0)
    found = find_scenery(list(_room_with_a_plate(rolls, 14.0 * np.sin(k / 2.1))))
    assert found is not None
    assert found.shakes == (amplitude_deg > 0.0)
    np.testing.assert_allclose(np.degrees(found.rolls), rolls - rolls[0], atol=0.05)
