"""Tests of the second renderer: its angle, its motion, its files."""

import cv2
import numpy as np
import pytest
import yaml

from support import broken
from support.drawn import Look, Plant, Recording, draw_frames, draw_session
from support.head import Head
from support.look import SIZE
from support.motion import UPDATE_S, command_rows, move
from support.scene import red_object_centre


def _centre_angles(images, look):
    """Return the direction of each mask's centroid from the pivot, in degrees from neutral."""
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    at = np.array([[(m * x).sum(), (m * y).sum()] / m.sum() for m in images])
    away = (at - look.pivot) * [look.sign, -1]
    return np.degrees(np.arctan2(away[:, 1], away[:, 0])) - look.neutral_deg, at


@pytest.mark.parametrize(("facing", "lever"), [("right", 120.0), ("left", 220.0)])
def test_the_lips_are_drawn_at_the_true_angle_within_0_002_deg(facing, lever):
    look = Look(facing=facing, lever_px=lever)
    head, angles = Head(look), np.linspace(-20.0, 20.0, 17)
    lips = head.lips_layer()
    masks = [head.sample(lips, a, (0, 0), SIZE).astype(float) for a in angles]
    drawn, at = _centre_angles(masks, look)
    assert np.abs(drawn - angles).max() < 0.002
    assert np.abs(at - look.mouth(angles)).max() < 0.02


def test_the_lips_in_the_finished_picture_turn_by_the_true_angle():
    look = Look(red_object=None, noise=0.0)
    angles = np.linspace(-15.0, 15.0, 13)
    excess = []
    for frame in draw_frames(look, angles):
        b, g, r = (frame[..., k].astype(float) for k in range(3))
        excess.append(np.clip(r - 1.1 * np.maximum(g, b) - 60, 0, None))
    drawn, _ = _centre_angles(excess, look)
    # A weight by redness is biased towards the bright lip: a constant, which subtracting the mean removes.
    assert np.std(drawn - angles) < 0.005


def test_a_step_follows_the_closed_form():
    plant = Plant(a=26.0, b=524.0, c=508.0, dead_time_s=0.04)
    rows = np.array([[0.0, 0.0], [0.5137, 10.0]])
    times = np.arange(90) / 30
    angles = move(plant, Recording("step"), times, rows)
    omega, zeta = np.sqrt(plant.b), plant.a / (2 * np.sqrt(plant.b))
    damped = omega * np.sqrt(1 - zeta**2)
    since = np.clip(times - 0.5537, 0.0, None)
    wave = np.cos(damped * since) + zeta * omega / damped * np.sin(damped * since)
    expected = 10.0 * plant.c / plant.b * (1 - np.exp(-zeta * omega * since) * wave)
    assert np.abs(angles - expected).max() < 1e-9


def test_the_event_integrator_agrees_with_the_exponential_where_both_apply():
    recording, times = Recording("r", "random", duration_s=3.0), np.arange(90) / 30
    rows = command_rows(recording, np.random.default_rng(4))
    exact = move(Plant(dead_time_s=0.02), recording, times, rows)
    stepped = move(Plant(dead_time_s=0.02, quadratic_drag=1e-12), recording, times, rows)
    assert np.abs(exact - stepped).max() < 1e-6


def test_dry_friction_takes_two_f_over_b_from_every_half_swing():
    plant = Plant(a=0.0, b=100.0, c=0.0, coulomb=2.0)
    half = np.pi / 10
    times = half * np.arange(6)
    angles = move(plant, Recording("r", "release", amplitude_deg=10.0, rest_s=0.0), times, None)
    loss = np.degrees(2 * 2.0 / 100.0)
    expected = [10.0, -(10 - loss), 10 - 2 * loss, -(10 - 3 * loss), 10 - 4 * loss]
    assert angles[:5] == pytest.approx(expected, abs=1e-6)
    assert angles[5] == pytest.approx(angles[4], abs=1e-9)  # the restoring torque of 0.83° is less than the friction


@pytest.mark.parametrize("kind", ["steps", "stairs", "triangle", "chirp", "random"])
def test_commands_rest_first_and_stay_within_their_amplitude(kind):
    recording = Recording("r", kind)
    rows = command_rows(recording, np.random.default_rng(0))
    changes = np.flatnonzero(np.diff(rows[:, 1]))
    assert rows[changes[0] + 1, 0] >= recording.rest_s
    assert np.all(np.diff(rows[:, 0]) > 0)
    assert rows[-1, 0] < recording.duration_s
    assert np.abs(rows[:, 1]).max() <= recording.amplitude_deg
    assert np.abs(rows[:, 1]).max() > 0.5 * recording.amplitude_deg
    if kind == "chirp":
        assert np.allclose(np.diff(rows[1:, 0]), UPDATE_S, atol=2e-6)


def test_a_session_has_its_files_and_a_lossless_clip_its_pixels(tmp_path):
    look = Look(marker="disc_dark", facing="left")
    recordings = [Recording("go", duration_s=1.2), Recording("fall", "release", 0.5, held_out=True)]
    truth = draw_session(tmp_path, look=look, recordings=recordings, seed=1, codec="FFV1", mouth="declared")
    names = {"go.avi", "go.command.csv", "fall.avi", "rig.yaml"}
    assert {p.name for p in tmp_path.iterdir()} == names
    rig = yaml.safe_load((tmp_path / "rig.yaml").read_text())
    assert rig["mouth"] == {"rgb": [190, 35, 40]}
    assert rig["held_out"] == ["fall"]
    assert np.hypot(*(np.array(rig["pivot"]["near"]) - look.pivot)) <= 8.1
    clip = cv2.VideoCapture(str(truth["go"].clip))
    frames = [clip.read()[1] for _ in truth["go"].time_s]
    assert not clip.read()[0]
    still = np.stack(frames[:20]).astype(float)  # at rest: only noise differs
    # Rounding to whole grey levels adds a variance of 1/12.
    assert np.std(still - still.mean(axis=0)) == pytest.approx(np.sqrt((4 + 1 / 12) * 19 / 20), rel=0.01)


def test_the_same_seed_draws_the_same_clip(tmp_path):
    once, again = (
        draw_session(tmp_path / k, recordings=[Recording("go", "random", 1.0)], seed=5)["go"].clip.read_bytes()
        for k in "ab"
    )
    assert once == again


@pytest.mark.parametrize("lever", [120.0, 170.0, 220.0])
@pytest.mark.parametrize("facing", ["left", "right"])
def test_a_red_object_near_the_path_stays_clear_of_the_head(lever, facing):
    look = Look(lever_px=lever, facing=facing, red_place="near")
    head = Head(look)
    inner_edge = abs(red_object_centre(look)[0] - look.pivot[0]) - 44
    assert inner_edge > head.front
    assert 44 < red_object_centre(look)[0] < SIZE[0] - 44


def test_bad_clips_are_bad(tmp_path):
    draw_session(tmp_path, recordings=[Recording("good", duration_s=1.0)])
    cut = cv2.VideoCapture(str(broken.truncated_clip(tmp_path, tmp_path / "good.avi")))
    count = 0
    while cut.read()[0]:
        count += 1
    assert 10 <= count < 30
    for path in (broken.empty_clip(tmp_path), broken.text_clip(tmp_path), broken.zero_frame_clip(tmp_path)):
        assert not cv2.VideoCapture(str(path)).read()[0]
    frame = cv2.VideoCapture(str(broken.clip_without_mouth(tmp_path))).read()[1].astype(int)
    assert (frame[..., 2] - frame[..., 1]).max() < 90
    with pytest.raises(yaml.YAMLError):
        yaml.safe_load(broken.rig_that_is_not_yaml(tmp_path).read_text())
