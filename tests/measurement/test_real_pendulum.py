"""A real film: the ball is followed, its turning points are the film-maker's to one frame, the loop finds gravity."""

from __future__ import annotations

import csv
from functools import cache

import numpy as np
import pytest

from anglecam.io.rig import Rig, RigMark, RigPivot
from anglecam.io.session import read_session
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from anglecam.workflow.session import gather_session
from support.closing import close_without_rivals
from support.real import REAL

FOLDER = REAL / "pendulum-red-ball"
FRAME_S = 1 / 24

pytestmark = pytest.mark.skipif(not (FOLDER / "esempio.avi").exists(), reason="the real film is not here")


MOUTHS = {"auto": "auto", "declared": RigMark(rgb=(215, 50, 25))}


@cache
def measured_with(mouth):
    return measure_clip(open_film(FOLDER / "esempio.avi"), Rig(mouth=MOUTHS[mouth], pivot=RigPivot(marker="none")))


@pytest.fixture(params=[pytest.param("auto", marks=pytest.mark.sweep), "declared"])
def measured(request):
    return measured_with(request.param)


def test_the_ball_is_found_once_the_hand_is_off_it(measured):
    ok = measured.series.ok
    assert len(measured.series.time) == 480
    assert ok[30:].mean() > 0.98
    np.testing.assert_allclose(measured.series.time, np.arange(480) * FRAME_S, atol=1e-6)


def test_its_path_is_a_circle_about_a_pivot_above_the_picture(measured):
    series, circle = measured.series, measured.detections.circle
    off = np.hypot(*(series.mark_px - circle.centre_px).T)[30:] - circle.radius_px
    assert np.sqrt(np.nanmean(off**2)) < 1.3
    assert abs(measured.angles.pivot.centre_px[0] - 650) < 4
    assert abs(measured.angles.pivot.centre_px[1] + 709) < 25


def test_turning_points_agree_with_the_film_makers_to_one_frame(measured):
    series = measured.series
    x = series.mark_px[:, 0]
    with (FOLDER / "log.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 17
    for row in rows:
        said = float(row["Istante (ms)"]) / 1e3
        sign = 1.0 if row["Lato"] == "DX" else -1.0
        near = np.flatnonzero((np.abs(series.time - said) < 0.4) & np.isfinite(x))
        turned = near[np.argmax(sign * x[near])]
        # the log is in whole milliseconds
        assert abs(series.time[turned] - said) <= FRAME_S + 0.0015
        assert abs(x[turned] - float(row["X (pixel)"])) < 8


def test_the_loop_finds_gravity_and_no_other_effect(tmp_path):
    series = measured_with("declared").series
    (tmp_path / "ball.avi").symlink_to(FOLDER / "esempio.avi")
    session = gather_session(read_session(tmp_path), lambda recording: (series, None))
    verdict = close_without_rivals(session.records)
    assert [accepted.effect.id for accepted in verdict.accepted] == ["gravity_geometry"]
    # blocks of a second are predicted, because the residual is correlated over half a second
    assert verdict.after_held_out.rmse < 0.6 * verdict.before_held_out.rmse
