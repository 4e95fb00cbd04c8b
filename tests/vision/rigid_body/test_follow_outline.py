"""The outline of a grey thing before a stained wall, on which it casts a soft shadow."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from anglecam.video.open_film import open_film
from anglecam.vision.image.transforms import rotate_each, turn_of
from anglecam.vision.rigid_body.follow_outline import follow_outline, learn_outline
from anglecam.vision.rigid_body.outline import find_outline, match_outline, slopes
from anglecam.vision.rigid_body.rough_centre import Centre
from support import things

SWING = 25.0 * np.sin(2 * np.pi * np.arange(60) / 40.0)
GREY = (110, 112, 110)


def _shadowed(draw):
    """Draw a thing behind its shadow, which is displaced and soft."""

    def drawn(scene, angle):
        shadow = np.zeros(scene.shape, np.uint8)
        draw(shadow, angle)
        cover = cv2.resize((shadow.max(axis=2) > 0).astype(np.float32), None, fx=0.25, fy=0.25)
        soft = cv2.resize(cv2.GaussianBlur(cover, (0, 0), 10), shadow.shape[1::-1])  # as soft as 40 px of the scene
        soft = np.roll(soft, (40, 60), axis=(0, 1))[..., None]
        scene[:] = (scene * (1.0 - 0.2 * soft)).astype(np.uint8)
        draw(scene, angle)

    return drawn


def _followed(path, draw, angles_deg, relief=25.0, known=None):
    """Follow an outline of which a number of poses, the last ones by angle, is known; by default all."""
    film = open_film(things.film(path / "clip.mkv", draw, angles_deg, relief=relief))
    learnt = learn_outline(film.sample(32).frames, film.frames())
    if isinstance(learnt, str):
        return learnt
    return follow_outline(film.frames(), replace(learnt, known=learnt.known[-known:] if known else learnt.known))


@pytest.mark.sweep  # a stick is measured in `tests/measurement/test_without_mark.py`
@pytest.mark.parametrize(
    ("draw", "angles_deg", "pivot"),
    [
        (things.stick(GREY, 12.0), SWING, (160.0, 30.0)),
        (things.ball(GREY, 18.0), SWING, (160.0, 20.0)),
        (things.wheel(GREY), np.linspace(0.0, 200.0, 60), (160.0, 120.0)),
    ],
    ids=["stick", "ball", "wheel"],
)
def test_the_outline_gives_angle_and_pivot(tmp_path, draw, angles_deg, pivot):
    motion = _followed(tmp_path, _shadowed(draw), angles_deg)
    assert not isinstance(motion, str), motion
    error = np.degrees(motion.turn) - angles_deg
    error -= np.median(error)
    assert np.isfinite(error).all()
    assert np.sqrt((error**2).mean()) < 0.1
    assert np.sqrt(((error / np.degrees(motion.sigma)) ** 2).mean()) < 1.5
    off = motion.pivot_px - pivot
    assert off @ np.linalg.solve(motion.pivot_covariance_px2, off) < 13.8  # 99.9 % of χ² with two degrees of freedom


def _stick_at(angle_deg):
    """Picture a dark stick that hangs from (160, 30), by the area of each pixel that it covers, with noise."""
    y, x = np.indices((240, 320)) - np.array([30.0, 160.0])[:, None, None]
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    outside = np.maximum(np.abs(c * x - s * y) - 10.0, np.abs(s * x + c * y - 80.0) - 80.0)
    grey = 170.0 - 110.0 * np.clip(0.5 - outside, 0.0, 1.0)
    noise = np.random.default_rng(round(angle_deg)).normal(0.0, 2.0, (240, 320))
    return (grey + noise).round().astype(np.uint8)[..., None]


def test_a_pose_is_found_to_a_few_hundredths_of_a_pixel():
    background = np.full((240, 320, 1), 170.0, np.float32)
    outline = find_outline(slopes(_stick_at(0.0), background), 8.0)
    anywhere = Centre(np.array([160.0, 120.0]), 1e-5 * np.eye(2))
    match = match_outline(outline, slopes(_stick_at(3.0), background), np.eye(3), anywhere)
    assert np.degrees(turn_of(match.pose)) == pytest.approx(3.0, abs=0.02)
    pivot, middle = np.array([160.0, 30.0]), np.array([160.0, 110.0])
    across = rotate_each(np.array([1.0, 0.0]), np.radians([3.0]))[0]
    expected = pivot + rotate_each(middle - pivot, np.radians([3.0]))[0]
    assert (match.pose[:2, :2] @ middle + match.pose[:2, 2]) @ across == pytest.approx(expected @ across, abs=0.03)


def _disc(scene, angle):
    things.disc(scene, things.hanging((160.0, 20.0), 160.0, angle), 18.0, (60, 60, 60))


def _cart(scene, angle):
    x = 160.0 + 100.0 * angle
    things.bar(scene, (x - 30.0, 120.0), (x + 30.0, 120.0), 24.0, (60, 60, 60))


def _two(scene, angle):
    things.bar(scene, (80.0, 30.0), things.hanging((80.0, 30.0), 100.0, angle), 14.0, (60, 60, 60))
    things.bar(scene, (240.0, 30.0), things.hanging((240.0, 30.0), 100.0, -0.7 * angle), 14.0, (60, 60, 60))


@pytest.mark.parametrize(
    "draw",
    [pytest.param(_disc, marks=pytest.mark.sweep), _cart, lambda scene, angle: None],
    ids=["disc", "cart", "nothing"],
)
def test_what_shows_no_rotation_of_its_own_is_not_measured(tmp_path, draw):
    assert isinstance(_followed(tmp_path, draw, SWING), str)


def test_of_two_like_things_that_turn_differently_none_is_measured(tmp_path):
    assert "does not follow one rotation" in str(_followed(tmp_path, _two, SWING))


@pytest.mark.parametrize(
    ("lengths", "ratio"),
    [
        ((80.0, 80.0), 1.8),
        *(pytest.param(*one, marks=pytest.mark.sweep) for one in (((56.0, 40.0), 1.41), ((52.0, 56.0), 1.88))),
    ],
)
def test_of_two_hinged_links_one_is_measured_or_none(tmp_path, lengths, ratio):
    first, second = lengths

    def links(scene, angle):
        joint = things.hanging((160.0, 30.0), first, angle)
        things.bar(scene, (160.0, 30.0), joint, 10.0, GREY)
        things.bar(scene, joint, things.hanging(joint, second, ratio * angle), 10.0, GREY)

    swing = 20.0 * np.sin(2 * np.pi * np.arange(60) / 40.0)
    motion = _followed(tmp_path, links, swing, relief=12.0)
    if not isinstance(motion, str):
        apart = np.degrees(motion.turn) - np.outer([1.0, ratio], swing)
        off = np.abs(apart - np.median(apart, axis=1)[:, None]) / np.degrees(motion.sigma)
        assert np.median(off, axis=1).min() < 1.0


def _gear(scene, angle):
    """Draw a gear of twelve teeth, all alike."""
    for tooth in angle + np.arange(12) * np.pi / 6.0:
        end = 160.0 + 80.0 * np.cos(tooth), 120.0 - 80.0 * np.sin(tooth)
        things.bar(scene, (160.0, 120.0), end, 18.0, GREY)
    things.disc(scene, (160.0, 120.0), 64.0, GREY)


@pytest.mark.parametrize(
    ("covered", "goes_on", "known"),
    [
        pytest.param(1, True, None, marks=pytest.mark.sweep),
        pytest.param(6, False, None, marks=pytest.mark.sweep),
        (6, False, 1),
    ],
)
def test_a_gear_is_not_found_again_at_another_tooth(tmp_path, covered, goes_on, known):
    turned = 4.0 * np.arange(60)
    frames = iter(range(len(turned)))

    def behind_a_board(scene, angle):
        _gear(scene, angle)
        if 44 <= next(frames) < 44 + covered:
            things.bar(scene, (20.0, 120.0), (300.0, 120.0), 220.0, (150, 150, 140))

    motion = _followed(tmp_path, behind_a_board, turned, known=known)
    assert not isinstance(motion, str), motion
    error = np.degrees(motion.turn) - turned
    error -= np.nanmedian(error)
    assert np.nanmax(np.abs(error)) < 1.0
    assert np.isfinite(error[44 + covered :]).all() == goes_on
