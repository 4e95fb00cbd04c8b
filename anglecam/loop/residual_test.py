"""The residual test: does the residual contain structure that noise would not leave.

Several tests examine the whitened residual of a fitted model: its component along the change that each possible effect
would make, along functions of angle, velocity, command and time, along the changes that any torque over angle or speed
would make, and its autocorrelation. Every statistic is a share of the residual's energy, so no test needs the size of
the noise (`structure_p_values`). The smallest p-value of all tests is the statistic of the residual test. Its null
distribution comes from a parametric bootstrap (`noise_draws`), so neither the number of tests nor their correlation has
to be known. Davison and Hinkley, Bootstrap Methods and their Application, 1997, sec. 4.2 and 4.4.

In quantised angles the draws also show how far each test's p-value is from the uniform distribution that it has in
white noise, and it is corrected by that.

An effect with an unknown frequency is compared with the residual at many of them, and some frequency always fits noise
well. Every draw is therefore searched as the data are. From the draws follows with how many independent directions the
best one competes, and by this number the p-value of the effect is corrected (Šidák, J. Am. Stat. Assoc. 62, 1967), so
that an effect with many directions takes no power from the tests with one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.identification.fit import Fit, whiten
from anglecam.loop.noise_draws import data_and_draws, in_blocks
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import effects_of
from anglecam.loop.screen import Direction
from anglecam.loop.seen import largest_shares, seen_of
from anglecam.loop.structure_p_values import (
    as_uniform,
    before_uniform,
    competing_directions,
    exponential_scale,
    gain_of_share,
    p_of_autocorrelation,
    p_of_directions,
    p_of_space,
    sidak,
)
from anglecam.loop.torque_basis import torque_responses


@dataclass(frozen=True)
class StructureTest:
    """One of the tests for structure."""

    name: str
    """``effect ID``, ``residual against X``, ``torque against X`` or ``autocorrelation``."""
    p_value: float
    """Of this test alone: corrected for the directions of its effect, but not for the number of tests."""


@dataclass(frozen=True)
class ResidualTest:
    """Result of all tests together."""

    p_value: float
    """Probability that noise alone gives at least one test a p-value as small as the smallest one here."""
    tests: tuple[StructureTest, ...]
    further_gain: float
    """Log-likelihood gain of the best effect, or of an arbitrary torque curve over angle or over speed, less what the
    best would gain in noise on average; at least 0."""
    competing: dict[str, float]
    """Effect id → number of independent directions of which the best one is compared with the residual."""
    detectable: dict[str, float]
    """Effect id → smallest magnitude of its first parameter, SI, that the test would have detected; the policy's
    ``missed_detection_rate`` is the probability of overlooking it."""
    scales: dict[str, tuple[float, float]]
    """Name of a test → shape and scale by which its p-value was corrected for quantised angles."""
    noise_p_values: Floats = field(repr=False)
    """(k,) smallest p-value of an effect in each of k draws, ascending."""
    level: float
    """The round's part of the policy's false-alarm rate; p-values below it indicate structure."""

    @property
    def passed(self) -> bool:
        """Whether the residual shows no structure."""
        return self.p_value >= self.level

    def chance(self, effect: Effect, log_likelihood_gain: float) -> float:
        """Return how often noise alone gives at least one effect a gain as improbable as that of a fitted effect.

        Parameters
        ----------
        effect : Effect
            The fitted effect; its number of parameters counts.
        log_likelihood_gain : float
            By fitting it, nat.

        Returns
        -------
        float
            p-value, a multiple of 1/(k + 1) with k draws.
        """
        p = special.chdtrc(len(effect.parameters), 2.0 * max(log_likelihood_gain, 0.0))
        p = sidak(p, self.competing.get(effect.id, 1.0))
        p = as_uniform(p, self.scales.get(f"effect {effect.id}", (1.0, 1.0)))
        return float((1 + np.searchsorted(self.noise_p_values, p, side="right")) / (1 + len(self.noise_p_values)))


def run_residual_test(
    fit: Fit,
    records: Sequence[Record],
    effect_directions: Sequence[Direction],
    rng: np.random.Generator,
    smallest_rms: float,
    policy: Policy = DEFAULT,
    *,
    phi_estimated: bool,
) -> ResidualTest:
    """Test the residual of a fitted plant for structure.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, whitened with the AR(1) coefficient of the noise.
    records : sequence of Record
        The fitted recordings.
    effect_directions : sequence of Direction
        From `anglecam.loop.screen.directions` of the same fit, for every effect that could be added.
    rng : numpy.random.Generator
        For the bootstrap.
    smallest_rms : float
        RMS, rad, below which the loop ignores structure however significant; no smaller effect counts as detectable.
    policy : Policy
        Thresholds.
    phi_estimated : bool
        Whether the AR(1) coefficient of the noise was estimated from the residual.

    Returns
    -------
    ResidualTest
        With a p-value from `noise_draws.DRAWS` bootstrap draws.
    """
    n, free = len(fit.white), len(fit.white) - fit.slopes.rank
    both, quantised = data_and_draws(fit, records, rng, phi_estimated)
    energy = np.concatenate([np.sum(block**2, axis=0) for block in in_blocks(both)])
    energy[energy == 0.0] = 1.0

    p_each, competing, gains = {}, {}, [np.zeros(both.shape[1])]
    for name, (p, gain) in _tested_effects(fit, records, effect_directions, both, energy).items():
        competing[name] = competing_directions(p[1:])
        p_each[f"effect {name}"] = sidak(p, competing[name])
        gains.append(gain - gain[1:].mean())
    for name, basis in _shapes(fit, records).items():
        p_each[f"residual against {name}"], _ = p_of_space(basis, fit.slopes, both, energy, free)
    for name, basis in torque_responses(fit, records).items():
        p_each[f"torque against {name}"], gain = p_of_space(basis, fit.slopes, both, energy, free)
        gains.append(gain - gain[1:].mean())
    p_each["autocorrelation"] = p_of_autocorrelation(both, energy, records)

    scales = {name: exponential_scale(p[1:]) if quantised else (1.0, 1.0) for name, p in p_each.items()}
    p_each = {name: as_uniform(p, scales[name]) for name, p in p_each.items()}
    # under the null hypothesis the data are one more draw, so their smallest p-value is ranked among those of all draws
    smallest = np.min(list(p_each.values()), axis=0)
    p_value = np.mean(smallest <= smallest[0])
    level, missed = policy.level(len(effects_of(fit))), policy.residual_test.missed_detection_rate
    critical = float(np.quantile(smallest[1:], level))
    of_effects = [p[1:] for name, p in p_each.items() if name.startswith("effect ")]
    tests = tuple(StructureTest(name, float(p[0])) for name, p in p_each.items())
    detectable: dict[str, float] = {}
    for name, count in competing.items():
        needed_p = before_uniform(critical, scales[f"effect {name}"])
        sigmas = -(special.ndtri(sidak(needed_p, 1.0 / count)) + special.ndtri(missed))
        needed = max(float(sigmas * np.sqrt(fit.cost / free)), smallest_rms * math.sqrt(n))
        detectable |= _detectable([one for one in effect_directions if one.effect.id == name], needed)
    largest = np.max(gains, axis=0)
    further_gain = max(0.0, float(largest[0] - largest[1:].mean()))
    noise_p_values = np.sort(np.min(of_effects, axis=0)) if of_effects else np.ones(len(smallest) - 1)
    return ResidualTest(float(p_value), tests, further_gain, competing, detectable, scales, noise_p_values, level)


def _tested_effects(
    fit: Fit, records: Sequence[Record], each: Sequence[Direction], residuals: Floats, energy: Floats
) -> dict[str, tuple[Floats, Floats]]:
    """Return, for each effect, the smallest p-value and the largest log-likelihood gain over its directions.

    Both are arrays with one value for each residual (column). The directions of an effect that is searched in the
    residual depend on the residual, so all pairs of directions that could have been chosen take their place.
    """
    found: dict[str, tuple[Floats, Floats]] = {}
    free = len(residuals) - fit.slopes.rank
    seen = None
    for name in dict.fromkeys(direction.effect.id for direction in each):
        same = [direction for direction in each if direction.effect.id == name]
        searched = same[0].effect.searched
        if searched is None:
            found[name] = p_of_directions(same, residuals, energy, free)
        else:
            seen = seen or seen_of(fit, records)
            share = largest_shares(fit, records, seen.times, searched(seen), residuals)
            found[name] = special.betaincc(1.0, 0.5 * (free - 2), share), gain_of_share(share, free)
    return found


def _detectable(each: Sequence[Direction], needed: float) -> dict[str, float]:
    """Return the magnitude of each effect at which its change has the norm ``needed``, by log-log interpolation."""
    found: dict[str, float] = {}
    for name in dict.fromkeys(direction.effect.id for direction in each):
        same = [direction for direction in each if direction.effect.id == name]
        shape = same[0].start[1:]
        sizes = {abs(d.start[0] - d.effect.null[0]): d.size for d in same if np.array_equal(d.start[1:], shape)}
        magnitude = np.log(sorted(sizes))
        length = np.log([sizes[m] for m in sorted(sizes)])
        wanted = np.log(needed)
        if same[0].effect.parameters[0].inverse:  # a limit changes nothing until it is reached, so do not interpolate
            reached = magnitude[length >= wanted]
            found |= {name: float(np.exp(reached[0]))} if len(reached) else {}
        elif len(magnitude) > 1 and wanted < length[0]:  # below the smallest magnitude tried the change is proportional
            found[name] = float(np.exp(magnitude[0] + wanted - length[0]))
        elif wanted <= length.max():
            found[name] = float(np.exp(np.interp(wanted, np.maximum.accumulate(length), magnitude)))
    return found


def _shapes(fit: Fit, records: Sequence[Record]) -> dict[str, Floats]:
    """Return whitened functions of angle, velocity, command and time, (N, k) each, on which a residual may depend."""
    groups: dict[str, list[Floats]] = {"angle": [], "velocity": [], "command": [], "time": []}
    predicted = [r.angle - e for r, e in zip(records, fit.residuals, strict=True)]
    rates = [np.gradient(p, r.time) for p, r in zip(predicted, records, strict=True)]
    swing = float(max(np.ptp(p) for p in predicted)) or 1.0
    speed = float(max(np.ptp(w) for w in rates)) or 1.0
    for record, path, rate in zip(records, predicted, rates, strict=True):
        x, v = (path - path.mean()) / swing, rate / speed
        s = (record.time - record.time[0]) / (record.time[-1] - record.time[0])
        earlier = [record.time - k * record.interval for k in range(6)]
        held = [np.zeros(len(t)) if record.command is None else record.command.at(t) for t in earlier]
        shapes: dict[str, list[Floats]] = {
            "angle": [x**2, x**3],
            "velocity": [v, v * np.abs(v), np.tanh(v / 0.02)],
            "command": held,
            "time": [s - 0.5, *(np.cos(np.pi * k * s) for k in range(2, 6))],
        }
        for name, columns in shapes.items():
            groups[name].append(whiten(record, fit.phi, np.column_stack(columns)))
    return {name: np.concatenate(blocks) for name, blocks in groups.items()}
