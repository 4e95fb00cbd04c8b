"""Effects of the ledger on sessions in which the laboratory's truth acts: named, with a size that agrees."""

from __future__ import annotations

import pytest

from anglecam.effects import effect
from anglecam.identification.systematic import full_sigma
from anglecam.loop.close import close_records
from benchmarks.blind.judged import true_values
from benchmarks.blind.sessions import HELD_OUT, RECORDINGS, session, spec_of

SEED = 1
TRUTHS = {
    "load_dependent_friction": {"share": 0.064, "spring_share": 0.38},
    "speed_dependent_torque": {"stall": 253.0, "no_load_deg_per_s": 436.0},
    "cogging": {"amplitude": 1.5, "periods_per_turn": 80.0, "phase": 1.35},
    "end_stop": {"stiffness": 2070.0, "upper_deg": 13.57, "lower_deg": -11.89, "dissipation": 0.317},
    "elastic_coupling": {"inertia_share": 0.024, "frequency_hz": 3.7, "damping_ratio": 0.04},
    "one_sided_spring": {"stiffness": 17.6, "slack_deg": -0.54},
    "periodic_disturbance": {"amplitude": 1.45, "frequency_hz": 1.46, "phase": 3.3},
    "time_varying_parameter": {"share": -2.4, "time_s": 58.7},
    "command_curve": {"p_per_rad": -0.129, "q_per_rad2": -0.172},
    "perspective": {"yaw_deg": 17.7, "axis_deg": 149.0},
}
"""Sizes that leave a residual of about twice the noise."""
FEW = ("stairs", "release", "random")
"""Recordings that name the effect as all five of a session do; perspective is named by its alias without the others."""


IN_EVERY_RUN = ("speed_dependent_torque", "elastic_coupling")
"""The servo's torque, and additional states; the others are in the sweep."""


@pytest.mark.parametrize(
    "name", [name if name in IN_EVERY_RUN else pytest.param(name, marks=pytest.mark.sweep) for name in TRUTHS]
)
def test_the_acting_effect_is_named_or_an_alias_and_its_size_agrees(name):
    effects = {name: TRUTHS[name]}
    records = session(effects, seed=SEED, names=RECORDINGS if name == "perspective" else FEW)
    verdict = close_records(records, held_out=HELD_OUT, seed=SEED)
    assert verdict.verdict == "attributed"
    (accepted,) = verdict.accepted
    assert name in accepted.alias_set
    fit = verdict.after if accepted.effect.id == name else accepted.rivals[name]
    first = effect(name).parameters[0]
    at = fit.model.names.index(first.name)
    truth = true_values(spec_of(effects, seed=SEED), effects)[name]
    truth = first.to_file / truth if first.inverse else truth / first.to_file
    assert abs(fit.parameters[at] - truth) < 3.0 * full_sigma(fit, verdict.fitted, verdict.noise)[at]
