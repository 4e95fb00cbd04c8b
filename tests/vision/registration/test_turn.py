"""Angles from the whole body on a film whose truth is known to a ten-thousandth of a degree."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from anglecam.io.rig import Rig, RigMark
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from anglecam.vision.registration import turn
from anglecam.vision.registration.tile_weights import copied_share
from anglecam.vision.registration.tiles import FrameView
from anglecam.vision.registration.turn import find_turn
from synth.session import render

SPEC = {
    "seed": 71,
    "camera": {"codec": "ffv1", "noise_grey": 2.0},
    "recordings": [
        {"name": "swing", "duration_s": 2.4, "command": {"kind": "triangle", "amplitude_deg": 20, "period_s": 2.0}}
    ],
}


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    folder = tmp_path_factory.mktemp("swing")
    (folder / "spec.yaml").write_text(yaml.safe_dump(SPEC))
    render(folder / "spec.yaml", folder / "session", folder / "truth")
    truth = np.genfromtxt(folder / "truth" / "swing.truth.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    return measure_clip(open_film(folder / "session" / "swing.avi"), Rig(mouth=RigMark(rgb=(190, 35, 40)))), truth


def test_the_whole_body_gives_the_angle_to_a_thousandth_of_a_degree(swing):
    measured, truth = swing
    assert measured.why_coarse is None
    assert measured.series.status == ("ok",) * 72
    error = np.degrees(measured.series.angle) - truth["angle_deg"]
    assert np.std(error) < 0.001
    registered = measured.angles.registered
    pivot = [truth["pivot_x_px"][0], truth["pivot_y_px"][0]]
    np.testing.assert_allclose(registered.pivot_px, pivot, atol=0.02)


def test_sigma_matches_the_error(swing):
    measured, truth = swing
    # Without a command the zero is the median.
    error = np.degrees(measured.series.angle) - truth["angle_deg"]
    error -= np.median(error)
    assert 0.5 < np.sqrt(np.mean((error / np.degrees(measured.series.sigma)) ** 2)) < 1.3


def test_the_marks_place_in_a_frame_is_the_one_seen_in_that_frame(swing):
    measured, truth = swing
    off = measured.series.mark_px - np.column_stack([truth["mouth_x_px"], truth["mouth_y_px"]])
    assert np.hypot(*off.T).max() < 0.5


def test_pixels_outside_the_part_that_is_seen_do_not_matter(swing, tmp_path_factory):
    measured, _ = swing
    registered = measured.angles.registered
    body, film = registered.appearance, open_film(next(tmp_path_factory.getbasetemp().rglob("swing.avi")))
    for frame in list(film.frames())[10:70:20]:
        view = FrameView(frame.image, float(registered.turn[frame.index]) + 2e-3, body.pivot_px)
        part = body.part_seen(view.turn, film.size)
        other = np.full_like(frame.image, 77)
        other[part] = frame.image[part]
        assert other[part].size < 0.6 * other.size
        before = np.roll(frame.image, 1, axis=0)
        whole, partly = find_turn(body, view, before), find_turn(body, replace(view, image=other), before)
        assert (whole.turn, whole.noise, whole.pose) == (partly.turn, partly.noise, partly.pose)


def test_a_body_of_which_no_tile_says_anything_has_no_turn(swing, tmp_path_factory, monkeypatch):
    # a seesaw's end left the picture, and the tiles that stayed were flat
    measured, _ = swing
    registered = measured.angles.registered
    frame = next(iter(open_film(next(tmp_path_factory.getbasetemp().rglob("swing.avi"))).frames()))
    view = FrameView(frame.image, float(registered.turn[0]), registered.appearance.pivot_px)
    view = replace(view, pivot_covariance_px2=np.eye(2))
    count = len(registered.appearance.middles_in(view))
    nothing = 1.0, np.ones(count, bool), np.zeros((count, 3, 3)), np.zeros((count, 3))
    monkeypatch.setattr(turn, "weigh_tiles", lambda *_: nothing)
    assert np.isnan(find_turn(registered.appearance, view).turn)


def test_the_copied_share_is_that_of_equal_pixels_of_the_tiles_in_the_picture():
    image = np.zeros((40, 50, 3), np.uint8)
    before = image.copy()
    before[:20] = 1
    middles = np.array([[20, 20], [25, 30], [0, 38], [90, 20]])
    shares = 0.5, 1.0, 1.0  # the last is outside
    assert copied_share(image, before, middles, 8) == pytest.approx(np.mean(shares))
    before[..., 1] = 1
    assert copied_share(image, before, middles, 8) == pytest.approx(2.0 / 3.0 * np.mean(shares))
    assert copied_share(image, before, middles[3:], 8) == 0.0
