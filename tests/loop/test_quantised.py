"""Verdicts on angles that are rounded to the steps of an encoder, without a stated uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.identification.noise import QUANTISED
from anglecam.loop.verdict_json import verdict_as_dict
from support.closing import close_without_rivals
from support.motion import Plant
from support.series import session

STEP = np.radians(0.088)


def closed(plant, seed):
    records = [
        replace(r, angle=STEP * np.round(r.angle / STEP))
        for r in session(plant, seed, sigma_deg=0.0, duration_s=5.0)[::2]
    ]
    return close_without_rivals(records, held_out=["random"], seed=seed)


def test_friction_is_named_with_its_size_and_nothing_beside_it():
    verdict = closed(Plant(coulomb=2.0), 0)
    assert [a.effect.id for a in verdict.accepted] == ["coulomb_friction"]
    assert verdict.after.parameters[3] == pytest.approx(2.0, rel=0.05)
    assert verdict.noise.source == QUANTISED
    assert verdict_as_dict(verdict)["rmse_deg"]["noise_floor"] == pytest.approx(0.088 / np.sqrt(12.0), rel=1e-3)


def test_rounding_alone_is_nothing_missing():
    # at 5 % a session the chance of two false alarms in three is below 1 %
    verdicts = [closed(Plant(), seed).verdict for seed in range(3)]
    assert verdicts.count("nothing_missing") >= 2


def test_unknown_noise_is_reported_as_such():
    records = [r.between(1.0, np.inf) for r in session(Plant(coulomb=2.0), 1, duration_s=5.0)[::2]]
    result = verdict_as_dict(close_without_rivals(records, held_out=["random"]))
    assert result["verdict"] == "attributed"
    assert not result["noise"]["known"]
