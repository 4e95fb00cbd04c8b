"""The closed-form areas, and each quality's edge error against them."""

import math

import numpy as np
import pytest

from synth.draw.edge_error import disc_area, edge_error, half_plane_area, half_plane_chord
from synth.draw.raster import Raster

FINE = (np.arange(400) + 0.5) / 400 - 0.5


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, math.pi / 4, 2.0, -1.1])
def test_half_plane_area_is_the_share_of_fine_samples(angle):
    normal = np.array([math.cos(angle), math.sin(angle)])
    distances = np.linspace(-0.8, 0.8, 33) + 1e-3
    samples = FINE[:, None] * normal[0] + FINE[None, :] * normal[1]
    counted = [(samples > -distance).mean() for distance in distances]
    np.testing.assert_allclose(half_plane_area(distances, normal), counted, atol=2.6e-3)  # one row of 400


def test_the_chord_is_the_slope_of_the_area():
    normal, distances = np.array([math.cos(0.4), math.sin(0.4)]), np.linspace(-0.9, 0.9, 50)
    slope = (half_plane_area(distances + 1e-6, normal) - half_plane_area(distances - 1e-6, normal)) / 2e-6
    np.testing.assert_allclose(half_plane_chord(distances, normal), slope, atol=1e-5)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.3, 0.4), (2.9, 0.1), (-2.2, 2.0), (0.2, -3.1), (3.4, 0.0)])
def test_disc_area_is_the_share_of_fine_samples(x, y):
    inside = (x + FINE[:, None]) ** 2 + (y + FINE[None, :]) ** 2 < 3.0**2
    np.testing.assert_allclose(disc_area(x, y, 3.0), inside.mean(), atol=2.6e-3)


def test_the_pixels_of_a_disc_add_up_to_its_area():
    y, x = np.mgrid[-30:31, -30:31].astype(float)
    assert disc_area(x - 0.37, y + 0.21, 24.3).sum() == pytest.approx(math.pi * 24.3**2, rel=1e-13)


@pytest.mark.parametrize("quality", ["standard", "metrology"])
def test_exact_areas_are_exact_to_single_precision(quality):
    error = edge_error(Raster, quality)
    assert error.half_plane_px < 1e-7
    assert error.half_plane_fit_px < 1e-8
    # the disc is a polygon of 1024 sides within 1e-4 px of the circle, several sides per pixel
    assert error.disc_px < 1e-5
    assert error.disc_centre_px < 1e-7
    assert error.worst_px < 1e-4


def test_an_engine_that_samples_pixel_centres_has_uniform_errors_of_up_to_half_a_pixel():
    error = edge_error(Raster, "draft", trials=100)
    # uniform over the pixel's width |nx| + |ny| along the normal, weighted by the chord: slightly below 1/√12
    assert error.half_plane_px == pytest.approx(0.28, abs=0.01)
    assert error.disc_px == pytest.approx(error.half_plane_px, abs=0.01)
    assert error.worst_px > 0.45


def test_a_displaced_edge_is_measured_with_its_displacement():
    class Shifted(Raster):
        def draw(self, camera, poses, rows):
            moved = {name: pose.copy() for name, pose in poses.items()}
            moved["shape"][0, 3] += 0.01 * camera.distance_m / camera.focal_px
            return super().draw(camera, moved, rows)

    error = edge_error(Shifted, "standard")
    assert error.disc_centre_px == pytest.approx(0.01 / math.sqrt(2), rel=1e-3)  # RMS of x and y, moved in x alone
    assert error.half_plane_fit_px == pytest.approx(0.01 / math.sqrt(2), rel=0.05)  # mean of cos² of the angles


def test_quantisation_to_bytes_hardly_changes_the_edge_error():
    class Bytes(Raster):
        def draw(self, camera, poses, rows):
            return np.rint(super().draw(camera, poses, rows) * 255) / np.float32(255)

    error = edge_error(Bytes, "standard")
    assert 0.5 / 255 / math.sqrt(12) < error.half_plane_px < 2 / 255 / math.sqrt(12)
    assert error.half_plane_fit_px < error.half_plane_px / 5
