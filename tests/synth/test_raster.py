"""The rasteriser against areas computed by hand, against brute-force sampling, and against itself."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from synth.camera import Pinhole
from synth.draw.depth import project
from synth.draw.light import AMBIENT, LAMPS
from synth.draw.raster import Raster
from synth.mechanism import Part, build, poses
from synth.spec import Spec

SPEC = Spec(recordings=[{"name": "r", "duration_s": 1.0, "command": {"kind": "step"}}])
QUALITIES = ("draft", "standard", "metrology")
ONE_QUALITY = [pytest.param(q, marks=() if q == "standard" else pytest.mark.sweep) for q in QUALITIES]
SLANTED = Rotation.from_euler("yxz", [0.2, -0.15, 0.1]).as_matrix()
STILL = {"ground": np.eye(4)}
SQUARE_ON = (AMBIENT + sum(strength * lamp[2] / math.hypot(*lamp) for lamp, strength in LAMPS)) ** (1 / 2.2)
"""Factor on the grey level of a sheet that faces the camera."""


def pinhole(width: int, height: int, lever_px: float = 200.0, rotation: np.ndarray | None = None) -> Pinhole:
    """Return a camera whose pivot has the same relative position as in a picture of 640 x 480."""
    at = (240.0 / 640 * width, 300.0 / 480 * height)
    return Pinhole((width, height), lever_px * 1.5 / 0.115, at, 1.5, np.eye(3) if rotation is None else rotation)


def sheet(camera: Pinhole, corners: list[tuple[float, float]], z: float, grey: float, name: str = "sheet") -> Part:
    """Return a flat convex polygon at height z from its corners in pixels, clockwise in the picture."""
    places = np.array([camera.place(corner, z) for corner in corners])
    return slanted_sheet(places, grey, name)


def slanted_sheet(places: np.ndarray, grey: float, name: str) -> Part:
    faces = [[0, k + 1, k] for k in range(1, len(places) - 1)]
    normals = np.tile([0.0, 0.0, 1.0], (len(places), 1))
    mesh = trimesh.Trimesh(places, faces, vertex_normals=normals, process=False)
    return Part(name, "ground", mesh, np.full((len(places), 3), grey))


def box(left: float, top: float, right: float, bottom: float) -> list[tuple[float, float]]:
    return [(left, top), (right, top), (right, bottom), (left, bottom)]


def draw(parts: list[Part], camera: Pinhole, quality: str = "standard", gamma: float = 1.0) -> np.ndarray:
    return Raster(parts, camera, quality, gamma).draw(camera, STILL, slice(0, camera.size[1]))


def test_vertices_appear_at_the_cameras_projection():
    rng = np.random.default_rng(3)
    camera = dataclasses.replace(pinhole(640, 480, rotation=SLANTED), k1=-0.3)
    vertices, body = rng.uniform(-0.15, 0.15, (500, 3)), rng.integers(0, 3, 500).astype(np.int32)
    placed = np.zeros((3, 3, 4))
    placed[:, :, :3], placed[:, :, 3] = rng.uniform(-1, 1, (3, 3, 3)), rng.uniform(-0.1, 0.1, (3, 3))
    pixels, inverse_depth = np.empty((500, 2)), np.empty(500)
    project(
        vertices, body, camera.rotation @ placed, camera.distance_m, camera.focal_px,
        np.array(camera.principal_px), np.array(camera.lens_px), camera.k1, pixels, inverse_depth,
    )  # fmt: skip
    world = np.einsum("nij,nj->ni", placed[body][:, :, :3], vertices) + placed[body][:, :, 3]
    expected, depth = camera.draw(world)
    np.testing.assert_allclose(pixels, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(1 / inverse_depth, depth, rtol=1e-12)


@pytest.mark.parametrize("quality", ["standard", "metrology"])
def test_three_layers_share_a_pixel_by_their_visible_areas(quality):
    camera = pinhole(32, 24)
    layers = [
        sheet(camera, box(0, 0, 16.0, 20), 0.03, 200.0, "left half of pixel 16"),
        sheet(camera, box(0, 0, 30.0, 12.0), 0.02, 100.0, "upper half of row 12"),
        sheet(camera, box(15.75, 0, 30.0, 20), 0.01, 50.0, "right three quarters of pixel 16"),
    ]
    for order in ([0, 1, 2], [2, 1, 0], [1, 2, 0]):
        seen = draw([layers[k] for k in order], camera, quality)[12, 16]
        np.testing.assert_allclose(seen, SQUARE_ON * (200 / 2 + 100 / 4 + 50 / 4) / 255, rtol=1e-6)


def test_a_needle_between_the_centres_of_pixels_counts_with_its_area():
    camera = pinhole(32, 24)
    needle = sheet(camera, box(10.2, 5.0, 10.3, 15.0), 0.01, 255.0)
    seen = draw([needle], camera)[:, :, 0]
    expected = np.zeros((24, 32))
    expected[5:16, 10] = 0.1
    expected[[5, 15], 10] = 0.05
    np.testing.assert_allclose(seen, expected, atol=1e-6)  # light above white is clipped


def test_bodies_that_pass_through_each_other_meet_on_a_straight_line():
    camera = pinhole(32, 24)
    crossing = camera.place((15.3, 12.0), 0.0)
    corners = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * 8 * camera.distance_m / camera.focal_px
    places = [np.column_stack([corners, slope * corners[:, 0]]) + crossing for slope in (0.5, -0.5)]
    seen = draw([slanted_sheet(places[0], 200.0, "one"), slanted_sheet(places[1], 100.0, "two")], camera)[12]
    # the camera is above: to the left of the line the falling sheet is nearer, to the right the rising sheet
    share = np.clip(np.arange(10, 21) + 0.5 - 15.3, 0, 1)
    np.testing.assert_allclose(seen[10:21, 0], SQUARE_ON * (100 + 100 * share) / 255, rtol=1e-6)


def test_three_sheets_that_overlap_in_a_circle_are_resolved():
    camera = pinhole(32, 24)
    centre, scale = camera.place((15.0, 12.0), 0.0), camera.distance_m / camera.focal_px
    # each of three strips rises along its length, so that each is above the next and below the one before
    strips = []
    for k in range(3):
        turn = Rotation.from_euler("z", 120 * k, degrees=True).as_matrix()
        strip = np.array([[-9, 3, -1], [9, 3, 1], [9, 1, 1], [-9, 1, -1]]) * [scale, scale, 4 * scale]
        strips.append(slanted_sheet(strip @ turn.T + centre, 80.0 + 60 * k, f"strip {k}"))
    expected = sampled(strips, camera, STILL, 64)
    np.testing.assert_allclose(draw(strips, camera), expected, atol=0.01)
    np.testing.assert_array_equal(draw(strips[::-1], camera), draw(strips, camera))


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_light_is_that_of_the_shader(gamma):
    camera = pinhole(32, 24)
    patch = sheet(camera, box(2, 2, 29, 21), 0.0, 120.0)
    patch.mesh.vertex_normals = np.tile([0.6, 0.0, 0.8], (4, 1))
    turned = Rotation.from_euler("z", 0.7).as_matrix()
    pose = np.eye(4)
    pose[:3, :3] = turned
    seen = Raster([patch], camera, "standard", gamma).draw(camera, {"ground": pose}, slice(0, 24))[9, 12]
    falling = AMBIENT + sum(
        strength * max(0.0, turned @ [0.6, 0.0, 0.8] @ np.divide(lamp, math.hypot(*lamp))) for lamp, strength in LAMPS
    )
    grey = ((120 / 255) ** 2.2 * falling) ** (1 / 2.2)
    np.testing.assert_allclose(seen, grey**gamma, rtol=1e-6)


def test_light_of_a_large_slanted_triangle_is_affine_in_space_not_in_the_picture():
    camera = pinhole(64, 48)
    corners = np.array([[-0.008, -0.004, -0.3], [0.008, -0.004, 0.3], [0.0, 0.008, 0.0]])
    part = slanted_sheet(corners[[0, 2, 1]], 0.0, "slope")
    part.colours[:] = np.array([[50.0], [150.0], [250.0]])[[0, 2, 1]]
    middle = np.array([0.3, 0.5, 0.2])
    (x, y), _ = camera.draw(middle @ corners)
    shifted = dataclasses.replace(
        camera, principal_px=(camera.principal_px[0] + round(x) - x, camera.principal_px[1] + round(y) - y)
    )
    seen = Raster([part], camera, "draft", 1.0).draw(shifted, STILL, slice(0, 48))[round(y), round(x)]
    np.testing.assert_allclose(seen, SQUARE_ON * (middle @ [50.0, 150.0, 250.0]) / 255, rtol=1e-6)


@pytest.mark.parametrize("quality", ONE_QUALITY)
def test_bands_of_rows_are_the_whole_picture_bit_for_bit(quality):
    camera = dataclasses.replace(pinhole(160, 120, 50.0, SLANTED), k1=0.2)
    raster, placed = Raster(build(SPEC), camera, quality, 1.0), poses(SPEC.rig, 0.2)
    whole = raster.draw(camera, placed, slice(0, 120))
    borders = [0, 1, 2, 9, 40, 41, 85, 119, 120]
    bands = [raster.draw(camera, placed, slice(a, b)) for a, b in itertools.pairwise(borders)]
    np.testing.assert_array_equal(np.concatenate(bands), whole)
    assert raster.draw(camera, placed, slice(5, 5)).shape == (0, 160, 3)


@pytest.mark.parametrize("quality", ONE_QUALITY)
def test_a_layer_of_what_does_not_move_leaves_every_bit_as_it_is(quality):
    rest, rows = dataclasses.replace(pinhole(160, 120, 50.0, SLANTED), k1=0.2), slice(0, 120)
    parts = build(SPEC)
    shaken, raster = rest.shaken(0.4, -0.7, 0.01), Raster(parts, rest, quality, 1.0)
    # the layer is drawn with the second picture from one place, and again after the camera has moved
    views = [(rest, 0.0, rows), (rest, 0.2, rows), (rest, -0.2, rows), (rest, 0.1, slice(20, 70)), (rest, 0.1, rows)]
    for camera, angle, band in [*views, (shaken, 0.1, rows), (shaken, 0.12, rows), *views]:
        placed = poses(SPEC.rig, angle)
        alone = Raster(parts, rest, quality, 1.0).draw(camera, placed, band)
        np.testing.assert_array_equal(raster.draw(camera, placed, band), alone)


def test_the_same_scene_gives_the_same_bits_again():
    camera, placed = pinhole(160, 120, 50.0), poses(SPEC.rig, 0.1)
    first = Raster(build(SPEC), camera, "standard", 2.2)
    one = first.draw(camera, placed, slice(0, 120))
    first.draw(camera, poses(SPEC.rig, -0.2), slice(30, 60))
    np.testing.assert_array_equal(first.draw(camera, placed, slice(0, 120)), one)
    np.testing.assert_array_equal(Raster(build(SPEC), camera, "standard", 2.2).draw(camera, placed, slice(0, 120)), one)


def test_the_rig_agrees_with_brute_force_as_far_as_samples_go():
    camera, placed = pinhole(80, 60, 25.0, SLANTED), poses(SPEC.rig, 0.15)
    parts = build(SPEC)
    fine, coarse = sampled(parts, camera, placed, 16), sampled(parts, camera, placed, 8)
    drawn = {q: Raster(parts, camera, q, 1.0).draw(camera, placed, slice(0, 60)) for q in QUALITIES}
    rms = {q: float(np.sqrt(np.mean((drawn[q] - fine) ** 2))) for q in QUALITIES}
    # 8 x 8 samples have twice the error of 16 x 16 at straight edges: exact areas must be nearer to 16 x 16
    sampling = float(np.sqrt(np.mean((coarse - fine) ** 2)))
    assert rms["metrology"] < 0.7 * sampling
    assert rms["metrology"] < rms["standard"] < rms["draft"] / 4
    # a sample represents 1/16 of an edge's path through the pixel, ± half of it, and two edges may meet
    assert np.abs(drawn["metrology"] - fine).max() < 2 / 32


def sampled(parts: list[Part], camera: Pinhole, placed: dict[str, np.ndarray], times: int) -> np.ndarray:
    """Return the mean light of times x times samples in each pixel, from a depth buffer over all triangles."""
    width, height = camera.size
    light, depths = np.zeros((height * times, width * times, 3)), np.zeros((height * times, width * times))
    for part in parts:
        pose = placed[part.body]
        pixels, depth = camera.draw(part.mesh.vertices @ pose[:3, :3].T + pose[:3, 3])
        normals = part.mesh.vertex_normals @ pose[:3, :3].T
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        falling = AMBIENT + sum(s * np.maximum(normals @ lamp / math.hypot(*lamp), 0) for lamp, s in LAMPS)
        shade = np.minimum(part.colours / 255 * falling[:, None] ** (1 / 2.2), 1.0)
        samples = (pixels + 0.5) * times - 0.5
        ahead, behind = (samples[part.mesh.faces[:, k]] - samples[part.mesh.faces[:, 0]] for k in (1, 2))
        areas = ahead[:, 0] * behind[:, 1] - behind[:, 0] * ahead[:, 1]
        for face, area in zip(part.mesh.faces[areas < 0], areas[areas < 0], strict=True):
            (xa, ya), (xb, yb), (xc, yc) = samples[face]
            left, top = np.maximum(np.ceil(samples[face].min(axis=0)), 0).astype(int)
            right, bottom = np.minimum(samples[face].max(axis=0) + 1, [width * times, height * times]).astype(int)
            if left >= right or top >= bottom:
                continue
            x, y = np.arange(left, right), np.arange(top, bottom)[:, None]
            b = ((x - xa) * (yc - ya) - (xc - xa) * (y - ya)) / area
            c = ((xb - xa) * (y - ya) - (x - xa) * (yb - ya)) / area
            weights = np.stack([1 - b - c, b, c], axis=-1) / depth[face]
            nearness = weights.sum(axis=-1)
            window = slice(top, bottom), slice(left, right)
            nearer = (b >= 0) & (c >= 0) & (b + c <= 1) & (nearness > depths[window])
            depths[window][nearer] = nearness[nearer]
            light[window][nearer] = (weights @ shade[face])[nearer] / nearness[nearer, None]
    return light.reshape(height, times, width, times, 3).mean(axis=(1, 3))
