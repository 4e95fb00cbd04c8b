"""The colours that move, and those of a thing that is pointed at, are found whatever they are."""

import cv2
import numpy as np
import pytest

from anglecam.vision.mark.cues import closeness, moving_cues, pointed_cues

WALL = (172, 178, 170)


def _frame(place, rgb, size=20, static=None):
    image = np.empty((120, 160, 3), np.uint8)
    image[:] = WALL[::-1]
    if static is not None:
        image[90:110, 10:30] = static[::-1]
    x, y = place
    image[y : y + size, x : x + size] = rgb[::-1]
    rng = np.random.default_rng(x)
    return np.clip(image + rng.normal(0.0, 2.0, image.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("rgb", [(30, 30, 32), (245, 245, 244), (110, 112, 110), (60, 165, 65)])
def test_the_colour_of_what_moves_is_among_the_cues_and_that_of_what_rests_is_not(rgb):
    static = (30, 40, 200)
    cues = moving_cues([_frame((20 + 12 * k, 30), rgb, static=static) for k in range(8)])
    assert min(np.abs(np.subtract(cue.rgb, rgb)).max() for cue in cues) < 12
    assert all(np.abs(np.subtract(cue.rgb, static)).max() > 60 for cue in cues)


def test_nothing_moves_in_equal_frames():
    assert moving_cues([_frame((40, 40), (30, 30, 32))] * 8) == []


@pytest.mark.parametrize("box", [(50.0, 50.0, 50.0, 50.0), (36.0, 36.0, 64.0, 64.0)])
def test_the_colour_at_a_point_or_in_a_box_is_that_of_the_thing_and_not_of_the_wall(box):
    cues = pointed_cues(_frame((40, 40), (200, 120, 30)), np.array(box))
    assert np.abs(np.subtract(cues[0].rgb, (200, 120, 30))).max() < 10
    assert all(np.abs(np.subtract(cue.rgb, WALL)).max() > 20 for cue in cues)


def test_a_box_outside_the_picture_has_no_colours():
    assert pointed_cues(_frame((40, 40), (200, 120, 30)), np.array([300.0, 10.0, 320.0, 30.0])) == []


def test_closeness_is_the_distance_in_lab():
    lab = cv2.cvtColor(np.array([[[0, 0, 0], [255, 255, 255]]], np.uint8), cv2.COLOR_BGR2LAB)
    np.testing.assert_allclose(closeness(lab, (0, 0, 0)), [[0.0, -100.0]], atol=0.5)
