"""Films of things without a mark: what turns is measured, whatever it is, and what does not turn is not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.rig import Rig
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
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


def _measured(folder, draw, angles_deg, relief=25.0, rig=None):
    return measure_clip(open_film(things.film(folder / "clip.mkv", draw, angles_deg, relief=relief)), rig or Rig())


def _error(measured, angles_deg):
    """Return the errors, degrees, in the measured frames; zero is free."""
    error = np.degrees(measured.series.angle) - angles_deg
    return (error - np.nanmedian(error))[measured.series.ok]


@pytest.mark.parametrize(
    ("draw", "angles_deg", "pivot"),
    [
        pytest.param(things.stick(GREY, 12.0), SWING, (160.0, 30.0), id="stick", marks=pytest.mark.sweep),
        pytest.param(
            things.ball(GREY, 18.0),
            SWING,
            (160.0, 20.0),
            id="ball",
            marks=pytest.mark.xfail(reason="its soft shadow turns with it: the error is 2.3 times sigma, of 0.05°"),
        ),
        pytest.param(things.wheel(GREY), np.linspace(0.0, 200.0, 60), (160.0, 120.0), id="wheel"),
    ],
)
def test_what_turns_before_its_shadow_is_measured(tmp_path, draw, angles_deg, pivot):
    measured = _measured(tmp_path, _shadowed(draw), angles_deg)
    error = _error(measured, angles_deg)
    assert measured.doubt is None
    assert measured.series.ok.all()
    assert np.sqrt((error**2).mean()) < 0.15
    assert np.sqrt(((error / np.degrees(measured.series.sigma)) ** 2).mean()) < 1.5
    assert np.hypot(*(measured.angles.pivot.centre_px - pivot)) < 2.0


def _cart(scene, angle):
    x = 160.0 + 100.0 * angle
    things.bar(scene, (x - 30.0, 120.0), (x + 30.0, 120.0), 24.0, (60, 60, 60))


@pytest.mark.parametrize("draw", [_cart, lambda scene, angle: None], ids=["cart", "nothing"])
def test_what_does_not_turn_is_not_measured(tmp_path, draw):
    with pytest.raises(InputError, match=r"clip\.mkv: (something moves around \d+,\d+, but|nothing is seen to turn)"):
        _measured(tmp_path, draw, SWING)


@pytest.mark.parametrize(
    ("lengths", "ratio"),
    [
        pytest.param(
            (80.0, 80.0), 1.8, marks=pytest.mark.xfail(reason="parts of both links pass for one body: off by 5°")
        ),
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
    try:
        measured = _measured(tmp_path, links, swing, relief=12.0)
    except InputError:
        return
    apart = np.degrees(measured.series.angle) - np.outer([1.0, ratio], swing)
    apart -= np.nanmedian(apart, axis=1)[:, None]
    assert np.sqrt(np.nanmean(apart**2, axis=1)).min() < 0.5


def _gear(scene, angle):
    """Draw a gear of twelve teeth, all alike."""
    for tooth in angle + np.arange(12) * np.pi / 6.0:
        end = 160.0 + 80.0 * np.cos(tooth), 120.0 - 80.0 * np.sin(tooth)
        things.bar(scene, (160.0, 120.0), end, 18.0, GREY)
    things.disc(scene, (160.0, 120.0), 64.0, GREY)


def test_a_gear_goes_on_at_the_same_tooth(tmp_path):
    turned = 4.0 * np.arange(60)
    frames = iter(range(len(turned)))

    def behind_a_board(scene, angle):
        _gear(scene, angle)
        if 44 <= next(frames) < 47:
            things.bar(scene, (20.0, 120.0), (300.0, 120.0), 220.0, (150, 150, 140))

    measured = _measured(tmp_path, behind_a_board, turned)
    assert np.abs(_error(measured, turned)).max() < 1.0
    assert measured.series.ok.mean() > 0.9


def _lit_wheel(scene, angle):
    """Draw five spokes, each brighter the more it points upwards, and a mark on one of them."""
    for along in angle + 2.0 * np.pi * np.arange(5) / 5.0:
        end = 160.0 + 90.0 * np.cos(along), 120.0 - 90.0 * np.sin(along)
        things.bar(scene, (160.0, 120.0), end, 14.0, (int(120.0 + 40.0 * np.sin(along)),) * 3)
    things.disc(scene, (160.0 + 70.0 * np.cos(angle), 120.0 - 70.0 * np.sin(angle)), 5.0, (20, 20, 20))


def test_a_wheel_under_light_from_above_does_not_jump_from_spoke_to_spoke(tmp_path):
    turned = 200.0 * np.sin(np.arange(80) / 18.0)
    measured = _measured(tmp_path, _lit_wheel, turned)
    assert measured.doubt is None
    assert np.abs(_error(measured, turned)).max() < 0.3
    assert measured.series.ok.mean() > 0.9


PIVOT = np.array([160.0, 120.0])


def _horn(scene, angle):
    """Draw a servo's horn with two unequal arms."""
    for length, width, opposite in ((90.0, 20.0, 0.0), (45.0, 30.0, np.pi)):
        end = PIVOT + length * np.array([np.cos(angle + opposite), -np.sin(angle + opposite)])
        things.bar(scene, tuple(PIVOT), tuple(end), width, (235, 235, 235))


JUMPS = np.tile(
    np.concatenate([np.full(14, 40.0), 40.0 + 15.0 * np.arange(1, 7), np.full(14, 135.0), 120.0 - 16.0 * np.arange(5)]),
    2,
)


@pytest.mark.parametrize("hint", [{}, {"pivot": {"near": [150, 128]}}], ids=["no hint", "hint"])
def test_a_horn_that_jumps_and_rests_is_measured(tmp_path, hint):
    measured = _measured(tmp_path, _horn, JUMPS, rig=Rig.model_validate(hint))
    error = _error(measured, JUMPS)
    assert measured.doubt is None
    assert measured.series.ok.mean() > 0.95
    assert np.sqrt((error**2).mean()) < 0.3
    assert np.hypot(*(measured.angles.pivot.centre_px - PIVOT)) < 1.5


def _two(scene, angle):
    things.bar(scene, (80.0, 30.0), things.hanging((80.0, 30.0), 100.0, angle), 14.0, (60, 60, 60))
    things.bar(scene, (240.0, 30.0), things.hanging((240.0, 30.0), 100.0, -0.7 * angle), 14.0, (60, 60, 60))


@pytest.mark.parametrize(
    ("hint", "share"),
    [
        pytest.param({"pivot": {"near": [85, 26]}}, 1.0, id="pivot"),
        pytest.param({"mark": {"at": [240, 100], "frame": 1}}, -0.7, id="mark"),
    ],
)
def test_of_two_things_that_turn_the_hinted_one_is_measured(tmp_path, hint, share):
    measured = _measured(tmp_path, _two, SWING, rig=Rig.model_validate(hint))
    assert measured.doubt is None
    assert np.sqrt((_error(measured, share * SWING) ** 2).mean()) < 0.3


def test_a_pivot_hint_at_another_place_costs_a_note_and_no_measurement(tmp_path):
    measured = _measured(tmp_path, _horn, JUMPS, rig=Rig.model_validate({"pivot": {"near": [20, 220]}}))
    assert measured.doubt is None
    assert any("172 px from the hint pivot: {near: [20, 220]}" in note for note in measured.notes)
    assert np.sqrt((_error(measured, JUMPS) ** 2).mean()) < 0.3


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ({"mark": {"at": [20, 220], "frame": 1}}, "mark around 20,220 in frame 1"),
        ({"pivot": {"at": [20, 220]}}, "pivot 20,220"),
    ],
)
def test_what_is_declared_where_nothing_moves_is_no_success(tmp_path, declared, said):
    measured = _measured(tmp_path, _horn, JUMPS, rig=Rig.model_validate(declared))
    assert measured.doubt is not None
    assert f"is not what is declared ({said})" in measured.doubt


def test_a_body_is_measured_whose_mark_is_seen_in_some_frames_only(tmp_path):
    """As lips that a codec paints red in some poses and brown in others."""

    def draw(scene, angle):
        things.stick(GREY, 16.0)(scene, angle)
        if angle > np.radians(8.0):
            things.disc(scene, things.hanging((160.0, 30.0), 140.0, angle), 7.0, (200, 30, 40))

    measured = _measured(tmp_path, draw, SWING, rig=Rig(least_measured=0.9))
    assert measured.doubt is None
    assert np.sqrt(np.mean(_error(measured, SWING) ** 2)) < 0.1
