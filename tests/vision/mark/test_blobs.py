"""Blobs: connected patches, cut out of their picture."""

import cv2
import numpy as np

from anglecam.vision.mark.blobs import find_blobs


def _picture() -> np.ndarray:
    """Return a ring, a disc inside it, and a bar at the picture's edge."""
    picture = np.zeros((160, 240), np.float32)
    cv2.circle(picture, (50, 40), 24, 50.0, 4)
    cv2.circle(picture, (50, 40), 8, 50.0, -1)
    picture[60:66, 220:] = 50.0
    return picture


def test_a_blobs_mask_is_its_connected_component():
    picture = _picture()
    above = (picture > 20.0).astype(np.uint8)
    (blobs,) = find_blobs([picture], [20.0], 0.0, lambda _, place: place)
    _, labels = cv2.connectedComponents(above, connectivity=8)
    assert len(blobs.area) == 3
    for k, (x, y) in enumerate(blobs.pixel_px):
        whole = np.zeros(picture.shape, np.uint8)
        mask, part = blobs.mask(k, picture, 20.0, 7)
        whole[part] = mask
        np.testing.assert_array_equal(whole, labels == labels[y, x])
        assert mask.sum() == blobs.area[k]
    rows, columns = blobs.mask(int(np.argmax(blobs.picture_px[:, 0])), picture, 20.0, 7)[1]
    assert (rows.start, rows.stop, columns.start, columns.stop) == (53, 73, 213, 240)


def test_a_blobs_contrast_is_the_75th_percentile_of_its_box_to_the_bit():
    for seed in range(12):
        rough = np.random.default_rng(seed).standard_normal((90, 120)).astype(np.float32)
        picture = 30.0 * cv2.GaussianBlur(rough, (0, 0), 2.0)
        (blobs,) = find_blobs([picture], [3.0], 1.5, lambda _, place: place)
        for contrast, (x, y, w, h) in zip(blobs.contrast, blobs.box_px, strict=True):
            part = picture[y : y + h, x : x + w]
            assert contrast == np.percentile(part[part > 3.0], 75) - np.float32(1.5)
