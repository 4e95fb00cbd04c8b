"""Recordings that others made: what anglecam finds in them stands beside what they published."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from anglecam.identification.multiple_shooting import windows
from anglecam.identification.output_error import predict_output_error
from support.closing import close_without_rivals
from support.real import REAL, ROOT

sys.path.append(str(ROOT / "benchmarks"))

import real_data  # the benchmark's own reading of the files, not a second one

emps_here = pytest.mark.skipif(not (REAL / "emps").is_dir(), reason="the EMPS records are not here")
pendulum_here = pytest.mark.skipif(not (REAL / "single-pendulum").is_dir(), reason="the pendulum is not here")


@pytest.fixture(scope="module")
def drive():
    records = real_data.records_of(real_data.write_emps, REAL / "emps")
    return {name: (fit, told) for name, fit, told in real_data.fit_emps(records)}


@emps_here
def test_dry_friction_of_a_drive_without_stiffness_brings_the_force_error_to_the_published(drive):
    errors = {name: real_data.force_error(real_data.carriage(fit), REAL / "emps") for name, (fit, _) in drive.items()}
    assert errors["viscous"] > 0.17
    assert errors["+ coulomb_friction"] < 0.042  # published: 4.083 %
    assert errors["+ damping_asymmetry"] < 0.033  # published: 3.112 %
    mass = real_data.carriage(drive["+ coulomb_friction"][0])["M, kg"]
    assert mass == pytest.approx(95.109, rel=0.02)


@emps_here
def test_each_kind_of_friction_predicts_the_record_with_added_pulses_better(drive):
    viscous, dry, uneven = (told.rmse for _, told in drive.values())
    assert dry < 0.3 * viscous
    assert uneven < 0.75 * dry


@emps_here
def test_the_published_parameters_give_the_published_force_error():
    told = {"M, kg": 95.109, "Fv+, N·s/m": 203.5, "Fv-, N·s/m": 203.5, "Fc+, N": 17.229, "Fc-, N": 23.559}
    assert real_data.force_error(told, REAL / "emps") == pytest.approx(0.04083, abs=1e-4)


@pendulum_here
def test_a_wide_swing_shows_the_sine_of_gravity_and_then_drag():
    records = real_data.records_of(real_data.write_pendulum, REAL / "single-pendulum")
    fits = real_data.fit_swing(records, ("quadratic_drag", 0.001))
    linear, sine, drag = (np.degrees(told.rmse) for _, _, told in fits)
    assert linear > 15.0
    assert sine < 0.02 * linear  # the swing keeps step
    assert drag < 0.4 * sine
    b, gravity = fits[-1][1].parameters[1:3]
    assert b == pytest.approx(64.2, rel=0.005)
    assert gravity == pytest.approx(b, rel=0.005)  # all of the stiffness is the weight's


@pendulum_here
def test_the_loop_finds_gravity_and_drag_of_a_real_pendulum_and_no_other_effect():
    records = real_data.records_of(real_data.write_pendulum, REAL / "single-pendulum")
    verdict = close_without_rivals(records)
    assert [accepted.effect.id for accepted in verdict.accepted] == ["gravity_geometry", "quadratic_drag"]
    assert len(verdict.fitted) == 1  # with gravity the model keeps step, and windows are needed no longer
    assert np.degrees(verdict.before_held_out.rmse) > 20.0
    assert np.degrees(verdict.after_held_out.rmse) < 0.132  # a fit by hand with the same effects over the same 15 s
    in_windows = predict_output_error(verdict.after, windows(verdict.fitted, verdict.before.parameters))
    assert np.degrees(in_windows.rmse) < 0.025
