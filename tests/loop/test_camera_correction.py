"""Effects that are attributed to the camera are removed from angles and times."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.data.camera_evidence import View
from anglecam.data.series import AngleSeries
from anglecam.effects import effect
from anglecam.identification.fit import Fit
from anglecam.identification.slopes import Slopes
from anglecam.loop.camera_correction import correct_camera_effects
from anglecam.models.plant import Plant

TIME = np.linspace(0.0, 5.0, 151)
ANGLE = np.radians(25.0) * np.sin(3.0 * TIME)
VIEW = View(0.2, 200.0, (-80.0, 60.0))
BASE = [26.0, 524.0, 508.0]


def fitted(*effects):
    plant = Plant(tuple(effect(name) for name, _ in effects))
    parameters = np.array(BASE + [value for _, values in effects for value in values])
    return Fit(
        plant, parameters, (), (), Slopes(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(1, int)), 0.0, np.zeros(0)
    )


def series(time, angle):
    return AngleSeries("one", time, angle, np.full(len(time), 1e-4), ("ok",) * len(time))


@pytest.mark.parametrize(
    "found",
    [
        [("camera_tilt", (0.3, 0.9, 0.5))],
        [("pivot_offset", (0.04, -0.03))],
        [("lens_distortion", (-0.05,))],
        [("angle_drift", (0.01,))],
        [("angle_drift", (0.01,)), ("camera_tilt", (0.3, 0.9, 0.5))],
    ],
)
def test_the_corrected_angle_is_the_true_angle(found):
    fit = fitted(*found)
    shown = ANGLE
    for one, own in fit.model.parameters_by_effect(fit.parameters):
        shown = one.observation(TIME, shown, own, VIEW)
    assert np.degrees(np.abs(shown - ANGLE)).max() > 0.05
    assert correct_camera_effects(series(TIME, shown), fit, VIEW).angle == pytest.approx(ANGLE, abs=1e-9)


def test_a_fast_clock_is_corrected_and_frames_without_an_angle_stay_empty():
    lost = np.where(np.arange(len(ANGLE)) == 7, np.nan, ANGLE)
    right = correct_camera_effects(series(TIME, lost), fitted(("clock_scale", (0.01,))), VIEW)
    assert right.time == pytest.approx(TIME / 1.01)
    assert np.isnan(right.angle[7])
    assert right.angle[8:] == pytest.approx(ANGLE[8:])


def test_a_series_without_camera_effects_is_not_corrected():
    assert correct_camera_effects(series(TIME, ANGLE), fitted(("dead_time", (0.02,))), VIEW) is None
