"""Rectified points turn by the same angle as the points in the plane of motion."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from anglecam.camera.calibration import Calibration, read_calibration, write_calibration
from anglecam.camera.lens import Lens, lens_from_rig
from anglecam.camera.shutter import BLUR_SHARE, blur_error, mean_off_middle, measurement_time
from anglecam.errors import InputError, RigError
from anglecam.io.rig import Rig, read_rig

SIZE = (640, 480)
PIVOT = np.array([240.0, 300.0])
MIDDLE = np.array([319.5, 239.5])
ANGLES = np.radians(np.linspace(-60.0, 80.0, 57))


def _calibration(k1: float = -0.15, focal: float = 800.0, size=SIZE, **more) -> Calibration:
    matrix = np.array([[focal, 0.0, MIDDLE[0]], [0.0, focal, MIDDLE[1]], [0.0, 0.0, 1.0]])
    return Calibration(size, matrix, np.array([k1, 0.0, 0.0, 0.0, 0.0]), **more)


def _filmed(tilt_deg=0.0, axis_deg=0.0, k1=0.0, focal=800.0, radius=200.0, height=0.0, mirrored=False) -> np.ndarray:
    """Return pixels (n, 2) of a mark that turns about `PIVOT` by `ANGLES`, projected from space through the lens."""
    axis = np.radians(axis_deg)
    turn = Rotation.from_rotvec(np.radians(tilt_deg) * np.array([np.cos(axis), np.sin(axis), 0.0]))
    around = radius * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    mark = turn.apply(np.column_stack([around, np.full(len(ANGLES), height)]) / focal)
    seen = PIVOT + focal * mark[:, :2] * [1.0, -1.0] / (1.0 - mark[:, 2:])
    if mirrored:
        seen[:, 0] = 2 * PIVOT[0] - seen[:, 0]
    off = (seen - MIDDLE) / focal
    return seen + focal * off * k1 * (off**2).sum(axis=1, keepdims=True)


def _turned(lens: Lens, mark_px: np.ndarray) -> np.ndarray:
    arm = (lens.rectify(mark_px) - lens.pivot_px) * [1.0, -1.0]
    return np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))


def _rig(**camera) -> Rig:
    return Rig.model_validate({"camera": camera, "pivot": {"near": list(PIVOT)}})


def test_nothing_declared_changes_no_point():
    lens = lens_from_rig(Rig(), SIZE, None)
    points = np.array([[3.0, 4.0], [np.nan, 5.0]])
    assert lens.is_identity
    np.testing.assert_array_equal(lens.rectify(points), points)
    np.testing.assert_array_equal(lens.distort(points), points)
    np.testing.assert_array_equal(lens.jacobian(points), [np.eye(2), np.eye(2)])
    assert not lens.covariance(points).any()


@pytest.mark.parametrize("axis_deg", [0.0, 60.0, 90.0, -35.0])
@pytest.mark.parametrize("tilt_deg", [15.0, -40.0])
def test_a_declared_tilt_leaves_the_angle_exact_with_and_without_a_focal_length(tilt_deg, axis_deg):
    seen = _filmed(tilt_deg, axis_deg)
    for focal in ({}, {"focal_px": 800.0}):
        lens = lens_from_rig(_rig(tilt_deg=tilt_deg, tilt_axis_deg=axis_deg, **focal), SIZE, None)
        np.testing.assert_allclose(_turned(lens, seen), ANGLES, atol=1e-9)
        radius = np.hypot(*(lens.rectify(seen) - lens.pivot_px).T)
        if focal:
            np.testing.assert_allclose(radius, 200.0, atol=1e-8)
        else:  # what weak perspective neglects is as large as the docstring says
            assert lens.neglects_perspective
            assert np.abs(radius - 200.0).max() < 1.2 * 200.0**2 * abs(np.sin(np.radians(tilt_deg))) / 800.0


def test_facing_left_mirrors_the_tilts_axis():
    seen = _filmed(15.0, 60.0, mirrored=True)
    rig = Rig.model_validate(
        {"facing": "left", "camera": {"tilt_deg": 15, "tilt_axis_deg": 60}, "pivot": {"near": list(PIVOT)}}
    )
    lens = lens_from_rig(rig, SIZE, None)
    off = np.pi - _turned(lens, seen) - ANGLES
    np.testing.assert_allclose(off - 2 * np.pi * np.round(off / (2 * np.pi)), 0.0, atol=1e-9)


@pytest.mark.parametrize("height", [30.0, -60.0])
def test_nearer_points_turn_by_the_same_angle_about_a_different_centre(height):
    lens = lens_from_rig(_rig(tilt_deg=15, tilt_axis_deg=60, focal_px=800.0), SIZE, None)
    cosine = np.cos(np.radians(15.0))
    centre = lens.pivot_px + lens.parallax * height * cosine / (cosine - height / 800.0)
    arm = (lens.rectify(_filmed(15.0, 60.0, height=height)) - centre) * [1.0, -1.0]
    np.testing.assert_allclose(np.unwrap(np.arctan2(arm[:, 1], arm[:, 0])), ANGLES, atol=1e-9)
    assert np.ptp(np.hypot(*arm.T)) < 1e-8


def _circle(places: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the centre of the circle through places (n, 2), px, and the scatter of their distances from it."""
    solution = np.linalg.lstsq(np.column_stack([2.0 * places, np.ones(len(places))]), (places**2).sum(axis=1))[0]
    distance = np.hypot(*(places - solution[:2]).T)
    return solution[:2], float(np.std(distance))


def test_a_line_of_sight_to_another_height_of_the_axis_leans_otherwise():
    declared = lens_from_rig(_rig(tilt_deg=15, tilt_axis_deg=60, focal_px=800.0), SIZE, None)
    lens = declared.looking_at(_filmed(15.0, 60.0, radius=0.0, height=30.0)[0], 30.0)
    assert np.degrees(lens.tilt_sigma) == pytest.approx(0.56, abs=0.01)
    path = _filmed(15.0, 60.0)
    _, off = _circle(lens.rectify(path))
    leaning = [dataclasses.replace(lens, tilt=lens.tilt + sign * lens.tilt_sigma) for sign in (1.0, -1.0)]
    assert min(_circle(one.rectify(path))[1] for one in leaning) < 0.1 * off


def test_an_unknown_focal_length_displaces_the_centre_by_as_much_as_is_stated():
    focal = SIZE[0] / 0.7
    path = _filmed(15.0, 60.0, focal=focal)
    lens = lens_from_rig(_rig(tilt_deg=15, tilt_axis_deg=60), SIZE, None)
    displaced = _circle(lens.rectify(path))[0] - lens.pivot_px
    stated = lens.neglected_displacement(200.0, SIZE[0])
    np.testing.assert_allclose(-displaced, stated, rtol=0.03)


def test_distortion_and_tilt_together_are_undone(tmp_path):
    write_calibration(_calibration(), tmp_path / "c.yaml")
    rig = _rig(calibration=str(tmp_path / "c.yaml"), tilt_deg=15, tilt_axis_deg=60)
    pivot = MIDDLE + (PIVOT - MIDDLE) * (1 - 0.15 * ((PIVOT - MIDDLE) ** 2).sum() / 800.0**2)
    lens = lens_from_rig(rig, SIZE, None).looking_at(pivot)
    np.testing.assert_allclose(lens.pivot_px, PIVOT, atol=1e-6)
    np.testing.assert_allclose(_turned(lens, _filmed(15.0, 60.0, k1=-0.15)), ANGLES, atol=1e-8)


def test_rectified_points_return_to_where_they_came_from():
    lens = Lens(_calibration(-0.25, 600.0), tilt=0.5, tilt_axis=1.0, focal_px=600.0, pivot_px=(240.0, 300.0))
    points = np.random.default_rng(0).uniform([0, 0], SIZE, (4, 50, 2))
    points[1, 3] = np.nan
    np.testing.assert_allclose(lens.distort(lens.rectify(points)), points, atol=1e-7)
    assert lens.rectify(np.empty((0, 2))).shape == (0, 2)


def test_the_jacobian_carries_a_small_shift():
    lens = Lens(_calibration(), tilt=0.3, tilt_axis=0.7, focal_px=800.0, pivot_px=(240.0, 300.0))
    points, shift = np.array([[100.0, 50.0], [500.0, 400.0]]), np.array([0.01, -0.02])
    moved = lens.rectify(points + shift) - lens.rectify(points)
    np.testing.assert_allclose(lens.jacobian(points) @ shift, moved, atol=1e-6)


def test_stated_uncertainties_reach_the_rectified_angle_as_repeated_calibrations_would():
    rng = np.random.default_rng(1)
    spread = np.diag([2.0, 2.0, 1.5, 1.0, 0.005, 0.0, 0.0, 0.0, 0.0])
    mixing = np.eye(9)
    mixing[0, 4], mixing[1, 4] = 0.6, 0.6
    root = mixing @ spread
    nominal = Lens(_calibration(covariance=root @ root.T), np.radians(15.0), 0.8, np.radians(0.5), 800.0, (240, 300))
    seen = _filmed(15.0, 45.0, k1=-0.15)

    def nod(lens: Lens) -> np.ndarray:
        return _turned(lens.looking_at(PIVOT), seen) - _turned(lens.looking_at(PIVOT), seen)[20]

    predicted = np.sqrt(sum((nod(d) - nod(nominal)) ** 2 for d in nominal.deviants()))
    drawn = []
    for _ in range(400):
        step = root @ rng.normal(size=9)
        c = nominal.calibration
        matrix = c.camera_matrix.copy()
        matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += step[:4]
        other = dataclasses.replace(c, camera_matrix=matrix, distortion=c.distortion + step[4:])
        tilt = nominal.tilt + nominal.tilt_sigma * rng.normal()
        drawn.append(nod(dataclasses.replace(nominal, calibration=other, tilt=tilt, focal_px=other.focal_px)))
    # 400 draws know a standard deviation to 3.5 %
    np.testing.assert_allclose(np.std(drawn, axis=0)[[0, 40, 56]], predicted[[0, 40, 56]], rtol=0.11)
    assert predicted[20] == 0.0


@pytest.mark.parametrize("ending", ["yaml", "xml", "json"])
def test_what_opencv_writes_can_be_read(tmp_path, ending):
    path = tmp_path / f"camera.{ending}"
    store = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    store.write("image_width", 640)
    store.write("image_height", 480)
    store.write("camera_matrix", _calibration().camera_matrix)
    store.write("dist_coeffs", np.array([[-0.15, 0.02, 0.001, -0.002]]))
    store.release()
    back = read_calibration(path)
    assert back.size == SIZE
    np.testing.assert_array_equal(back.camera_matrix, _calibration().camera_matrix)
    np.testing.assert_array_equal(back.distortion, [-0.15, 0.02, 0.001, -0.002])
    assert back.covariance is None


def test_what_ros_writes_can_be_read(tmp_path):
    path = tmp_path / "head_camera.yaml"
    path.write_text(
        "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
        "  data: [800, 0, 319.5, 0, 800, 239.5, 0, 0, 1]\ndistortion_model: plumb_bob\n"
        "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.15, 0, 0, 0, 0]\n"
    )
    assert read_calibration(path).focal_px == 800.0


def test_our_own_file_keeps_every_digit(tmp_path):
    written = _calibration(covariance=np.diag(np.arange(9) / 7.0), rms_px=0.1 / 3.0, views=17)
    write_calibration(written, tmp_path / "c.yaml")
    back = read_calibration(tmp_path / "c.yaml")
    np.testing.assert_array_equal(back.covariance, written.covariance)
    assert (back.rms_px, back.views, back.size) == (written.rms_px, 17, SIZE)
    assert back.sigma("k1") == pytest.approx(np.sqrt(4 / 7))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "cannot be read"),
        ("", "not a calibration"),
        ("mouth: [", "not a calibration"),
        ("- 1\n- 2\n", "no keys"),
        ("mouth: auto\n", "no camera_matrix"),
        ("camera_matrix: [1, 2, 3]\ndist_coeffs: [0, 0, 0, 0]\n", "expected 3×3 numbers, found 3"),
        ("camera_matrix: [8, 0, 3, 0, 8, 2, 0, 0, 1]\n", "no distortion_coefficients"),
        ("camera_matrix: [8, 0, 3, 0, 8, 2, 0, 0, 1]\ndist_coeffs: [0, 0, 0]\n", "found 3"),
        ("camera_matrix: [8, 0, 3, 0, 8, 2, 0, 0, a]\ndist_coeffs: [0, 0, 0, 0]\n", "3×3 numbers"),
        ("camera_matrix: [-8, 0, 3, 0, 8, 2, 0, 0, 1]\ndist_coeffs: [0, 0, 0, 0]\n", "rows fx 0 cx"),
        ("camera_matrix: [8, 0, 3, 0, 8, 2, 0, 0, 1]\nD: [0, 0, 0, 0]\ndistortion_model: equidistant\n", "fisheye"),
    ],
)
def test_a_file_that_is_not_a_calibration_is_refused_in_one_line(tmp_path, text, said, capfd):
    path = tmp_path / "camera.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(RigError, match=said) as failure:
        read_calibration(path)
    assert str(failure.value).startswith(f"{path}: ")
    assert "\n" not in str(failure.value)
    assert capfd.readouterr().err == ""


def test_a_calibration_of_another_picture_is_refused(tmp_path):
    write_calibration(_calibration(size=(1920, 1080)), tmp_path / "c.yaml")
    with pytest.raises(InputError, match=r"swing.avi: 640×480 px, but .*c.yaml was made for pictures of 1920×1080 px"):
        lens_from_rig(_rig(calibration=str(tmp_path / "c.yaml")), SIZE, "swing.avi")


def test_a_distortion_that_turns_back_within_the_picture_is_refused(tmp_path):
    write_calibration(_calibration(-0.9, 400.0), tmp_path / "c.yaml")
    with pytest.raises(RigError, match="cannot be inverted at pixel"):
        lens_from_rig(_rig(calibration=str(tmp_path / "c.yaml")), SIZE, "swing.avi")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{tilt_deg: 85}", "camera.tilt_deg: input should be less than 80"),
        ("{tilt: 15}", "unknown key camera.tilt"),
        ("{calibration: c.yaml, focal_px: 800}", "camera: focal_px is already in the calibration"),
    ],
)
def test_a_wrong_declaration_is_refused_in_one_line(tmp_path, text, said):
    (tmp_path / "rig.yaml").write_text(f"camera: {text}\n")
    with pytest.raises(RigError, match=said):
        read_rig(tmp_path / "rig.yaml")


def test_a_rolling_shutter_shifts_time_by_the_marks_row():
    time = measurement_time([1.0, 2.0, 3.0], [0.0, 239.5, np.nan], 480, 2e-5)
    np.testing.assert_allclose(time, [1.0 - 239.5 * 2e-5, 2.0, 3.0], atol=1e-15)
    np.testing.assert_array_equal(measurement_time([1.0, 2.0], [0.0, 9.0], 480, None), [1.0, 2.0])


def test_the_mean_over_an_exposure_lies_off_its_middle_by_what_is_stated():
    t, exposure, acceleration = np.arange(5) / 30.0, 0.02, 7.0
    inside = np.linspace(-0.5, 0.5, 20001) * exposure
    mean = np.trapezoid(0.5 * acceleration * (t[2] + inside) ** 2, inside) / exposure
    off = mean - 0.5 * acceleration * t[2] ** 2
    np.testing.assert_allclose(mean_off_middle(t, 0.5 * acceleration * t**2, exposure), off, rtol=1e-4)
    assert not mean_off_middle(t, t**2, None).any()


def test_a_blur_adds_uncertainty_beyond_the_width_of_an_edge_only():
    t, lever = np.arange(0.0, 1.0, 1.0 / 30.0), 200.0
    for blur_px, longer in ((3.0, 0.0), (4.0, 0.0), (14.0, 10.0)):
        steady = blur_px / lever / 0.02 * t
        expected = BLUR_SHARE * longer / lever
        assert blur_error(t, steady, lever, 0.02) == pytest.approx(np.full(len(t), expected), abs=1e-12)
    assert not blur_error(t, 10.0 * t, lever, None).any()
