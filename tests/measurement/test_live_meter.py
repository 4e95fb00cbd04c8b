"""Frames are measured one by one by what the first ones showed: right within the stated uncertainty, or refused."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from anglecam.data.series import OK
from anglecam.io.rig import Rig, RigCamera, RigMark, RigPivot
from anglecam.measurement.clip import measure_clip
from anglecam.measurement.live_meter import LiveMeter
from anglecam.measurement.live_model import live_model
from anglecam.video.container import open_container
from anglecam.video.decode import decode_container
from anglecam.video.open_film import film_of_rows
from support.drawn import Look, draw_frames, write_clip

FIRST, N = 75, 160
TIME = np.arange(N) / 30
SWING = np.where(TIME < 0.3, 0.0, 14.0 * np.sin(2 * np.pi * 0.7 * (TIME - 0.3)) * np.cos(0.2 * TIME))
HIDDEN, TWO, BEYOND = np.arange(100, 104), np.arange(110, 113), np.arange(150, 160)
SWING[BEYOND] = np.linspace(18.0, 24.0, len(BEYOND))
PLAIN = np.setdiff1d(np.arange(FIRST, N), [*HIDDEN, *TWO, *BEYOND])
LOOK = Look()


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """Film a head; later frames hide the mouth, show a second one, or show larger angles than the first ones."""
    path = tmp_path_factory.mktemp("film") / "clip.avi"
    frames = list(draw_frames(LOOK, SWING, TIME, seed=5))
    for k in HIDDEN:
        cv2.circle(frames[k], _pixel(SWING[k]), 45, (120, 140, 130), -1, cv2.LINE_AA)
    for k in TWO:
        cv2.circle(frames[k], _pixel(SWING[k] - 60.0), 13, LOOK.lips_rgb[::-1], -1, cv2.LINE_AA)
    write_clip(path, iter(frames))
    container = open_container(path)
    return path, container, list(decode_container(path, container))


def _pixel(angle_deg):
    return tuple(int(v) for v in LOOK.mouth(np.array([angle_deg]))[0].round())


def _rig(**camera):
    x, y = LOOK.pivot
    return Rig(mouth=RigMark(rgb=LOOK.lips_rgb), pivot=RigPivot(near=(x + 5, y - 4)), camera=RigCamera(**camera))


def _first(film):
    path, container, rows = film
    return film_of_rows(path, container, rows[:FIRST])


def _measured(film, first, measurement, rig):
    model = live_model(measurement, rig)
    assert not isinstance(model, str), model
    meter = LiveMeter(model, first)
    return model, {k: meter.measure(k, film[2][k]) for k in range(FIRST, N)}


@pytest.fixture(scope="module")
def first_frames(film):
    """Return the first frames and what is measured in them."""
    first = _first(film)
    return first, measure_clip(first, _rig())


@pytest.fixture(scope="module")
def by_body(film, first_frames):
    return _measured(film, *first_frames, _rig())


def _off(measured, frames):
    """Return the errors and the stated uncertainties, degrees; neutral is at the angle zero of the truth."""
    line = np.degrees([measured[k].line for k in frames])
    return line - LOOK.neutral_deg - SWING[frames], np.degrees([measured[k].sigma for k in frames])


def test_the_body_is_measured_within_the_stated_uncertainty(by_body):
    model, measured = by_body
    assert model.terms is not None
    assert [measured[k].status for k in PLAIN] == [OK] * len(PLAIN)
    off, sigma = _off(measured, PLAIN)
    off -= np.median(off)  # the direction of the mark on the body is that of its first frames
    assert np.sqrt(np.mean((off / sigma) ** 2)) < 1.5
    assert np.abs(off).max() < 0.02


def test_a_mark_that_is_hidden_is_no_angle(by_body):
    _, measured = by_body
    assert {measured[k].status for k in HIDDEN} <= {"no_mouth", "occluded"}
    assert all(np.isnan(measured[k].line) for k in HIDDEN)


def test_with_two_marks_in_sight_the_body_is_sought_where_the_motion_goes_on(by_body):
    _, measured = by_body
    assert [measured[k].status for k in TWO] == [OK] * len(TWO)
    off, sigma = _off(measured, TWO)
    off -= np.median(_off(measured, PLAIN)[0])
    assert np.abs(off / sigma).max() < 4.0


def test_a_body_that_is_found_at_a_wrong_angle_does_not_count(film, by_body):
    model, measured = by_body
    right = measured[PLAIN[0]].line
    off = replace(model, body=replace(model.body, zero=model.body.zero + np.radians(5.0)))
    found = LiveMeter(off, _first(film)).measure(PLAIN[0], film[2][PLAIN[0]])
    assert found.status == OK
    assert abs(found.line - right) < 4.0 * found.sigma
    assert found.sigma > 3.0 * measured[PLAIN[0]].sigma


def test_beyond_the_angles_of_the_first_frames_the_mark_alone_is_measured(by_body):
    _, measured = by_body
    off, sigma = _off(measured, BEYOND)
    assert sigma.min() > 3.0 * np.median(_off(measured, PLAIN)[1])
    assert np.abs(off / sigma).max() < 4.0


def test_a_mark_alone_is_measured_within_the_stated_uncertainty(film):
    first, rig = _first(film), _rig(row_time_s=1e-5)
    model, measured = _measured(film, first, measure_clip(first, rig), rig)
    assert model.body is None  # with a rolling shutter the rotation in a frame depends on the frames around it
    off, sigma = _off(measured, PLAIN)
    assert np.sqrt(np.mean(((off - np.median(off)) / sigma) ** 2)) < 1.5


def test_whole_turns_are_counted_from_the_last_frame_that_was_measured(film, by_body):
    meter = LiveMeter(replace(by_body[0], neutral=by_body[0].neutral + 4.0 * np.pi), _first(film))
    meter.skip()
    line = meter.measure(FIRST, film[2][FIRST]).line
    assert abs(np.degrees(line) - 720.0 - LOOK.neutral_deg - SWING[FIRST]) < 0.5


def test_what_cannot_be_measured_at_once_is_said(first_frames):
    rig, (_, measured) = _rig(), first_frames
    unknown = replace(measured, detections=replace(measured.detections, found=None))
    assert live_model(unknown, rig) == "only a mark that moves is measured at once"
    shaken = replace(measured, detections=replace(measured.detections, camera_moves=np.zeros((FIRST, 2))))
    assert live_model(shaken, rig) == "the camera moves"
