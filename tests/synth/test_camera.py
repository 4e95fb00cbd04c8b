"""The camera model against OpenCV's independent implementation."""

import cv2
import numpy as np
import pytest

from synth.camera import Pinhole, aim
from synth.spec import Spec

POINTS = np.random.default_rng(0).uniform(-0.12, 0.12, (50, 3))
RECORDINGS = [{"name": "a", "duration_s": 1.0, "command": {"kind": "step"}}]


def aimed(lever: float = 0.117, **sections) -> Pinhole:
    return aim(Spec.model_validate({"recordings": RECORDINGS, **sections}), lever)


def test_in_a_square_view_the_lever_has_the_specified_length_and_turns_about_one_pixel():
    camera = aimed(rig={"lever_px": 200, "pivot_px": [240.3, 299.6]})
    angles = np.radians(np.arange(-20, 30, 5.0))
    arm = 0.117 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    away = camera.project(arm) - [240.3, 299.6]
    np.testing.assert_allclose(np.hypot(*away.T), 200.0, atol=1e-9)
    np.testing.assert_allclose(np.arctan2(-away[:, 1], away[:, 0]), angles, atol=1e-12)
    for height in (-0.05, 0.09):
        np.testing.assert_allclose(camera.project([0, 0, height]), [240.3, 299.6], atol=1e-9)


@pytest.mark.parametrize("view", [{}, {"azimuth_deg": 25, "elevation_deg": -10}])
@pytest.mark.parametrize("tilt", [None, {"tilt_deg": 15, "axis_deg": 60}])
def test_projection_equals_opencvs(view, tilt):
    camera = aimed(camera=view, effects={"camera_tilt": tilt, "lens_distortion": {"k1": -0.15}})
    # OpenCV looks along +z with y down
    flip = np.diag([1.0, -1.0, -1.0])
    rotation, _ = cv2.Rodrigues(flip @ camera.rotation)
    matrix = np.array(
        [[camera.focal_px, 0, camera.principal_px[0]], [0, camera.focal_px, camera.principal_px[1]], [0, 0, 1]]
    )
    ideal, _ = cv2.projectPoints(POINTS, rotation, np.array([0.0, 0.0, camera.distance_m]), matrix, None)
    lens = np.array([[camera.focal_px, 0, camera.lens_px[0]], [0, camera.focal_px, camera.lens_px[1]], [0, 0, 1]])
    # a second camera applies the lens distortion to the ideal picture
    rays = np.hstack([(ideal[:, 0] - camera.lens_px) / camera.focal_px, np.ones((len(POINTS), 1))])
    distorted, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), lens, np.array([-0.15, 0, 0, 0]))
    np.testing.assert_allclose(camera.project(POINTS), distorted[:, 0], atol=1e-6)


def test_a_tilt_about_the_horizontal_looks_from_above_and_foreshortens_height():
    camera = aimed(effects={"camera_tilt": {"tilt_deg": 60, "axis_deg": 0}}, camera={"distance_m": 20})
    origin = camera.project([0, 0, 0])
    assert camera.project([0, 0.1, 0])[1] - origin[1] == pytest.approx(-0.1 * 0.5 * camera.focal_px / 20, rel=0.01)
    assert camera.project([0.1, 0, 0])[0] - origin[0] == pytest.approx(0.1 * camera.focal_px / 20, rel=0.01)
    assert camera.project([0, 0, 0.1])[1] > origin[1]  # from above, nearer points appear lower in the picture


def test_the_cameras_rotation_increases_measured_angles_and_its_vibration_shifts_the_picture():
    for facing, sign in (("right", 1), ("left", -1)):
        camera = aimed(rig={"facing": facing})
        still, moved = camera.project([0.1, 0, 0]), camera.shaken(0, 0, 0.01).project([0.1, 0, 0])
        assert moved[1] < still[1]
        shifted = camera.shaken(2.0, -1.0, 0.0).project([0.1, 0, 0])
        np.testing.assert_allclose(shifted - still, [2.0, -1.0], atol=1e-9)
        assert sign * (still[0] - camera.project([0, 0, 0])[0]) > 0


@pytest.mark.parametrize("facing", ["right", "left"])
def test_a_prop_appears_at_its_pixel(facing):
    camera = aimed(rig={"facing": facing})
    np.testing.assert_allclose(camera.project(camera.place((531.2, 77.7), 0.12)), [531.2, 77.7], atol=1e-9)
