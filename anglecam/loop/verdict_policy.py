"""Thresholds of what is stated: structure in a residual, the verdict, the free form, the next experiment."""

from __future__ import annotations

import math
from dataclasses import dataclass

from anglecam.loop.threshold import threshold


@dataclass(frozen=True)
class ResidualTestPolicy:
    """Whether a residual holds structure, and what size of an effect would have been detected.

    The false-alarm rate is a budget. The first round of the search spends `first_round_share` of it, and the rounds
    after it, one for each further effect and one for the final model, share the rest equally (`level`). By Bonferroni's
    inequality the rate of all rounds together is then no larger than the budget.
    """

    false_alarm_rate: float = threshold(
        0.05,
        "probability",
        "p-value below which structure is significant, all rounds of the search together",
        "how often a session is given an effect, or called unexplained, because of noise alone",
        "the usual 5 %",
    )
    first_round_share: float = threshold(
        0.8,
        "share of false_alarm_rate",
        "spent by the first round of the search, whose model has no effect",
        "how often the verdict is not nothing_missing where nothing is missing; a smaller share misses more effects",
        "further effects are tested in fewer sessions than the first, so most of the budget goes to the first round",
    )
    missed_detection_rate: float = threshold(
        0.05,
        "probability",
        "probability that the test overlooks an effect of the size that loop.json lists under detectable",
        "how often an effect of the stated detectable size is missed",
        "not calibrated; the usual 5 %",
    )


@dataclass(frozen=True)
class VerdictPolicy:
    """When the final model leaves structure, so that the verdict is ``unexplained``."""

    noise_contradiction_ratio: float = threshold(
        1.5,
        "times the final model's fitted RMS error",
        "a larger estimate of the noise, other than a film's, is not used: the residual contains the noise",
        "taking structure for noise because the noise was overestimated, for instance from motion at a rest",
    )
    contradiction_ratio: float = threshold(
        3.0,
        "times the fitted RMS error",
        "a model lacks something if its robust error on held-out recordings is larger and no parameters reduce it",
        "withdrawing a correct model because of one recording that it predicts badly",
        "set with films 0007, 0013 and 0015 in view",
    )
    least_explained_share: float = threshold(
        0.5,
        "share of the base model's squared held-out error beyond the noise",
        "where structure remains, effects are named if together they explain at least this, the larger part",
        "naming effects that only resemble a cause outside the ledger",
        "the best single effect of 33 sessions with sixteen causes outside the ledger explained more in 11: two "
        "limit cycles, hysteresis, a bent cable, a magnet, an amplifier's step, a shifted load, a torque walk: "
        "the verdict says that more is missing, and the share is stated beside each effect",
    )
    energy_gain_sigmas: float = threshold(
        3.0,
        "standard uncertainties",
        "a body that nothing drives gains no energy: its damping may not be further below zero",
        "withdrawing a correct model of a swing that hardly decays: 0.1 % of such swings",
    )


@dataclass(frozen=True)
class FreeFormPolicy:
    """A torque of free form; cross_validation.false_gain_rate decides whether it predicts better."""

    least_similarity: float = threshold(
        0.7,
        "correlation",
        "an effect resembles the torque if the changes that both make to the angles correlate at least so much",
        "listing an effect that is not the cause, or leaving out one that is",
        "not calibrated; the effect then shares half of the torque's change",
    )


@dataclass(frozen=True)
class NextExperimentPolicy:
    """Which recording is proposed to distinguish the effects of an alias set."""

    separated_sigmas: float = threshold(
        3.0,
        "standard deviations of the noise",
        "distance between the predictions of two models from which on a recording separates them",
        "naming the wrong one of two models after the proposed recording: the log-likelihood ratio is then 4.5 ± 3, "
        "which is below zero with probability 0.07",
        "the expected log-likelihood ratio is tested on rigs with known effects; the value is not calibrated",
    )
    saturated_sigmas: float = threshold(
        6.0,
        "standard deviations of the noise",
        "a larger distance counts no more: of recordings that reach it the shorter one is proposed",
        "proposing a longer recording that adds no information",
    )
    angle_excess_share: float = threshold(
        0.02,
        "share of the range of angles that were recorded",
        "a predicted angle may exceed the recorded range by this much",
        "proposing a command that moves the rig to where it has not been",
    )
    smallest_noise_rad: float = threshold(
        math.radians(1e-3),
        "rad",
        "the noise is taken to be at least this, because forward models and files are not much more accurate",
        "calling two models separated by their numerical errors",
    )
