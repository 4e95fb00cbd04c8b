"""The camera's motion, against films with a known motion, and against films in which it stands still."""

import cv2
import numpy as np
import pytest
import yaml

from anglecam.video.open_film import open_film
from anglecam.vision.stabilise.background_motion import CameraMove
from anglecam.vision.stabilise.learn import learn_background
from anglecam.vision.stabilise.scenery import find_scenery
from anglecam.vision.stabilise.tile_cuts import brightness
from support.drawn import Look, draw_frames
from synth.session import render

SWING = {"name": "swing", "duration_s": 1.0, "command": {"kind": "random", "amplitude_deg": 20, "shortest_s": 0.1}}


def film(folder, **spec):
    """Render a short film; return its path, the true place of the pivot in each frame, and the times."""
    (folder / "spec.yaml").write_text(yaml.safe_dump({"seed": 7, "recordings": [SWING], **spec}))
    render(folder / "spec.yaml", folder / "session", folder / "truth")
    (clip,) = (folder / "session").glob("swing.[am]*")
    truth = np.genfromtxt(folder / "truth" / "swing.truth.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    return clip, np.column_stack([truth["pivot_x_px"], truth["pivot_y_px"]]), truth["time_s"]


def follow(clip):
    background = learn_background([frame.image for frame in open_film(clip).sample(32).frames])
    return background, [background.at(frame.image) for frame in open_film(clip).frames()]


def errors(moves, pivots):
    error = np.array([move.to_frame(pivots[0]) for move in moves]) - pivots
    sigma = np.sqrt([np.diag(move.place_covariance(pivots[0])) for move in moves])
    # The reference has the error of a single frame, which is common to all.
    return error - error.mean(axis=0), sigma


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    camera = {"codec": "ffv1", "fps": 30, "shake": {"rms_px": 2.0, "frequency_hz": 5}}
    clip, pivots, _ = film(tmp_path_factory.mktemp("raw"), camera=camera)
    return *follow(clip), pivots


def test_a_shaking_camera_is_followed_to_some_thousandths_of_a_pixel(raw):
    background, moves, pivots = raw
    assert not background.rolls
    assert np.sqrt((errors(moves, pivots)[0] ** 2).mean()) < 0.005


def test_the_uncertainty_matches_the_error(raw):
    _, moves, pivots = raw
    error, sigma = errors(moves, pivots)
    assert 0.7 < np.sqrt(((error / sigma) ** 2).mean()) < 1.4


def test_a_frame_whose_scenery_is_covered_has_no_known_motion(raw):
    background, moves, _ = raw
    assert all(move.known for move in moves)
    assert not background.at(np.full((480, 640, 3), 128, np.uint8)).known


def test_a_roll_is_separated_from_the_bodys_rotation(tmp_path):
    camera = {"codec": "mjpeg", "fps": 30, "shake": {"rms_px": 1.0, "frequency_hz": 4}}
    clip, pivots, time = film(tmp_path, camera=camera, effects={"angle_drift": {"rate_deg_per_s": 0.5}})
    background, moves = follow(clip)
    assert background.rolls
    rate = np.polyfit(time, np.degrees([move.roll for move in moves]), 1)[0]
    assert rate == pytest.approx(0.5, abs=0.02)
    assert np.sqrt((errors(moves, pivots)[0] ** 2).mean()) < 0.01


def test_a_shake_of_a_third_of_a_pixel_is_detected_in_a_lossy_film():
    images = []
    for image, shift in zip(draw_frames(Look(), 20.0 * np.sin(np.arange(12))), shaking(12, 0.3), strict=True):
        moved = cv2.warpAffine(image, np.column_stack([np.eye(2), shift]), image.shape[1::-1], flags=cv2.INTER_CUBIC)
        images.append(cv2.imdecode(cv2.imencode(".jpg", moved, [cv2.IMWRITE_JPEG_QUALITY, 80])[1], cv2.IMREAD_COLOR))
    assert shakes(images)


def shakes(images):
    scenery = find_scenery([brightness(image) for image in images])
    return scenery is not None and scenery.shakes


def shaking(frames, rms_px):
    shift = np.random.default_rng(5).standard_normal((frames, 2))
    return rms_px * shift / np.sqrt((shift**2).mean(axis=0))


@pytest.mark.parametrize(
    "look",
    [
        Look(distractor="pendulum"),
        pytest.param(Look(facing="left", background="gradient"), marks=pytest.mark.sweep),
    ],
)
def test_a_camera_at_rest_does_not_shake_while_body_and_light_change(look):
    images = list(draw_frames(look, 20.0 * np.sin(np.arange(12))))
    lit = [np.clip(image * (1.0 + 0.1 * np.sin(k)), 0, 255).astype(np.uint8) for k, image in enumerate(images)]
    assert not shakes(images)
    assert not shakes(lit)
    assert learn_background(lit) is None


def test_points_mapped_to_the_frame_and_back_are_unchanged():
    move = CameraMove(np.array([300.0, 200.0]), np.array([2.0, -1.0]), 0.01, np.eye(3))
    points = np.array([[0.0, 0.0], [640.0, 480.0]])
    np.testing.assert_allclose(move.to_reference(move.to_frame(points)), points, atol=1e-9)
    # Counter-clockwise as seen: a point to the right moves up.
    assert move.to_frame(np.array([400.0, 200.0]))[1] < 199.0
