"""The search on stretches of long recordings, and the fit of what it found to the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.loop.close import close_records
from anglecam.loop.policy import DEFAULT
from anglecam.loop.stretches import FEWEST_SAMPLES, MOST_STRETCHES, stretches
from anglecam.loop.verdict_json import verdict_as_dict
from support.motion import Plant, Recording
from support.series import record, session

SHORT = replace(DEFAULT, stepwise=replace(DEFAULT.stepwise, most_samples=800))
KINDS = ("stairs", "chirp", "random")


def test_short_recordings_are_searched_whole():
    records = session(Plant(), 0)
    assert stretches(records, sum(len(r.time) for r in records)) == tuple(records)
    assert stretches([], 10) == ()


def test_stretches_begin_and_end_with_the_recording_and_do_not_overlap():
    (first, *_) = session(Plant(), 0)
    time = np.arange(9001) / 100.0
    long = replace(first, time=time, angle=np.sin(time), sigma=np.full(len(time), np.nan))
    parts = stretches([long], 3000)
    assert len(parts) == MOST_STRETCHES
    assert parts[0].time[0] == time[0]
    assert parts[-1].time[-1] == time[-1]
    assert all(len(part.time) == 3000 // MOST_STRETCHES >= FEWEST_SAMPLES for part in parts)
    assert np.all(np.diff(np.concatenate([part.time for part in parts])) > 0)
    assert all(part.command is long.command for part in parts)


def test_of_many_short_recordings_evenly_spread_ones_are_used():
    records = [replace(r, name=f"{k}-{r.name}") for k in range(4) for r in session(Plant(), 0)]
    chosen = stretches(records, 1000)
    assert [part.name for part in chosen] == [records[i].name for i in (0, 6, 12, 19)]


@pytest.fixture(scope="module")
def closed():
    rng = np.random.default_rng(0)
    plant = Plant(coulomb=2.0)
    records = [record(plant, Recording(kind, kind), rng, sigma_deg=0.05, rate_hz=100.0) for kind in KINDS]
    return records, close_records(records, held_out=["random"], policy=SHORT)


def test_the_search_on_stretches_finds_the_effect_and_the_whole_gives_its_size(closed):
    _, verdict = closed
    assert verdict.verdict == "attributed"
    assert [a.effect.id for a in verdict.accepted] == ["coulomb_friction"]
    value, sigma = verdict.after.parameters[3], verdict.after.sigma[3]
    assert abs(value - 2.0) < 3.0 * sigma
    assert sigma < 0.02 * value


def test_errors_are_those_of_the_whole_recordings(closed):
    records, verdict = closed
    assert [len(left) for left in verdict.after.residuals] == [len(r.time) for r in records[:-1]]
    assert [len(left) for left in verdict.after_held_out.residuals] == [len(records[-1].time)]
    samples = verdict_as_dict(verdict)["samples"]
    assert samples["searched"] <= 800
    assert samples["fitted"] == sum(len(r.time) for r in records[:-1])
