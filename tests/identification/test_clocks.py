"""Offset and drift of the command's clock from the motion alone, and what distinguishes an offset from a dead time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.clock_fit import fit_clocks
from anglecam.identification.clock_search import coarse_offset
from anglecam.identification.clocks import clocks_of
from anglecam.identification.identify_records import identify_records
from anglecam.io.rig import Rig
from anglecam.models.plant import Plant
from support.motion import Plant as TruePlant
from support.motion import Recording
from support.series import record, session

FIXED = {"asymmetry_deg_per_s2": 0.0, "breakaway_excess_deg_per_s2": 0.0, "stribeck_speed_deg_per_s": 0.0}


def _on_other_clocks(records, offsets, drifts):
    """Return the recordings with commands stamped by clocks: clip's time = (1 + drift)·command's time + offset."""
    each = zip(records, offsets, drifts, strict=True)
    return [replace(r, command=replace(r.command, time=(r.command.time - o) / (1.0 + d))) for r, o, d in each]


def test_offsets_and_drifts_are_found_within_their_uncertainty():
    errors = []
    for seed in range(12):
        rng = np.random.default_rng(1000 + seed)
        offsets, drifts = rng.uniform(-1.0, 1.0, 3), rng.normal(0.0, 1e-3, 3)
        records = session(TruePlant(), seed)[:3]
        found = fit_clocks(_on_other_clocks(records, offsets, drifts))
        sigma = np.sqrt(np.diag(found.covariance))
        errors.append(np.concatenate([found.delays - offsets, found.drifts - drifts]) / sigma)
        assert np.median(sigma[:3]) < 1e-3
        assert np.median(sigma[3:]) < 2e-4
    inside = np.mean(np.abs(errors) < 1.96)
    assert 0.85 < inside <= 1.0  # 72 values, an offset and a drift of one recording being correlated
    assert np.std(errors) == pytest.approx(1.0, abs=0.25)


def test_without_a_lamp_the_dead_time_is_part_of_every_offset_and_the_alias_says_so():
    records = session(TruePlant(dead_time_s=0.04), 3)[:3]
    offsets = np.array([0.3, -0.2, 0.1])
    clocks = clocks_of(fit_clocks(_on_other_clocks(records, offsets, np.zeros(3))), {})
    assert np.all(np.abs(clocks.offsets - offsets - 0.04) < 4.0 * clocks.offset_sigmas)
    result = clocks.as_dict()
    assert result["alias"]["effects"] == ["dead_time", "actuator_lag"]
    assert result["alias"]["dead_time_s"] is None
    assert "differences between recordings are clock offsets" in result["alias"]["statement"]


def test_equal_offsets_are_not_said_to_differ():
    clocks = clocks_of(fit_clocks(session(TruePlant(dead_time_s=0.04), 4)[:3]), {})
    assert clocks.equal_p_value > 1e-3
    assert "differences" not in clocks.alias


def test_a_lamp_in_one_recording_separates_the_dead_time_in_all():
    records, offsets = session(TruePlant(dead_time_s=0.04), 5)[:3], np.array([0.3, -0.2, 0.1])
    fit = fit_clocks(_on_other_clocks(records, offsets, np.zeros(3)))
    clocks = clocks_of(fit, {"steps": (0.302, 0.003)})
    assert clocks.dead_time is not None
    value, sigma = clocks.dead_time
    assert abs(value - 0.04) < 3.0 * sigma
    assert 0.003 <= sigma < 0.004
    assert np.all(np.abs(clocks.offsets - offsets) < 3.0 * clocks.offset_sigmas)
    assert clocks.as_dict()["alias"]["effects"] == []


def test_a_drift_is_told_apart_from_a_delay_by_its_growth():
    records = session(TruePlant(dead_time_s=0.04), 6)[:2]
    found = fit_clocks(_on_other_clocks(records, np.zeros(2), np.full(2, 3e-3)))
    sigma = np.sqrt(np.diag(found.covariance))
    assert np.all(np.abs(found.drifts - 3e-3) < 4.0 * sigma[2:])
    assert np.all(np.abs(found.delays - 0.04) < 4.0 * sigma[:2])


def test_a_single_step_shows_an_offset_and_no_drift():
    one = record(TruePlant(), Recording("once", "steps", duration_s=1.6), np.random.default_rng(0), sigma_deg=0.2)
    kept = one.command.time <= one.command.time[1]
    step = replace(one, command=replace(one.command, time=one.command.time[kept], angle=one.command.angle[kept]))
    step = step.between(0.0, 1.0)
    found = fit_clocks([step])
    assert found.drifts is None
    assert abs(found.delays[0]) < 4.0 * np.sqrt(found.covariance[0, 0])


def test_a_free_swing_has_no_clock():
    swing = record(TruePlant(a=1.0), Recording("swing", "release"), np.random.default_rng(0), sigma_deg=0.05)
    assert fit_clocks([swing]) is None


def test_a_significant_offset_is_a_doubt_about_the_model():
    records = _on_other_clocks(session(TruePlant(), 7)[:2], [0.05, 0.05], [0.0, 0.0])
    model = replace(identify_records(records, Rig(), "oe2"), clock=clocks_of(fit_clocks(records), {}))
    assert any("the motion comes 0.05" in doubt for doubt in model.doubts)
    entry = model.as_dict()["clock"]["steps"]
    assert entry["offset_s"]["value"] == pytest.approx(0.05, abs=4.0 * entry["offset_s"]["sigma"])
    assert set(entry["drift_ppm"]) == {"value", "sigma"}


def test_clocks_are_fitted_together_with_the_effects_of_the_plant():
    records = _on_other_clocks(session(TruePlant(coulomb=2.0), 8)[:3], [0.2, 0.0, -0.1], np.zeros(3))
    found = fit_clocks(records, [(effect("coulomb_friction").with_fixed(FIXED), np.array([1.0]))])
    sigma = np.sqrt(np.diag(found.covariance))[:3]
    assert np.all(np.abs(found.delays - [0.2, 0.0, -0.1]) < 4.0 * sigma)
    assert found.fit.parameters[3] == pytest.approx(2.0, rel=0.05)


def test_an_angle_that_moves_in_its_last_frame_only_shows_no_offset():
    still = session(TruePlant(), 0)[0]
    still = replace(still, angle=np.append(np.full(len(still.time) - 1, 0.5), 0.9))
    assert coarse_offset(still.between(0.0, still.time[-1])) == 0.0


def test_what_the_model_lacks_is_not_taken_for_a_drift():
    stuck = Plant((effect("backlash"),))
    records = []
    for one in session(TruePlant(), 7)[:3]:
        noise = np.random.default_rng(7).normal(0.0, np.radians(0.02), len(one.time))
        angle = stuck.predict(np.array([26.0, 524.0, 508.0, np.radians(0.4)]), one.time, one.command, np.zeros(2))
        records.append(replace(one, angle=angle + noise, sigma=np.full(len(noise), np.radians(0.02))))
    without = fit_clocks(records)
    assert without.drifts is None
    assert without.covariance.shape == (3, 3)
    known = fit_clocks(records, [(effect("backlash"), np.radians([0.3]))])
    assert np.all(np.abs(known.drifts) < 4.0 * np.sqrt(np.diag(known.covariance)[3:]))
