"""A pendulum before a desk with things on it, filmed by a camera that is held in the hand."""

import av
import cv2
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.rig import Rig, RigMark, RigPivot
from anglecam.measurement.camera_pass import FilmAtRest, hold_camera
from anglecam.measurement.clip import measure_clip
from anglecam.measurement.detections import frames_to_keep
from anglecam.video.open_film import open_film
from support import things

SIZE = (480, 360)
PIVOT = (240.0, 90.0)
SWING = 20.0 * np.sin(2 * np.pi * np.arange(60) / 45.0)


def _in_hand(i):
    """Return the homography from the first frame into frame ``i``: up to 3 % nearer, 14 px, 1.5° of roll, a tilt."""
    t = i / 60.0
    scale, roll = 1.0 + 0.03 * np.sin(2.1 * t), np.radians(1.5 * np.sin(3.7 * t))
    move = cv2.getRotationMatrix2D((240.0, 180.0), float(np.degrees(roll)), float(scale))
    move = np.vstack([move, [0.0, 0.0, 1.0]])
    move[:2, 2] += 14.0 * np.sin(2.9 * t), 9.0 * np.sin(4.3 * t)
    tilt = np.eye(3)
    tilt[2, :2] = 2e-5 * np.sin(3.1 * t), 1e-5 * np.sin(2.3 * t)
    return tilt @ move


MOVES = [_in_hand(i) for i in range(len(SWING))]


def _film(path, moves, angles_deg):
    """Film a ball on a thick rod; the scene is drawn four times finer; a pixel is the mean of 2 × 2 samples."""
    rng = np.random.default_rng(3)
    desk = np.clip(
        150.0 + cv2.resize(rng.normal(0.0, 45.0, (90, 120)), (560, 440), interpolation=cv2.INTER_CUBIC), 0, 255
    )
    desk = cv2.resize(np.repeat(desk[..., None], 3, axis=2).astype(np.uint8), None, fx=4, fy=4)
    fine, samples = np.diag([4.0, 4.0, 1.0]), np.diag([2.0, 2.0, 1.0])
    fine[:2, 2], samples[:2, 2] = 1.5, 0.5
    corner = np.array([[1.0, 0.0, 40.0], [0.0, 1.0, 40.0], [0.0, 0.0, 1.0]])
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=30)
        (stream.width, stream.height), stream.pix_fmt = SIZE, "bgr0"
        for move, angle in zip(moves, np.radians(angles_deg), strict=True):
            scene = desk.copy()
            pivot = (PIVOT[0] + 40.0, PIVOT[1] + 40.0)
            things.ball((200, 30, 40), 16.0, pivot, 180.0)(scene, float(angle))
            whole = samples @ move @ np.linalg.inv(corner) @ np.linalg.inv(fine)
            seen = cv2.warpPerspective(scene, whole, (2 * SIZE[0], 2 * SIZE[1]), flags=cv2.INTER_LINEAR)
            small = cv2.resize(seen, SIZE, interpolation=cv2.INTER_AREA)
            noisy = np.clip(small + rng.normal(0.0, 2.0, small.shape), 0, 255).round().astype(np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(noisy, format="bgr24")))
        container.mux(stream.encode())
    return path


@pytest.fixture(scope="module")
def swinging(tmp_path_factory):
    return _film(tmp_path_factory.mktemp("hand") / "clip.mkv", MOVES, SWING)


def test_a_clip_from_the_hand_is_measured_as_seen_from_its_first_place(swinging):
    measured = measure_clip(open_film(swinging), Rig())
    assert any("comes nearer" in note for note in measured.notes)
    series = measured.series
    assert series.ok.mean() > 0.95
    error = np.degrees(series.angle) - SWING
    error = error[series.ok] - np.median(error[series.ok])
    assert np.sqrt((error**2).mean()) < 0.1
    assert np.sqrt(((error / np.degrees(series.sigma[series.ok])) ** 2).mean()) < 1.5
    expected = cv2.perspectiveTransform(np.array([[PIVOT]]), MOVES[40])[0, 0]
    assert np.hypot(*(series.pivot_px[40] - expected)) < 1.0


def test_the_samples_of_a_clip_from_the_hand_are_at_rest_as_its_frames_are(swinging):
    film = open_film(swinging)
    most = frames_to_keep(film)
    film.sample(most)  # as filmed: the camera's motion is found in these
    held = hold_camera(film).film
    frames = {frame.index: frame.image for frame in held.frames()}
    assert isinstance(held, FilmAtRest)
    for sampled in held.sample(most).frames:
        np.testing.assert_array_equal(sampled.image, frames[sampled.index])


def test_a_camera_that_comes_nearer_to_a_still_desk_turns_nothing(tmp_path):
    with pytest.raises(InputError):
        measure_clip(open_film(_film(tmp_path / "clip.mkv", MOVES[::2], np.zeros(len(MOVES[::2])))), Rig())


def test_a_thing_that_hardly_moves_before_a_camera_in_the_hand_is_no_success(swinging, tmp_path):
    hardly = _film(tmp_path / "clip.mkv", MOVES, 0.05 * SWING)
    rig = Rig(mark=RigMark(rgb=(200, 30, 40)), pivot=RigPivot(near=(PIVOT[0], PIVOT[1])))
    few, far = (measure_clip(open_film(path), rig) for path in (hardly, swinging))
    assert few.doubt is not None
    assert "before a camera in the hand" in few.doubt
    assert far.doubt is None
