"""The drawn curve of an effect is the function that the effect computes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.models.plant import Plant
from anglecam.report.path_figure import curve_of
from support.motion import Plant as TruePlant
from support.series import session


@pytest.fixture(scope="module")
def records():
    return session(TruePlant(), 8)


def _curve(records, effect_id, *own):
    """Return the curve of an effect, with as many of its parameters as given, in a plant that leaves nothing over."""
    entry = effect(effect_id)
    plant = Plant().with_effect(replace(entry, parameters=entry.parameters[: len(own)]))
    fit = SimpleNamespace(
        model=plant,
        parameters=np.array([26.0, 524.0, 508.0, *own]),
        residuals=[np.zeros(len(r.time)) for r in records],
    )
    return curve_of(plant.effects[0], fit, records)


def test_backlash_is_drawn_with_its_half_width(records):
    curve = _curve(records, "backlash", np.radians(0.8))
    assert np.max(np.abs(curve.y - curve.without)) == pytest.approx(0.8, abs=1e-6)


@pytest.mark.parametrize("tau", [0.005, 0.06])
def test_a_dead_time_is_drawn_with_its_length_on_a_scale_that_shows_it(records, tau):
    curve = _curve(records, "dead_time", tau)
    late = round(tau / np.median(np.diff(curve.x)))
    assert np.max(np.abs(curve.y[late:] - curve.without[:-late])) < 1e-9
    assert tau > 0.05 * np.ptp(curve.x)


def test_the_whole_of_a_recording_is_drawn_that_is_shorter_than_any_stretch(records):
    short = records[0].between(0.9, 0.95)
    curve = _curve([replace(short, time=short.time - short.time[0])], "dead_time", 0.005)
    assert np.ptp(curve.x) == pytest.approx(np.ptp(short.time), abs=2e-3)


def test_friction_is_drawn_against_motion(records):
    curve = _curve(records, "coulomb_friction", np.radians(100.0))
    assert np.all(curve.y[curve.x > 1.0] == pytest.approx(-100.0))
    assert np.all(curve.y[curve.x < -1.0] == pytest.approx(100.0))
    stribeck = _curve(records, "coulomb_friction", *np.radians([100.0, 0.0, 50.0, 1.0]))
    assert stribeck.y == pytest.approx(-np.sign(stribeck.x) * (100.0 + 50.0 * np.exp(-(stribeck.x**2))), abs=1e-6)


def test_drag_is_drawn_over_velocity_and_a_spring_over_angle(records):
    drag = _curve(records, "quadratic_drag", 2.0)
    assert drag.y == pytest.approx(np.degrees(-2.0 * np.radians(drag.x) * np.abs(np.radians(drag.x))))
    spring = _curve(records, "stiffening_spring", 300.0)
    assert spring.y == pytest.approx(np.degrees(-300.0 * np.radians(spring.x) ** 3))


def test_drift_is_drawn_over_time(records):
    curve = _curve(records, "angle_drift", np.radians(0.1))
    assert curve.xlabel == "time, s"
    assert curve.y == pytest.approx(0.1 * curve.x)
