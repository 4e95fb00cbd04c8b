"""What is said to be the camera's is taken out of the angles."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.data.camera_evidence import View
from anglecam.data.series import AngleSeries
from anglecam.effects import effect
from anglecam.identification.fit import Fit
from anglecam.loop.camera_correction import correct_camera_effects
from anglecam.models.plant import Plant

TIME = np.linspace(0.0, 5.0, 151)
NOD = np.radians(25.0) * np.sin(3.0 * TIME)
VIEW = View(0.2, 200.0, (-80.0, 60.0))
BASE = [26.0, 524.0, 508.0]


def fitted(*effects):
    plant = Plant(tuple(effect(name) for name, _ in effects))
    parameters = np.array(BASE + [value for _, values in effects for value in values])
    return Fit(plant, parameters, (), (), np.zeros((0, 0)), 0.0, np.zeros(0))


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
def test_the_angle_is_what_it_was_before_the_camera(found):
    fit = fitted(*found)
    shown = NOD
    for one, own in fit.model.parameters_by_effect(fit.parameters):
        shown = one.observation(TIME, shown, own, VIEW)
    assert np.degrees(np.abs(shown - NOD)).max() > 0.05
    assert correct_camera_effects(series(TIME, shown), fit, VIEW).angle == pytest.approx(NOD, abs=1e-9)


def test_a_clock_that_runs_fast_is_set_right_and_frames_without_an_angle_stay_without():
    lost = np.where(np.arange(len(NOD)) == 7, np.nan, NOD)
    told = correct_camera_effects(series(TIME, lost), fitted(("clock_scale", (0.01,))), VIEW)
    assert told.time == pytest.approx(TIME / 1.01)
    assert np.isnan(told.angle[7])
    assert told.angle[8:] == pytest.approx(NOD[8:])


def test_a_mechanism_without_effects_of_the_camera_is_left_alone():
    assert correct_camera_effects(series(TIME, NOD), fitted(("dead_time", (0.02,))), VIEW) is None
