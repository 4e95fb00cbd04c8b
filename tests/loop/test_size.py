"""Whether recordings determine the size of an effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.close import close_records
from anglecam.loop.size import sizes_determined
from anglecam.models.plant import Plant
from benchmarks.blind.sessions import session as drawn_session
from support.motion import Plant as TruePlant
from support.series import session


def fit(name: str, start: list[float], truth: TruePlant):
    records = session(truth, 0)[:3]
    plant = Plant((effect(name),))
    return fit_output_error(plant, records, [np.array([26.0, 524.0, 508.0, *start])]), records


def test_the_size_of_what_acts_is_determined():
    drag, records = fit("quadratic_drag", [1.0], TruePlant(quadratic_drag=2.0))
    assert sizes_determined(drag, records)


def test_the_size_of_what_never_acts_is_not_determined():
    # a spring that acts below an angle which the motion does not reach
    spring, records = fit("one_sided_spring", [-50.0, -1.5], TruePlant())
    assert not sizes_determined(spring, records)


def test_a_tilt_of_which_the_motion_shows_little_more_than_the_scale_is_not_determined():
    rng = np.random.default_rng(0)
    records = [replace(r, angle=r.angle + rng.normal(0.0, 0.02, len(r.angle))) for r in session(TruePlant(), 0)[:3]]
    tilt = fit_output_error(Plant((effect("camera_tilt"),)), records, [np.array([26.0, 524.0, 508.0, 0.3, 0.8, 0.8])])
    assert not sizes_determined(tilt, records)


def test_the_stiffness_of_a_stop_that_is_not_touched_needs_no_limit():
    records = session(TruePlant(), 0)[:1]
    stopped = Plant((effect("end_stop"),))
    at = fit_output_error(stopped, records, [np.array([26.0, 524.0, 508.0, 2000.0, 1.0, -1.0, 0.3])])
    assert not np.any(at.slopes.projected[:, 3])  # nothing depends on it
    assert sizes_determined(at, records)


@pytest.mark.sweep
def test_a_stop_too_stiff_to_be_measured_is_a_stop_and_no_spring():
    # the body touches the stops for a few frames, which a rigid stop explains as well
    stops = {"end_stop": {"upper_deg": 13.87, "lower_deg": -16.42, "stiffness": 1069.7, "dissipation": 0.33}}
    verdict = close_records(drawn_session(stops, seed=413), held_out=["random"])
    (stop,) = verdict.accepted
    assert set(stop.alias_set) == {"end_stop", "one_sided_spring"}
    assert stop.effect.id == "end_stop"
    low, high = (np.degrees(1.0 / verdict.after.parameters[i]) for i in (5, 4))
    assert abs(high - 13.87) < 0.5
    assert abs(low + 16.42) < 0.5
