"""A zoom of the camera is told from a shift, a roll and a body that moves."""

import cv2
import numpy as np
import pytest

from anglecam.vision.stabilise.zoom import camera_zoom
from support.drawn import Look, draw_frames


def _filmed(scale=lambda k: 1.0, shift=lambda k: 0.0, roll_deg=lambda k: 0.0):
    images = []
    for k, image in enumerate(draw_frames(Look(), 15.0 * np.sin(np.arange(10)))):
        height, width = image.shape[:2]
        matrix = cv2.getRotationMatrix2D((width / 2, height / 2), roll_deg(k), scale(k))
        matrix[:, 2] += shift(k)
        images.append(cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=1))
    return images


@pytest.mark.parametrize("most", [1.01, 1.03])
def test_a_zoom_is_found_with_its_size(most):
    found = camera_zoom(_filmed(scale=lambda k: 1.0 + (most - 1.0) * k / 9.0))
    assert found.factor == pytest.approx(most, abs=0.2 * (most - 1.0))


def test_a_body_that_moves_a_shift_and_a_roll_are_no_zoom():
    assert camera_zoom(_filmed()) is None
    assert camera_zoom(_filmed(shift=lambda k: 3.0 * np.sin(k), roll_deg=lambda k: 1.0 * np.cos(k))) is None
    assert camera_zoom([]) is None
