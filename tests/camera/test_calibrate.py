"""Calibration from a clip of a chessboard recovers the lens within its stated uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from anglecam.camera import calibrate
from anglecam.camera.calibrate import calibrate_clip
from anglecam.camera.chessboard import find_corners
from anglecam.camera.lens import Lens
from anglecam.errors import InputError
from anglecam.report.calibration_figure import plot_calibration
from anglecam.video.open_film import open_film
from support.board import BoardCamera, board_picture, film_board, poses, write_pictures

CAMERA = BoardCamera(k1=-0.15)
BOARD = (9, 6)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    clip = tmp_path_factory.mktemp("board") / "board.mkv"
    film_board(clip, CAMERA, poses(12, seed=2, camera=CAMERA), hold=2)
    return calibrate_clip(open_film(clip), BOARD, 0.025)


def test_the_lens_is_recovered_within_what_is_stated(found):
    lens = found.calibration
    assert found.terms == ("k1",)
    assert lens.sigma("k1") < 0.001
    assert lens.sigma("fx") < 0.0005 * CAMERA.focal_px
    for name, value, true in (
        ("k1", lens.distortion[0], CAMERA.k1),
        ("fx", lens.focal_px, CAMERA.focal_px),
        ("cx", lens.camera_matrix[0, 2], CAMERA.centre_px[0]),
        ("cy", lens.camera_matrix[1, 2], CAMERA.centre_px[1]),
    ):
        assert abs(value - true) < 3.5 * lens.sigma(name), name
    assert lens.rms_px < 0.04


def test_rectified_points_lie_where_a_pinhole_shows_them(found):
    rays = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.3, 0.3, 7)), axis=-1)
    pinhole = rays * CAMERA.focal_px + CAMERA.centre_px
    error = Lens(found.calibration).rectify(CAMERA.project(rays)) - pinhole
    # a shift and a scale common to all points change no angle
    flat, at = error.reshape(-1, 2), (pinhole - CAMERA.centre_px).reshape(-1, 2)
    left = flat - flat.mean(axis=0)
    left -= (left * at).sum() / (at**2).sum() * (at - at.mean(axis=0))
    assert np.hypot(*left.T).max() < 0.1


def test_blurred_frames_are_not_used(found):
    assert all(view.frame % 2 == 1 for view in found.views)


def test_the_figure_is_drawn(found, tmp_path):
    plot_calibration(found, tmp_path / "board.png", "board.mkv")
    assert (tmp_path / "board.png").stat().st_size > 20_000


def test_corners_are_found_to_a_fiftieth_of_a_pixel():
    rng = np.random.default_rng(3)
    X = np.array([[(x - 4) * 0.025, (y - 2.5) * 0.025, 0.0] for y in range(6) for x in range(9)])
    for turn, place in poses(4, seed=7, camera=CAMERA):
        picture = board_picture(CAMERA, (turn, place)) + rng.normal(0, 2, CAMERA.size[::-1])
        corners = find_corners(np.clip(np.rint(picture), 0, 255).astype(np.uint8), BOARD)
        seen = turn.apply(X) + place
        true = CAMERA.project(seen[:, :2] / seen[:, 2:])
        error = min((corners - true, corners[::-1] - true), key=lambda e: np.abs(e).max())
        assert np.sqrt((error**2).mean()) < 0.03


def _corners(camera: BoardCamera, count: int, seed: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return corners with the detector's error of 0.02 px, without drawing pictures."""
    rng = np.random.default_rng(seed)
    X = np.zeros((54, 3))
    X[:, :2] = 0.025 * np.mgrid[:9, :6].T.reshape(-1, 2)
    views = []
    for turn, place in poses(count, seed=seed, camera=camera):
        seen = turn.apply(X - [0.1, 0.0625, 0.0]) + place
        views.append(camera.project(seen[:, :2] / seen[:, 2:]) + rng.normal(0, 0.02, (54, 2)))
    return X, views


def _choice(camera: BoardCamera, seed: int) -> tuple[str, ...]:
    X, views = _corners(camera, 18, seed)
    held_out = [calibrate._held_out(X, views, camera.size, flags) for _, flags in calibrate._MODELS]
    return calibrate._MODELS[calibrate._choose(held_out)][0]


@pytest.mark.parametrize(
    ("camera", "terms"),
    [
        (BoardCamera(), ()),
        (BoardCamera(k1=-0.15), ("k1",)),
        (BoardCamera(k1=-0.28, k2=0.1), ("k1", "k2")),
        (BoardCamera(k1=-0.15, p1=0.002, p2=-0.001), ("k1", "k2", "p1", "p2")),
    ],
)
def test_distortion_gets_the_terms_that_the_lens_has(camera, terms):
    assert _choice(camera, seed=11) == terms


def test_stated_uncertainties_are_true():
    ratios = []
    for seed in range(40):
        X, views = _corners(CAMERA, 15, 200 + seed)
        fit = calibrate._fit(X, views, CAMERA.size, calibrate._MODELS[1][1])
        sigma = np.sqrt(np.diag(calibrate._covariance(X, fit, calibrate._residuals(X, views, fit), ("k1",))))
        error = [fit.K[0, 0] - 700.0, fit.K[0, 2] - 322.0, fit.K[1, 2] - 237.0, fit.distortion[0] + 0.15]
        ratios.append(error / sigma[[0, 2, 3, 4]])
    # 40 calibrations know a standard deviation to 11 %
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(ratios), axis=0)), 1.0, atol=0.35)


def test_a_view_with_wrong_corners_is_rejected():
    X, views = _corners(CAMERA, 12, 5)
    views[4] = views[4] + np.random.default_rng(0).normal(0, 0.5, views[4].shape)
    kept = calibrate._without_bad_views(X, list(enumerate(views)), CAMERA.size)
    assert [i for i, _ in kept] == [i for i in range(12) if i != 4]


def test_a_clip_without_a_board_is_refused(tmp_path):
    write_pictures(tmp_path / "wall.mkv", [np.full((480, 640), 120.0)] * 3)
    with pytest.raises(InputError, match=r"wall.mkv: chessboard of 9×6 inner corners not found in any of 3 frames"):
        calibrate_clip(open_film(tmp_path / "wall.mkv"), BOARD)


def test_too_few_poses_are_refused(tmp_path):
    film_board(tmp_path / "still.mkv", CAMERA, poses(2, camera=CAMERA), hold=4)
    with pytest.raises(InputError, match=r"found in . of 8 frames searched, but in only 2 different poses"):
        calibrate_clip(open_film(tmp_path / "still.mkv"), BOARD)


def test_a_board_that_never_leans_gives_no_focal_length(tmp_path):
    flat = [(Rotation.identity(), np.array([x, y, 0.5])) for x in (-0.05, 0.0, 0.05) for y in (-0.03, 0.03)]
    write_pictures(tmp_path / "flat.mkv", [board_picture(BoardCamera(), pose) for pose in flat])
    with pytest.raises(InputError, match="lean it by 20° to 40°"):
        calibrate_clip(open_film(tmp_path / "flat.mkv"), BOARD)
