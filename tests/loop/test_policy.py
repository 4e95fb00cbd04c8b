"""Every decision threshold is listed in ``loop.json``, and changing one changes a verdict."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from anglecam.loop.close import close_records
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.search_policy import StepwisePolicy
from anglecam.loop.verdict_json import verdict_as_dict
from anglecam.loop.verdict_policy import ResidualTestPolicy, VerdictPolicy
from support.motion import Plant
from support.series import session

HELD_OUT = ["random"]


@pytest.fixture(scope="module")
def contradicted():
    """Return a session without effects whose held-out recording is disturbed."""
    *quiet, last = session(Plant(), 17, sigma_deg=0.01)
    return [*quiet, replace(last, angle=last.angle + np.radians(0.5) * np.sin(9.0 * last.time))]


@pytest.fixture(scope="module")
def tolerant(contradicted):
    """Return the verdict on it where the held-out recording may contradict the model."""
    policy = Policy(stepwise=StepwisePolicy(most_effects=2), verdict=VerdictPolicy(contradiction_ratio=1e6))
    return close_records(contradicted, held_out=HELD_OUT, policy=policy), policy


def test_loop_json_lists_every_threshold_with_its_documentation(tolerant):
    verdict, policy = tolerant
    listed = json.loads(json.dumps(verdict_as_dict(verdict)))
    declared = {
        f"{group.name}.{one.name}": getattr(getattr(policy, group.name), one.name)
        for group in fields(policy)
        for one in fields(getattr(policy, group.name))
    }
    stated = {entry["name"]: entry["value"] for entry in listed["policy"]}
    period = stated["cross_validation.period_s"]  # that of the base model
    assert period == pytest.approx(2.0 * np.pi / np.sqrt(listed["model"]["b_per_s2"]["value"]), rel=0.01)
    assert stated == declared | {"cross_validation.period_s": period}
    assert declared["stepwise.most_effects"] == 2
    for entry in listed["policy"]:
        assert entry.keys() == {"name", "value", "unit", "meaning", "controls", "calibration"}
        assert all(isinstance(entry[key], str) and entry[key] for key in entry.keys() - {"value"})


def test_a_held_out_recording_that_contradicts_the_model_is_accepted_only_with_a_larger_contradiction_ratio(
    contradicted, tolerant
):
    assert close_records(contradicted, held_out=HELD_OUT).verdict == "unexplained"
    assert tolerant[0].verdict == "nothing_missing"


def test_an_effect_is_named_only_if_its_p_value_is_below_the_level_of_its_round(closed):
    usual = closed("dragging, none held out")
    strict = Policy(residual_test=ResidualTestPolicy(false_alarm_rate=0.001))  # of 999 draws the least p-value is 0.001
    assert usual.verdict == "attributed"
    assert close_records(usual.fitted, policy=strict).verdict == "nothing_missing"


def test_the_rounds_together_spend_the_false_alarm_rate():
    levels = [DEFAULT.level(effects) for effects in range(DEFAULT.stepwise.most_effects + 1)]
    assert sum(levels) == pytest.approx(DEFAULT.residual_test.false_alarm_rate)
