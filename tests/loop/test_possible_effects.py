"""An effect is offered only where recordings can show it, and stands only with parameters that describe it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from anglecam.data.record import Record
from anglecam.effects import LEDGER, effect
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.close import close_records
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.rivals import is_possible
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.loop.size import sizes_determined
from anglecam.loop.stepwise import applicable
from anglecam.models.plant import Plant
from benchmarks.blind.sessions import session as drawn_session
from support.motion import Plant as TruePlant
from support.series import session


def test_in_free_swings_no_effect_with_a_flexible_shape_is_looked_for():
    free = [replace(record, command=None) for record in session(TruePlant(), 0)[:2]]
    driven = session(TruePlant(), 0)[:1]
    flexible = {e.id for e in LEDGER if not e.in_free_swing}
    assert "time_varying_parameter" in flexible
    assert not flexible & {e.id for e in applicable(free)}
    assert "gravity_geometry" in {e.id for e in applicable(free)}
    assert "time_varying_parameter" in {e.id for e in applicable(driven)}


@pytest.mark.parametrize(("stiffness", "possible"), [(0.8, False), (500.0, False), (2000.0, True)])
def test_what_yields_more_than_the_bodys_own_springs_is_no_stop(stiffness, possible):
    records = session(TruePlant(), 0)[:1]
    fit = fit_output_error(Plant(), records, [np.array([26.0, 524.0, 508.0])])
    stopped = Plant((effect("end_stop"),))
    at = replace(fit, model=stopped, parameters=np.array([26.0, 524.0, 508.0, stiffness, 5.0, -5.0, 0.3]))
    assert is_possible(at, records) is possible
    delayed = replace(at, model=Plant((effect("dead_time"),)), parameters=np.array([26.0, 524.0, 508.0, 0.1]))
    assert is_possible(delayed, records)


@pytest.mark.parametrize(("periods", "possible"), [(1.9, False), (2.1, True)])
def test_cogging_repeats_itself_within_the_usual_motion_and_not_only_within_its_extremes(periods, possible):
    record = session(TruePlant(), 0)[0]
    fit = fit_output_error(Plant(), [record], [np.array([26.0, 524.0, 508.0])])
    usual, n = np.radians(10.0), len(record.time)
    angle = np.linspace(-usual / 0.9, usual / 0.9, n)  # nine tenths of it are within ±10°
    angle[[0, -1]] = -4.0 * usual, 4.0 * usual
    number = periods * 2.0 * np.pi / (2.0 * usual)
    at = replace(
        fit,
        model=Plant((effect("cogging"),)),
        parameters=np.array([26.0, 524.0, 508.0, 1.0, number, 0.0]),
        residuals=(np.zeros(n),),
    )
    assert is_possible(at, [replace(record, angle=angle)]) is possible


@pytest.mark.parametrize(("periods", "possible"), [(1.9, False), (2.1, True)])
def test_a_periodic_disturbance_repeats_itself_within_the_longest_recording(periods, possible):
    records = session(TruePlant(), 0)[:2]
    fit = fit_output_error(Plant(), records, [np.array([26.0, 524.0, 508.0])])
    frequency = periods / max(r.time[-1] - r.time[0] for r in records)
    at = replace(
        fit,
        model=Plant((effect("periodic_disturbance"),)),
        parameters=np.array([26.0, 524.0, 508.0, 1.0, frequency, 0.0]),
    )
    assert is_possible(at, records) is possible


def test_a_weight_is_fitted_with_no_more_than_the_whole_stiffness_and_is_determined_there():
    stiffness, n = 12.0, 600
    softening = -2.0 * stiffness / 6.0  # twice that of a pendulum's sine
    time = np.arange(n) / 30.0
    swing = solve_ivp(
        lambda t, y: [y[1], -0.05 * y[1] - stiffness * y[0] - softening * y[0] ** 3],
        (0.0, time[-1]),
        [0.6, 0.0],
        t_eval=time,
        rtol=1e-9,
    )
    noise = np.random.default_rng(5).normal(0.0, 1e-4, n)
    record = Record("swing", time, swing.y[0] + noise, None, zero_known=False, sigma=np.full(n, np.nan))
    base = fit_output_error(Plant(driven=False), [record], [np.array([0.05, 11.0])])
    weight = effect("gravity_geometry")
    (forecast,) = forecasts(base, directions(base, [record], changes(base, [record], [weight])))
    found = fit_with(base, [record], forecast)
    b, strength, neutral = found.parameters[1:]
    assert is_possible(found, [record])
    assert -strength * np.cos(neutral) == pytest.approx(b, rel=0.06)
    assert found.rmse < 0.6 * base.rmse
    assert sizes_determined(found, [record])


@pytest.mark.sweep
def test_a_load_that_shifts_once_is_no_periodic_disturbance():
    shifted = {"shifted_load": {"torque": 0.93, "at_s": 4.1}}
    records = drawn_session(shifted, seed=412, names=("stairs", "chirp", "random"))
    verdict = close_records(records, held_out=["random"])
    assert "periodic_disturbance" not in [a.effect.id for a in verdict.accepted]
    assert verdict.verdict == "unexplained"


@pytest.mark.sweep
def test_a_stop_that_is_hardly_touched_stays_beside_the_spring_that_fits_as_well():
    stop = {"end_stop": {"upper_deg": 15.93, "lower_deg": -18.16, "stiffness": 2111.0, "dissipation": 0.43}}
    verdict = close_records(drawn_session(stop, seed=410), held_out=["random"])
    assert [set(a.alias_set) for a in verdict.accepted] == [{"end_stop", "one_sided_spring"}]


@pytest.mark.sweep
def test_an_effect_with_fewer_parameters_is_not_excluded_by_what_more_parameters_gain_from_noise():
    verdict = close_records(drawn_session({"lens_distortion": {"k1": -0.122}}, seed=410), held_out=["random"])
    assert "lens_distortion" in verdict.accepted[0].alias_set
