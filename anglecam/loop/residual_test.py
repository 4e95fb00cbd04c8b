"""The gate: is there structure in the residual that noise would not leave there.

Several tests look at the whitened residual of a fitted model: along what each effect that could be added would change,
along functions of angle, velocity, command and time, along what any torque over angle or speed would change, and at its
autocorrelation. Every statistic is a share of the
residual's own energy, so none of them needs the noise's size. The smallest of the tests' p-values is the gate's
statistic; its null distribution comes from a parametric bootstrap: white noise, from which what the fit absorbs (the
space of its Jacobian) is taken out as the fit takes it out. So neither the number of tests nor what they share has to
be known. Davison and Hinkley, Bootstrap Methods and their Application, 1997, sec. 4.2 and 4.4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit, whiten
from anglecam.loop.screen import Direction, absorbed_space
from anglecam.loop.torque_basis import torque_responses

DRAWS = 999
LAGS = 15
LEVEL = 0.05


@dataclass(frozen=True)
class StructureTest:
    """One test of the gate."""

    name: str
    p_value: float


@dataclass(frozen=True)
class ResidualTest:
    """The outcome of all tests together."""

    p_value: float
    """That noise alone leaves a residual at least as striking in any of the tests."""
    tests: tuple[StructureTest, ...]
    torque_gain: float
    """Log-likelihood that a torque over angle or speed of any curve would gain, less what noise would give it."""
    detectable: dict[str, float]
    """Effect id → smallest magnitude of its first parameter, SI, that would have been seen with probability 0.95."""

    @property
    def passed(self) -> bool:
        """Whether nothing is missing, as far as the residual tells."""
        return self.p_value >= LEVEL


def run_residual_test(
    fit: Fit, records: Sequence[Record], ways: Sequence[Direction], rng: np.random.Generator, finest: float
) -> ResidualTest:
    """Test the residual of a fitted plant.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, whitened with the noise's colour.
    records : sequence of Record
        Those that were fitted.
    ways : sequence of Direction
        From `anglecam.loop.screen.directions` of the same fit: of what could be added.
    rng : numpy.random.Generator
        For the bootstrap.
    finest : float
        Structure smaller than this, rad RMS, is not traced, however sure it is: no smaller effect counts as detectable.

    Returns
    -------
    ResidualTest
        Calibrated at `DRAWS` draws.
    """
    absorbed = absorbed_space(fit)
    n, free = len(fit.white), len(fit.white) - absorbed.shape[1]
    draws = rng.standard_normal((n, DRAWS))
    both = np.column_stack([fit.white, draws])
    both -= absorbed @ (absorbed.T @ both)
    energy = np.sum(both**2, axis=0)
    energy[energy == 0.0] = 1.0

    p_each = _p_of_effects(ways, both, energy, free)
    torque_gain = 0.0
    for name, basis in _shapes(fit, records).items():
        p_each[f"residual against {name}"], _, _ = _p_of_space(basis, absorbed, both, energy, free)
    for name, basis in torque_responses(fit, records).items():
        p_each[f"torque against {name}"], share, k = _p_of_space(basis, absorbed, both, energy, free)
        torque_gain = max(torque_gain, -0.5 * free * float(np.log(max(1.0 - share, 1e-6))) - 0.5 * k)
    p_each["autocorrelation"] = special.chdtrc(LAGS, _portmanteau(both, energy, records))

    # under the null the data are one more draw: the smallest of its p-values is ranked among all draws'
    smallest = np.min(list(p_each.values()), axis=0)
    p_value = np.mean(smallest <= smallest[0])
    critical = float(np.quantile(smallest[1:], LEVEL))
    needed = float(-(special.ndtri(critical) + special.ndtri(0.05)) * np.sqrt(fit.cost / free))
    needed = max(needed, finest * math.sqrt(n))
    tests = tuple(StructureTest(name, float(p[0])) for name, p in p_each.items())
    return ResidualTest(float(p_value), tests, torque_gain, _detectable(ways, needed))


def _p_of_effects(ways: Sequence[Direction], residuals: Floats, energy: Floats, free: int) -> dict[str, Floats]:
    """Return, for each effect and residual (columns), the least p-value of its directions.

    Of white noise in n dimensions the share of the energy that falls into one of them is Beta(1/2, (n − 1)/2).
    """
    if not ways:
        return {}
    along = np.stack([way.change / way.size for way in ways]) @ residuals
    share = np.minimum(along**2 / energy, 1.0)
    p = special.betaincc(0.5, 0.5 * (free - 1), share)
    for i, way in enumerate(ways):
        if way.one_sided:
            p[i] = np.where(along[i] > 0.0, 0.5 * p[i], 1.0 - 0.5 * p[i])
    ids = np.array([way.effect.id for way in ways])
    return {f"effect {name}": p[ids == name].min(axis=0) for name in dict.fromkeys(ids)}


def _detectable(ways: Sequence[Direction], needed: float) -> dict[str, float]:
    """Find each effect's magnitude at which its change is as long as needed, on logarithmic scales."""
    found: dict[str, float] = {}
    for name in dict.fromkeys(way.effect.id for way in ways):
        own = [way for way in ways if way.effect.id == name]
        shape = own[0].start[1:]
        sizes = {abs(w.start[0] - w.effect.null[0]): w.size for w in own if np.array_equal(w.start[1:], shape)}
        magnitude = np.log(sorted(sizes))
        length = np.log([sizes[m] for m in sorted(sizes)])
        wanted = np.log(needed)
        if own[0].effect.parameters[0].inverse:  # a limit does nothing until it is reached: no line leads there
            seen = magnitude[length >= wanted]
            found |= {name: float(np.exp(seen[0]))} if len(seen) else {}
        elif len(magnitude) > 1 and wanted < length[0]:  # below the smallest that was tried: in proportion
            found[name] = float(np.exp(magnitude[0] + wanted - length[0]))
        elif wanted <= length.max():
            found[name] = float(np.exp(np.interp(wanted, np.maximum.accumulate(length), magnitude)))
    return found


def _shapes(fit: Fit, records: Sequence[Record]) -> dict[str, Floats]:
    """Functions of angle, velocity, command and time that a residual may depend on, whitened."""
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


def _p_of_space(
    basis: Floats, absorbed: Floats, residuals: Floats, energy: Floats, free: int
) -> tuple[Floats, float, int]:
    """Return the p-value of each residual's (columns) share of energy in a space that the fit cannot follow.

    Of white noise in n dimensions the share that falls into k of them is Beta(k/2, (n − k)/2). The first residual's
    share and k come with it.
    """
    u, size, _ = np.linalg.svd(basis - absorbed @ (absorbed.T @ basis), full_matrices=False)
    u = u[:, size > 1e-6 * max(float(np.linalg.norm(basis)), 1e-300)]
    k = u.shape[1]
    if k == 0:
        return np.ones(residuals.shape[1]), 0.0, 0
    share = np.minimum(np.sum((u.T @ residuals) ** 2, axis=0) / energy, 1.0)
    return special.betaincc(0.5 * k, 0.5 * (free - k), share), float(share[0]), k


def _portmanteau(residuals: Floats, energy: Floats, records: Sequence[Record]) -> Floats:
    """Ljung and Box's sum of squared autocorrelations, within recordings (Biometrika 65, 1978)."""
    edges = np.cumsum([0, *(len(r.time) for r in records)])
    n = len(residuals)
    total = np.zeros(residuals.shape[1])
    for lag in range(1, LAGS + 1):
        product = np.zeros(residuals.shape[1])
        for start, stop in pairwise(edges):
            part = residuals[start:stop]
            product += np.sum(part[lag:] * part[:-lag], axis=0)
        total += n * (n + 2) / (n - lag) * (product / energy) ** 2
    return total
