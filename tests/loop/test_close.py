"""Verdicts on series with a known hidden effect: attributed, nothing missing or unexplained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.errors import RigError
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.close import close_records
from anglecam.loop.cross_validation import Prediction, predict_held_out, split_records
from anglecam.loop.stepwise import applicable
from anglecam.loop.verdict_json import verdict_as_dict
from anglecam.models.plant import Plant
from anglecam.report.wording import sentence
from benchmarks.blind.sessions import session as drawn_session
from support.closing import close_without_rivals
from support.motion import Plant as TruePlant
from support.series import session

HELD_OUT = ["random"]
THREE = ("stairs", "chirp", "random")
"""Recordings of a drawn session that show what acts in all five."""


@pytest.mark.parametrize(
    ("session_name", "effect_id", "name", "value"),
    [
        ("late", "dead_time", "tau_s", 0.040),
        ("rubbing", "coulomb_friction", "friction_deg_per_s2", np.degrees(2.0)),
        # drag is named with its size in `tests/loop/test_windows_asked_again.py`
        pytest.param("dragging", "quadratic_drag", "q_per_rad", 1.0, marks=pytest.mark.sweep),
    ],
)
def test_the_hidden_effect_is_named_with_its_true_size(closed, session_name, effect_id, name, value):
    result = verdict_as_dict(closed(session_name))
    assert result["verdict"] == "attributed"
    assert [e["id"] for e in result["effects"]] == [effect_id]
    assert list(result["effects"][0]["parameters"]) == [name]  # no staged parameter of friction is added
    found = result["effects"][0]["parameters"][name]
    assert abs(found["value"] - value) < 3.0 * found["sigma"]
    assert result["rmse_deg"]["after"]["held_out"] == pytest.approx(0.05, rel=0.15)
    assert result["held_out_gain"]["interval_95"][0] > 0.0
    assert result["effects"][0]["alias_set"][0] == effect_id


@pytest.mark.sweep  # friction is named at another seed in `test_the_hidden_effect_is_named_with_its_true_size`
@pytest.mark.parametrize("seed", [105, 108])
def test_a_wrongly_predicted_breakaway_does_not_contradict_dry_friction(seed):
    # at each seed the fitted recordings do not determine the breakaway torque, or do not require it, although the
    # held-out one depends on it
    friction = {"coulomb_friction": {"torque": 1.83, "breakaway": 2.69}}
    verdict = close_without_rivals(drawn_session(friction, seed=seed, sigma_deg=0.0005), held_out=HELD_OUT)
    assert [a.effect.id for a in verdict.accepted] == ["coulomb_friction"]
    assert abs(verdict.after.parameters[3] - 1.83) < 3.0 * verdict.after.sigma[3]


@pytest.mark.sweep
def test_a_limit_that_is_reached_once_is_named_or_its_only_alias():
    # it acts for a fraction of a second; if a second were left out at a time, the rest would not determine it. A torque
    # that falls with the speed explains it as well: the log-likelihoods differ by 0.1
    limit = {"torque_saturation": {"limit": 159.7, "share": 0.628}}
    verdict = close_records(drawn_session(limit, seed=0, sigma_deg=0.05), held_out=HELD_OUT)
    (found,) = verdict.accepted
    assert {"torque_saturation"} <= set(found.alias_set) <= {"torque_saturation", "speed_dependent_torque"}


def test_a_driven_body_without_its_command_is_unexplained_and_no_noisy_free_swing():
    driven = session(TruePlant(a=5.0, b=60.0, c=55.0), 11, duration_s=5.0)[3]
    assert close_records([replace(driven, command=None)]).verdict == "unexplained"


def test_friction_has_no_asymmetry_unless_the_zero_is_declared():
    records = drawn_session(
        {"coulomb_friction": {"torque": 2.0, "downward": 1.6}}, seed=2, sigma_deg=0.005, names=THREE
    )
    free, known = ([replace(r, zero_known=one) for r in records] for one in (False, True))
    (even,), (uneven,) = ([e for e in applicable(rs) if e.id == "coulomb_friction"] for rs in (free, known))
    assert "asymmetry_deg_per_s2" not in [p.name for p in even.parameters]
    assert len(uneven.parameters) == len(even.parameters) + 1
    verdict = close_without_rivals(free, held_out=HELD_OUT)
    assert [a.effect.id for a in verdict.accepted] == ["coulomb_friction"]
    assert abs(verdict.after.parameters[3] - 1.8) < 3.0 * verdict.after.sigma[3]  # the mean of both directions


def test_two_hidden_effects_are_both_named():
    result = verdict_as_dict(
        close_without_rivals(
            session(TruePlant(dead_time_s=0.03, coulomb=2.0), 12, duration_s=5.0)[::2], held_out=HELD_OUT
        )
    )
    assert {e["id"] for e in result["effects"]} == {"dead_time", "coulomb_friction"}


def test_a_declared_centre_of_mass_is_not_fitted_and_makes_the_weight_more_certain():
    gravity = {"gravity_geometry": {"strength": 60.0, "gravity_deg": 20.0}}
    records = drawn_session(gravity, seed=4, sigma_deg=0.01, names=THREE)
    declaring = [replace(r, mass_from_upright=np.radians(20.0)) for r in records]
    verdict = close_without_rivals(declaring, held_out=HELD_OUT)
    assert [a.effect.id for a in verdict.accepted] == ["gravity_geometry"]
    declared = verdict.after
    assert declared.model.names[3:] == ("gravity_deg_per_s2",)
    start = np.array([26.0, 524.0, 508.0, 60.0, np.radians(20.0)])
    free = fit_output_error(Plant((effect("gravity_geometry"),)), split_records(records, HELD_OUT)[0], [start])
    for fit in (declared, free):
        assert abs(fit.parameters[3] - 60.0) < 3.0 * fit.sigma[3]
    assert declared.sigma[3] < 0.25 * free.sigma[3]


def test_no_effect_is_named_if_none_is_hidden(closed):
    # at 5 % a session the chance of two false alarms in four is 1 %
    assert sum(closed(f"clean {seed}").verdict != "nothing_missing" for seed in range(4)) <= 1
    detectable = {d["id"]: d["smallest"] for d in verdict_as_dict(closed("clean 0"))["detectable"]}
    # a series without pixels has no rows, and a constant torque cannot be distinguished from an undeclared zero
    assert set(detectable) >= {"dead_time", "coulomb_friction", "backlash", "clock_scale"}
    assert not set(detectable) & {"rolling_shutter", "constant_torque"}
    assert all(smallest > 0.0 for smallest in detectable.values())


@pytest.mark.parametrize("cause", ["magnet", pytest.param("gusts", marks=pytest.mark.sweep)])
def test_an_effect_outside_the_ledger_is_called_unexplained(closed, cause):
    verdict = closed(cause)
    assert verdict.verdict == "unexplained"
    assert verdict_as_dict(verdict)["effects"] == []
    assert "none" in sentence(verdict)


def test_one_recording_alone_is_predicted_block_by_block(closed):
    verdict = closed("one recording")
    (alone,) = verdict.fitted
    assert [a.effect.id for a in verdict.accepted] == ["dead_time"]
    (tested,) = verdict.before_held_out.records
    assert set(tested.time) <= set(alone.time)
    assert len(tested.time) > 0.95 * len(alone.time)


def test_a_clock_offset_below_zero_is_found_as_a_dead_time_below_zero():
    def lagging(record):
        return replace(record, command=replace(record.command, time=record.command.time + 0.02))

    verdict = close_without_rivals([lagging(r) for r in session(TruePlant(), 15)[::2]], held_out=HELD_OUT)
    (found,) = verdict_as_dict(verdict)["effects"]
    assert found["id"] == "dead_time"
    assert found["parameters"]["tau_s"]["value"] == pytest.approx(-0.02, abs=0.001)


def test_cross_validation_does_not_fit_the_frames_that_it_predicts():
    records = session(TruePlant(), 16)
    start = np.array([26.0, 524.0, 508.0])
    _, unseen = predict_held_out(fit_output_error(Plant(), records, [start]), records, [])
    assert unseen.rmse == pytest.approx(np.radians(0.05), rel=0.1)
    # the predictions must not follow half a second of nonsense, and those of other frames change only a little
    nonsense = np.radians(3.0) * np.sin(40.0 * records[0].time) * (np.abs(records[0].time - 2.6) < 0.25)
    broken = [replace(records[0], angle=records[0].angle + nonsense), *records[1:]]
    _, spoilt = predict_held_out(fit_output_error(Plant(), broken, [start]), broken, [])
    off = spoilt.residuals[0] - unseen.residuals[0]
    inside = np.abs(spoilt.records[0].time - 2.6) < 0.25
    added = np.interp(spoilt.records[0].time, records[0].time, nonsense)
    assert np.degrees(np.abs(off - added)[inside]).max() < 0.05
    assert np.degrees(np.abs(off)[~inside]).max() < 0.3


def test_declared_held_out_recordings_are_predicted_by_the_fit_of_all_others():
    fitted, held_out = split_records(session(TruePlant(), 18), HELD_OUT)
    fit = fit_output_error(Plant(), fitted, [np.array([26.0, 524.0, 508.0])])
    declared, all_frames = predict_held_out(fit, fitted, held_out)
    assert [r.name for r in declared.records] == HELD_OUT
    assert len(all_frames.records) == len(fitted) + 1


def test_a_wrong_model_changes_the_robust_error_and_a_few_outliers_do_not():
    record = session(TruePlant(), 20)[0]
    noise = np.random.default_rng(0).normal(0.0, 0.001, len(record.time))
    stuck, wrong = noise.copy(), noise + 0.005
    stuck[40:50] += 0.05
    assert Prediction((record,), (stuck,), 0.0).robust_sigma == pytest.approx(0.001, rel=0.15)
    assert Prediction((record,), (wrong,), 0.0).robust_sigma > 0.005


def test_a_torque_limit_is_detectable_only_where_it_acts(closed):
    verdict = closed("clean 0")
    (limit,) = [d for d in verdict_as_dict(verdict)["detectable"] if d["id"] == "torque_saturation"]
    # the servo is never required to give more than c·u + b·θ
    asked = max(508.0 * np.abs(r.command.angle).max() + 524.0 * np.abs(r.angle).max() for r in verdict.fitted)
    assert 0.0 < limit["smallest"] < np.degrees(asked)


def test_holding_out_everything_is_refused():
    records = session(TruePlant(), 19)
    with pytest.raises(RigError, match="nothing is left"):
        split_records(records, [r.name for r in records])
