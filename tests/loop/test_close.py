"""The loop on series whose hidden effect is known: it names it, names nothing, or says that it cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.loop.close import close_records
from anglecam.loop.holdout import split_records
from anglecam.loop.result import sentence, verdict_as_dict
from support.motion import Plant as TruePlant
from support.series import session

HELD_OUT = ["random"]


@pytest.mark.parametrize(
    ("true", "effect_id", "name", "value"),
    [
        (TruePlant(dead_time_s=0.040), "dead_time", "tau_s", 0.040),
        (TruePlant(coulomb=2.0), "coulomb_friction", "friction_deg_per_s2", np.degrees(2.0)),
        (TruePlant(quadratic_drag=1.0), "quadratic_drag", "q_per_rad", 1.0),
    ],
)
def test_the_hidden_effect_is_named_and_its_size_found(true, effect_id, name, value):
    result = verdict_as_dict(close_records(session(true, 11), held_out=HELD_OUT))
    assert result["verdict"] == "attributed"
    assert [e["id"] for e in result["effects"]] == [effect_id]
    found = result["effects"][0]["parameters"][name]
    assert abs(found["value"] - value) < 3.0 * found["sigma"]
    assert result["rmse_deg"]["after"]["held_out"] == pytest.approx(0.05, rel=0.15)
    assert result["held_out_gain"]["interval_95"][0] > 0.0
    assert result["effects"][0]["alias_set"][0] == effect_id


def test_two_hidden_effects_are_both_named():
    result = verdict_as_dict(close_records(session(TruePlant(dead_time_s=0.03, coulomb=2.0), 12), held_out=HELD_OUT))
    assert {e["id"] for e in result["effects"]} == {"dead_time", "coulomb_friction"}


@pytest.mark.parametrize("phi", [0.0, 0.6])
def test_nothing_is_named_where_nothing_is_hidden(phi):
    verdicts = [close_records(session(TruePlant(), seed, phi=phi), held_out=HELD_OUT, seed=seed) for seed in range(6)]
    # at 5 % a session the chance of two false alarms in six is 3 %
    assert sum(v.verdict != "nothing_missing" for v in verdicts) <= 1
    detectable = verdict_as_dict(verdicts[0])["detectable"]
    assert {d["id"] for d in detectable} == {"dead_time", "coulomb_friction", "quadratic_drag"}
    assert all(d["smallest"] > 0.0 for d in detectable)


def test_an_effect_outside_the_ledger_is_called_unexplained():
    def shake(record):
        return replace(record, angle=record.angle + np.radians(0.4) * np.sin(2 * np.pi * 1.3 * record.time))

    verdict = close_records([shake(r) for r in session(TruePlant(), 13)], held_out=HELD_OUT)
    assert verdict.verdict == "unexplained"
    assert verdict_as_dict(verdict)["effects"] == []
    assert "none" in sentence(verdict)


def test_one_recording_alone_is_cut_in_time():
    verdict = close_records(session(TruePlant(dead_time_s=0.05), 14)[-1:])
    assert [a.effect.id for a in verdict.accepted] == ["dead_time"]
    assert verdict.held_out[0].time[0] > verdict.fitted[0].time[-1]


def test_a_clock_offset_below_zero_is_found_as_a_dead_time_below_zero():
    def lagging(record):
        return replace(record, command=replace(record.command, time=record.command.time + 0.02))

    verdict = close_records([lagging(r) for r in session(TruePlant(), 15)], held_out=HELD_OUT)
    (found,) = verdict_as_dict(verdict)["effects"]
    assert found["id"] == "dead_time"
    assert found["parameters"]["tau_s"]["value"] == pytest.approx(-0.02, abs=0.001)


def test_a_lone_driven_recording_is_cut_in_time_and_not_held_out_whole():
    driven, other = session(TruePlant(), 16)[:2]
    fitted, held_out = split_records([driven, replace(other, command=None)], [])
    assert any(r.command is not None for r in fitted)
    assert held_out[0].time[0] > max(r.time[-1] for r in fitted if r.name == driven.name)


def test_a_model_that_fails_on_held_out_data_is_not_called_complete():
    *quiet, loud = session(TruePlant(), 17, sigma_deg=0.01)
    shaken = replace(loud, angle=loud.angle + np.radians(0.5) * np.sin(9.0 * loud.time))
    assert close_records([*quiet, shaken], held_out=HELD_OUT).verdict == "unexplained"
