"""The residual test: does the residual contain structure that noise would not leave.

Several tests examine the whitened residual of a fitted model: its component along the change that each possible effect
would make, along functions of angle, velocity, command and time, along the changes that any torque over angle or speed
would make, and its autocorrelation. Every statistic is a share of the residual's energy, so no test needs the size of
the noise. The smallest p-value of all tests is the statistic of the residual test. Its null distribution comes from a
parametric bootstrap: white noise, from which the column space of the fit's Jacobian is projected out, as the fit
projects it out. So neither the number of tests nor their correlation has to be known. Davison and Hinkley, Bootstrap
Methods and their Application, 1997, sec. 4.2 and 4.4.

The errors of a quantised angle follow the motion and are not white. The draws are then the rounding errors of predicted
motions, each with other parameters among those that the recordings leave possible. They show how far each test's
p-value is from the uniform distribution that it has in white noise, and it is corrected by that.

An effect with an unknown frequency is compared with the residual at many of them, and some frequency always fits noise
well. Every draw is therefore searched as the data are. From the draws follows with how many independent directions the
best one competes, and by this number the p-value of the effect is corrected (Šidák, J. Am. Stat. Assoc. 62, 1967), so
that an effect with many directions takes no power from the tests with one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.identification.fit import Fit, whiten
from anglecam.identification.joined import RUNAWAY, Joined, join
from anglecam.identification.noise import ar1_coefficient
from anglecam.identification.quantisation import Grid, quantisation
from anglecam.identification.slopes import Slopes
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import effects_of
from anglecam.loop.screen import Direction
from anglecam.loop.seen import largest_shares, seen_of
from anglecam.loop.torque_basis import torque_responses

DRAWS = 999
"""Bootstrap draws; with the data's statistic among them p-values are multiples of 1/1000."""
PHASES = 99
"""Phases of the grid at which the size of the errors that a fit follows is estimated."""
LEAST_P = 1e-300
"""Smaller p-values count as this one, so that they have a logarithm."""
LAGS = 15
"""Lags of the autocorrelation test, in frames."""
MOST_DOUBLE = 2**25
"""Most values that all draws together keep in double precision, 256 MB; more are kept in single precision. Shares of
energy, which are sums over all frames, need no more.
"""
AT_ONCE = 2**21
"""Values of the draws that are made or multiplied at once, 16 MB. A test of fewer frames has the draws of one block."""


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
    """(DRAWS,) smallest p-value of an effect in each draw, ascending."""
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
            p-value, a multiple of 1/(DRAWS + 1).
        """
        p = special.chdtrc(len(effect.parameters), 2.0 * max(log_likelihood_gain, 0.0))
        p = _corrected(p, self.competing.get(effect.id, 1.0))
        p = _as_uniform(p, self.scales.get(f"effect {effect.id}", (1.0, 1.0)))
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
        With a p-value from `DRAWS` bootstrap draws.
    """
    n, free = len(fit.white), len(fit.white) - fit.slopes.rank
    both, quantised = _data_and_draws(fit, records, rng, phi_estimated)
    energy = np.concatenate([np.sum(block**2, axis=0) for block in _blocks(both)])
    energy[energy == 0.0] = 1.0

    p_each, competing, gains = {}, {}, [np.zeros(1 + DRAWS)]
    for name, (p, gain) in _tested_effects(fit, records, effect_directions, both, energy).items():
        competing[name] = _competing(p[1:])
        p_each[f"effect {name}"] = _corrected(p, competing[name])
        gains.append(gain - gain[1:].mean())
    for name, basis in _shapes(fit, records).items():
        p_each[f"residual against {name}"], _ = _p_of_space(basis, fit.slopes, both, energy, free)
    for name, basis in torque_responses(fit, records).items():
        p_each[f"torque against {name}"], gain = _p_of_space(basis, fit.slopes, both, energy, free)
        gains.append(gain - gain[1:].mean())
    p_each["autocorrelation"] = special.chdtrc(LAGS, _portmanteau(both, energy, records))

    scales = {name: _exponential_scale(p[1:]) if quantised else (1.0, 1.0) for name, p in p_each.items()}
    p_each = {name: _as_uniform(p, scales[name]) for name, p in p_each.items()}
    # under the null hypothesis the data are one more draw, so their smallest p-value is ranked among those of all draws
    smallest = np.min(list(p_each.values()), axis=0)
    p_value = np.mean(smallest <= smallest[0])
    level, missed = policy.level(len(effects_of(fit))), policy.residual_test.missed_detection_rate
    critical = float(np.quantile(smallest[1:], level))
    of_effects = [p[1:] for name, p in p_each.items() if name.startswith("effect ")]
    tests = tuple(StructureTest(name, float(p[0])) for name, p in p_each.items())
    detectable: dict[str, float] = {}
    for name, count in competing.items():
        needed_p = _before_uniform(critical, scales[f"effect {name}"])
        sigmas = -(special.ndtri(_corrected(needed_p, 1.0 / count)) + special.ndtri(missed))
        needed = max(float(sigmas * np.sqrt(fit.cost / free)), smallest_rms * math.sqrt(n))
        detectable |= _detectable([one for one in effect_directions if one.effect.id == name], needed)
    largest = np.max(gains, axis=0)
    further_gain = max(0.0, float(largest[0] - largest[1:].mean()))
    noise_p_values = np.sort(np.min(of_effects, axis=0)) if of_effects else np.ones(DRAWS)
    return ResidualTest(float(p_value), tests, further_gain, competing, detectable, scales, noise_p_values, level)


def _data_and_draws(
    fit: Fit, records: Sequence[Record], rng: np.random.Generator, phi_estimated: bool
) -> tuple[Floats, bool]:
    """Return (N, 1 + DRAWS) residuals that the fit cannot follow, the data's first, and whether they are quantised.

    The others are those that noise alone would leave.
    """
    n, joined = len(fit.white), join(records, fit.phi)
    both = np.empty((n, 1 + DRAWS), np.float64 if n * (1 + DRAWS) <= MOST_DOUBLE else np.float32)
    both[:, 0] = fit.slopes.without_followed(fit.white)
    drawn, quantised = _noise_draws(fit, records, rng)
    column = 1
    for block in drawn:
        left = fit.slopes.without_followed(block)
        if phi_estimated and not quantised:
            left = fit.slopes.without_followed(_whitened_again(left, joined, fit.phi))
        both[:, column : column + block.shape[1]] = left
        column += block.shape[1]
    return both, quantised


def _whitened_again(white: Floats, joined: Joined, phi: float) -> Floats:
    """Estimate the AR(1) coefficient of each column of (N, k) whitened residuals, and whiten the column with it.

    A whitened value is that of the frame less φ times that of the frame before, to within a factor.
    """
    coloured = joined.colour(white)
    # like the data's, these residuals have the means that the fit leaves
    change = ar1_coefficient([part - part.mean(axis=0) for part in joined.runs.split(coloured)]) - phi
    before = np.concatenate([np.zeros((1, white.shape[1])), coloured[:-1]])
    before[joined.runs.edges[:-1]] = 0.0
    return white - change / math.sqrt(1.0 - phi**2) * before


def _blocks(both: Floats) -> Iterator[Floats]:
    """Yield a few columns at a time, in double precision."""
    width = _width(len(both))
    return (both[:, k : k + width].astype(float, copy=False) for k in range(0, both.shape[1], width))


def _width(frames: int) -> int:
    return max(1, AT_ONCE // frames) if frames * (1 + DRAWS) > MOST_DOUBLE else 1 + DRAWS


def _noise_draws(fit: Fit, records: Sequence[Record], rng: np.random.Generator) -> tuple[Iterator[Floats], bool]:
    """Return (N, DRAWS) whitened residuals, in blocks, that noise alone would leave, and whether of a quantiser.

    The scatter that the quantiser does not explain is white noise that acted before it. From a standard deviation of
    one step on, such noise makes the quantiser's error white as well.
    """
    n, width = len(fit.white), _width(len(fit.white))
    whites = (rng.standard_normal((n, min(width, DRAWS - k))) for k in range(0, DRAWS, width))
    grid = quantisation(records)
    before = math.sqrt(max(fit.rmse**2 - grid.sigma**2, 0.0)) if grid else math.inf
    if grid is None or before >= grid.step:
        return whites, False
    return _quantised(fit, records, grid, before, rng, whites), True


def _quantised(
    fit: Fit,
    records: Sequence[Record],
    grid: Grid,
    before: float,
    rng: np.random.Generator,
    whites: Iterator[Floats],
) -> Iterator[Floats]:
    """Yield rounding errors of motions with other parameters among those that the recordings leave possible."""
    joined, scale = join(records, fit.phi), None
    path = joined.angle - np.concatenate(fit.residuals)

    def rounded(paths: Floats) -> Floats:
        return np.concatenate(grid.rounded(list(joined.runs.split(paths))))

    def followed(values: Floats) -> Floats:
        return values - fit.slopes.without_followed(values)

    for white in whites:
        # the fit's parameters follow the rounding errors, which are less independent than white noise: the more so,
        # the longer the motion rests. Errors at another phase in each recording show by how much
        if scale is None:
            few = white[:, :PHASES]
            phases = rng.uniform(-0.5, 0.5, (len(records), few.shape[1]))
            phase = grid.step * phases[joined.runs.owner] + path[:, None]
            size = np.linalg.norm(followed(joined.whiten(rounded(phase + before * few) - phase)))
        other = rng.standard_normal(white.shape)
        if scale is None:
            scale = float(size / np.linalg.norm(followed(other[:, :PHASES])))
        exact = path[:, None] + scale * followed(other)
        yield joined.whiten(rounded(exact + before * white) - exact)


def _exponential_scale(p: Floats) -> tuple[float, float]:
    """Return shape and scale of the gamma distribution with mean and variance of −log p; (1, 1) for uniform p."""
    size = -np.log(np.maximum(p, LEAST_P))
    mean, variance = float(np.mean(size)), float(np.var(size))
    return (mean**2 / variance, variance / mean) if mean > 0.0 and variance > 0.0 else (1.0, 1.0)


def _as_uniform(p: Floats, shape_and_scale: tuple[float, float]) -> Floats:
    """Return p-values that are uniform where −log p has the gamma distribution of `_exponential_scale`."""
    shape, scale = shape_and_scale
    return p if shape == scale == 1.0 else np.asarray(special.gammaincc(shape, -np.log(np.maximum(p, LEAST_P)) / scale))


def _before_uniform(p: float, shape_and_scale: tuple[float, float]) -> float:
    """Return the p-value that `_as_uniform` turns into ``p``."""
    shape, scale = shape_and_scale
    return float(np.exp(-scale * special.gammainccinv(shape, p)))


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
            found[name] = _p_of_directions(same, residuals, energy, free)
        else:
            seen = seen or seen_of(fit, records)
            share = largest_shares(fit, records, seen.times, searched(seen), residuals)
            found[name] = special.betaincc(1.0, 0.5 * (free - 2), share), _gain(share, free)
    return found


def _p_of_directions(each: Sequence[Direction], residuals: Floats, energy: Floats, free: int) -> tuple[Floats, Floats]:
    """Return the smallest p-value and the largest log-likelihood gain over directions, for each residual (column).

    For white noise in n dimensions the share of the energy in one of them has the distribution Beta(1/2, (n − 1)/2).
    """
    along = _times(np.stack([direction.change / direction.size for direction in each]), residuals)
    share = np.minimum(along**2 / energy, 1.0)
    if not each[0].one_sided:
        largest = share.max(axis=0)
        return special.betaincc(0.5, 0.5 * (free - 1), largest), _gain(largest, free)
    largest = np.where(along > 0.0, share, -share).max(axis=0)
    p = 0.5 * special.betaincc(0.5, 0.5 * (free - 1), np.abs(largest))
    return np.where(largest > 0.0, p, 1.0 - p), _gain(np.maximum(largest, 0.0), free)


def _gain(share: Floats, free: int) -> Floats:
    """Return the log-likelihood gain if a share of a residual's energy is explained."""
    return np.asarray(-0.5 * free * np.log(np.maximum(1.0 - share, 1e-6)))


def _competing(smallest: Floats) -> float:
    """Return of how many independent p-values these are the smallest, from their median; at least 1."""
    return max(1.0, math.log(0.5) / math.log1p(-min(max(float(np.median(smallest)), 1e-12), 0.5)))


def _corrected(p: Floats | float, count: float) -> Floats:
    """Return the probability that the smallest of several independent p-values is at most p, 1 − (1 − p)^count."""
    with np.errstate(divide="ignore"):
        return np.asarray(-np.expm1(count * np.log1p(-np.minimum(p, 1.0))))


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


def _p_of_space(basis: Floats, slopes: Slopes, residuals: Floats, energy: Floats, free: int) -> tuple[Floats, Floats]:
    """Return p-value and log-likelihood gain of a space for each residual (column).

    They follow from the share of the residual's energy in the part of the space that the fit cannot follow. For white
    noise in n dimensions the share in k of them has the distribution Beta(k/2, (n − k)/2). Columns in which an unstable
    plant runs away are left out.
    """
    basis = basis[:, np.max(np.abs(basis), axis=0) < RUNAWAY]
    u, size, _ = np.linalg.svd(slopes.without_followed(basis), full_matrices=False)
    u = u[:, size > 1e-6 * max(float(np.linalg.norm(basis)), 1e-300)]
    k = u.shape[1]
    if k == 0:
        return np.ones(residuals.shape[1]), np.zeros(residuals.shape[1])
    share = np.minimum(np.sum(_times(u.T, residuals) ** 2, axis=0) / energy, 1.0)
    return special.betaincc(0.5 * k, 0.5 * (free - k), share), _gain(share, free)


def _times(rows: Floats, residuals: Floats) -> Floats:
    """Return a product with residuals in their precision, without a copy of them in another."""
    return np.asarray(rows.astype(residuals.dtype) @ residuals, dtype=float)


def _portmanteau(residuals: Floats, energy: Floats, records: Sequence[Record]) -> Floats:
    """Return the Ljung-Box sum of squared autocorrelations within recordings (Biometrika 65, 1978), (columns,)."""
    edges = np.cumsum([0, *(len(r.time) for r in records)])
    n = len(residuals)
    total = np.zeros(residuals.shape[1])
    for lag in range(1, LAGS + 1):
        products = []
        for block in _blocks(residuals):
            parts = [block[start:stop] for start, stop in pairwise(edges)]
            products.append(sum(np.sum(part[lag:] * part[:-lag], axis=0) for part in parts))
        total += n * (n + 2) / (n - lag) * (np.concatenate(products) / energy) ** 2
    return total
