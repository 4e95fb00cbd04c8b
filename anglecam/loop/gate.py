"""The gate: is there structure in the residual that noise would not leave there.

Several tests look at the whitened residual of a fitted model: along the sensitivity of each effect that could be
added, along functions of angle, velocity, command and time, and at its autocorrelation. Every statistic is a share
of the residual's own energy, so none of them needs the noise's size. The smallest of the tests' p-values is the
gate's statistic; its null distribution comes from a parametric bootstrap: white noise, from which what the fit
absorbs (the space of its Jacobian) is taken out as the fit takes it out. So neither the number of tests nor what
they share has to be known. Davison and Hinkley, Bootstrap Methods and their Application, 1997, sec. 4.2 and 4.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta, chi2, norm

from anglecam.effects import Effect
from anglecam.estimate.output_error import Fit, whiten
from anglecam.estimate.record import Record
from anglecam.simulate.plant import Plant

Floats = NDArray[np.float64]

DRAWS = 999
LAGS = 15
LEVEL = 0.05


@dataclass(frozen=True)
class Test:
    """One test of the gate."""

    name: str
    p_value: float


@dataclass(frozen=True)
class Gate:
    """The outcome of all tests together."""

    p_value: float
    """That noise alone leaves a residual at least as striking in any of the tests."""
    tests: tuple[Test, ...]
    detectable: dict[str, float]
    """Effect id → smallest magnitude of its first parameter, SI, that would have been seen with probability 0.95."""

    @property
    def passed(self) -> bool:
        """Whether nothing is missing, as far as the residual tells."""
        return self.p_value >= LEVEL


def test_residual(fit: Fit, records: Sequence[Record], candidates: Sequence[Effect], rng: np.random.Generator) -> Gate:
    """Test the residual of a fitted plant.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, whitened with the noise's colour.
    records : sequence of Record
        Those that were fitted.
    candidates : sequence of Effect
        What could be added.
    rng : numpy.random.Generator
        For the bootstrap.

    Returns
    -------
    Gate
        Calibrated at `DRAWS` draws.
    """
    used = np.linalg.norm(fit.jacobian, axis=0) > 0.0  # a parameter held by its bound may move nothing
    absorbed, _ = np.linalg.qr(fit.jacobian[:, used])
    n = len(fit.white)
    draws = rng.standard_normal((n, DRAWS))
    draws -= absorbed @ (absorbed.T @ draws)
    both = np.column_stack([fit.white - absorbed @ (absorbed.T @ fit.white), draws])
    energy = np.sum(both**2, axis=0)

    free = n - absorbed.shape[1]
    # most effects exist on one side of their null only
    one_sided = {
        f"effect:{e.id}" for e in candidates if e.parameters[0].null in (e.parameters[0].lower, e.parameters[0].upper)
    }
    bases = {f"effect:{e.id}": sensitivity(fit, records, e) for e in candidates} | _shapes(fit, records)
    p_each, strength = {}, {}
    for name, basis in bases.items():
        left = basis - absorbed @ (absorbed.T @ basis)
        p_each[name] = _p_of_share(left, basis, both, energy, free, one_sided=name in one_sided)
        strength[name] = float(np.linalg.norm(left[:, 0]))
    p_each["autocorrelation"] = chi2.sf(_portmanteau(both, records), LAGS)

    # under the null the data are one more draw: the smallest of its p-values is ranked among all draws'
    smallest = np.min(list(p_each.values()), axis=0)
    p_value = np.mean(smallest <= smallest[0])
    critical = float(np.quantile(smallest[1:], LEVEL))
    noise = np.sqrt(fit.cost / free)
    detectable = {
        e.id: float((norm.isf(critical) + norm.isf(0.05)) * noise / strength[f"effect:{e.id}"])
        for e in candidates
        if strength[f"effect:{e.id}"] > 0.0
    }
    tests = tuple(Test(name, float(p[0])) for name, p in p_each.items())
    return Gate(float(p_value), tests, detectable)


def sensitivity(fit: Fit, records: Sequence[Record], effect: Effect) -> Floats:
    """Return the (N, k) whitened change of the prediction for each parameter of an effect, per SI unit, at its null."""
    plant = fit.model
    if not isinstance(plant, Plant):
        raise TypeError("only a Plant takes effects")
    richer = plant.with_effect(effect)
    blocks = []
    for record, own in zip(records, fit.own, strict=True):
        state = own[: plant.states]
        base = plant.predict(fit.parameters, record.time, record.command, state)
        columns = []
        for i, parameter in enumerate(effect.parameters):
            # a tenth of a small start: a one-sided quotient, since most effects exist on one side of their null only
            step = 0.1 * (parameter.starts[0] - parameter.null)
            values = effect.null
            values[i] += step
            changed = richer.predict(np.append(fit.parameters, values), record.time, record.command, state)
            columns.append((changed - base) / step)
        blocks.append(whiten(record, fit.phi, np.column_stack(columns)))
    return np.concatenate(blocks)


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


def _p_of_share(
    left: Floats, basis: Floats, residuals: Floats, energy: Floats, free: int, *, one_sided: bool
) -> Floats:
    """Return, for each residual (columns), the p-value of its share of energy within the space of ``left``.

    Of white noise in n dimensions the share that falls into k of them is Beta(k/2, (n − k)/2).
    """
    u, size, _ = np.linalg.svd(left, full_matrices=False)
    u = u[:, size > 1e-6 * max(float(np.linalg.norm(basis)), 1e-300)]
    k = u.shape[1]
    if k == 0:
        return np.ones(residuals.shape[1])
    along = u.T @ residuals
    p = beta.sf(np.sum(along**2, axis=0) / energy, 0.5 * k, 0.5 * (free - k))
    if one_sided and left.shape[1] == 1:
        p = np.where(along[0] * np.sign(u[:, 0] @ left[:, 0]) > 0.0, 0.5 * p, 1.0 - 0.5 * p)
    return p


def _portmanteau(residuals: Floats, records: Sequence[Record]) -> Floats:
    """Ljung and Box's sum of squared autocorrelations, within recordings (Biometrika 65, 1978)."""
    edges = np.cumsum([0, *(len(r.time) for r in records)])
    energy = np.sum(residuals**2, axis=0)
    n = len(residuals)
    total = np.zeros(residuals.shape[1])
    for lag in range(1, LAGS + 1):
        product = np.zeros(residuals.shape[1])
        for start, stop in pairwise(edges):
            part = residuals[start:stop]
            product += np.sum(part[lag:] * part[:-lag], axis=0)
        total += n * (n + 2) / (n - lag) * (product / energy) ** 2
    return total
