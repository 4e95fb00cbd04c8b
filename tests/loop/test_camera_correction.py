"""Effects that are attributed to the camera are removed from angles and times."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.data.camera_evidence import View
from anglecam.data.series import AngleSeries
from anglecam.effects import effect
from anglecam.errors import InputError
from anglecam.identification.fit import Fit
from anglecam.identification.slopes import Slopes
from anglecam.loop.camera_correction import correct_camera_effects
from anglecam.models.plant import Plant

TIME = np.linspace(0.0, 5.0, 151)
ANGLE = np.radians(25.0) * np.sin(3.0 * TIME)
VIEW = View(0.2, 200.0, (-80.0, 60.0))
BASE = [26.0, 524.0, 508.0]


def fitted(*effects, sigma=1e-6):
    """Return a fit whose parameters, apart from correlations, have about the standard uncertainty ``sigma``."""
    plant = Plant(tuple(effect(name) for name, _ in effects))
    parameters = np.array(BASE + [value for _, values in effects for value in values])
    rows = 40 * len(parameters)
    slopes = Slopes(np.tile(np.eye(len(parameters)), (40, 1)), np.zeros((rows, 1)), np.array([0, rows]))
    white = sigma * np.sqrt(40.0) * np.random.default_rng(0).standard_normal(rows)
    return Fit(plant, parameters, (), (white,), slopes, 0.0, white)


def series(time, angle):
    status = tuple("ok" if found else "occluded" for found in np.isfinite(angle))
    return AngleSeries("one", time, angle, np.full(len(time), 1e-4), status)


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


def test_the_corrected_angle_carries_the_uncertainty_of_the_correction():
    # the drift's rate is r, so the corrected angle is uncertain by sigma(r) times a function of time
    fit = fitted(("angle_drift", (0.01,)), sigma=1e-4)
    right = correct_camera_effects(series(TIME, ANGLE), fit, VIEW)
    one = effect("angle_drift")
    slope = (
        one.observation(TIME, ANGLE, np.array([0.011]), VIEW) - one.observation(TIME, ANGLE, np.array([0.01]), VIEW)
    ) / 1e-3
    assert right.sigma == pytest.approx(np.hypot(1e-4, fit.sigma[3] * slope), rel=0.2)


def test_a_correction_that_is_less_certain_than_it_is_large_is_refused():
    fit = fitted(("angle_drift", (0.01,)), sigma=0.03)
    with pytest.raises(InputError, match="not corrected for angle_drift"):
        correct_camera_effects(series(TIME, ANGLE), fit, VIEW)
