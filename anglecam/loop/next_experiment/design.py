"""The separating experiment: the command that distinguishes, in the shortest time, models that fit alike so far.

If A is true, a new recording lies at some distance from the nearest prediction of B, where B is fitted again to the new
recording and to those so far:

    d² = min over p, x₀, z of  |W(y_A − z − y_B(p, x₀))|²/σ² + |R(p − p_B)|²/σ²

RᵀR is the information of the recordings so far about B's parameters, and W whitens the noise. The log-likelihood ratio
of A to B then grows by a normal variable of mean d²/2 and variance d² (Cox, J. R. Statist. Soc. B 24, 1962). Hunter and
Reiner, Technometrics 7, 1965, choose the experiment with the largest difference of two predictions; Box and Hill,
Technometrics 9, 1967, weight it by the uncertainty of each prediction, as R does here. Of several pairs the one with
the smallest d counts.

d is first computed for every candidate with B linearised at p_B. For the few best, B is fitted to the new recording
without linearisation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit, whiten
from anglecam.identification.joined import RUNAWAY
from anglecam.identification.noise import Noise
from anglecam.io.files import write_atomically
from anglecam.loop.next_experiment.commands import (
    LONGEST,
    CandidateExperiment,
    beginning,
    candidate_commands,
    candidate_releases,
)
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import plant_of
from anglecam.models.plant import Plant

Pair = tuple[str, str]

DURATIONS = (4.0, 8.0, LONGEST)
"""Lengths of a recording that are compared, s."""
SHORTLIST = 5
"""Largest number of experiments for which the other model is fitted without linearisation."""
SETTLE = 3.0
"""Time in which the body comes to rest before a recording begins, s."""


@dataclass(frozen=True)
class Experiment:
    """A recording to make next."""

    command: Command | None
    """``None`` for a free swing."""
    description: str
    """The command in words."""
    duration: float
    """Length of the recording, with the rest at its beginning, s."""
    separations: dict[Pair, float]
    """Names of two models → distance d in standard deviations of the noise, from the prediction of one to the nearest
    prediction of the other; the smaller of the two directions."""
    separated_sigmas: float = DEFAULT.next_experiment.separated_sigmas
    """The policy's distance from which on two models are separated."""

    @property
    def separation(self) -> float:
        """Smallest distance of the pairs that this experiment separates, or of all pairs if it separates none."""
        return _smallest(self.separations, self.separated or tuple(self.separations))

    @property
    def separated(self) -> tuple[Pair, ...]:
        """Pairs that this experiment separates."""
        return tuple(pair for pair, distance in self.separations.items() if distance >= self.separated_sigmas)


@dataclass(frozen=True)
class _Foreseen:
    """Prediction of one candidate experiment by one model."""

    record: Record
    """With the predicted angle in place of a measured one."""
    unknowns: Floats
    """(k,) parameters, initial state, and the zero unless it is declared."""
    slopes: Floats
    """(n, k) derivatives of the angle with respect to the unknowns."""


def separating_experiment(
    fits: Sequence[Fit], records: Sequence[Record], noise: Noise, policy: Policy = DEFAULT
) -> Experiment | None:
    """Choose the next recording to distinguish models that describe the recordings so far alike.

    Parameters
    ----------
    fits : sequence of Fit
        Of a `Plant` each, with different effects, all on ``records``.
    records : sequence of Record
        The recordings so far; they determine the limits of the rig and how it is filmed.
    noise : Noise
        Of the angle.
    policy : Policy
        Thresholds.

    Returns
    -------
    Experiment or None
        Among the experiments that separate all separable pairs, the one with the highest expected log-likelihood ratio
        per second, where a distance above ``saturated_sigmas`` counts no more. If no experiment separates a pair, the
        one with the largest distance. ``None`` for fewer than two models, and if no candidate can be predicted.

    Raises
    ------
    TypeError
        If another model than a `Plant` was fitted.
    """
    if len(fits) < 2:
        return None
    names = _names(fits)
    candidates = _candidates(fits, records)
    foreseen = [_foresee_all(candidate, fits, records, policy) for candidate in candidates]
    possible = [(c, f) for c, f in zip(candidates, foreseen, strict=True) if f]
    if not possible:
        return None
    limits = policy.next_experiment
    sigma = max(noise.sigma, limits.smallest_noise_rad)
    known = [_information_root(fit) for fit in fits]

    def separations(predictions: Sequence[_Foreseen], duration: float, linear: bool) -> dict[Pair, float]:
        def nearest(true: int, other: int) -> float:
            target, model = predictions[true].record, predictions[other]
            if linear:
                return _linear_distance(target, model, known[other], duration, noise.phi) / sigma
            return _fitted_distance(target, model, fits[other], known[other], duration, noise.phi) / sigma

        pairs = combinations(range(len(fits)), 2)
        return {(names[i], names[j]): float(min(nearest(i, j), nearest(j, i))) for i, j in pairs}

    tried = [
        (Experiment(c.command, c.description, duration, separations(f, duration, True), limits.separated_sigmas), f)
        for c, f in possible
        for duration in DURATIONS
    ]
    pairs = tuple(tried[0][0].separations)
    separable = tuple(p for p in pairs if max(e.separations[p] for e, _ in tried) >= limits.separated_sigmas) or pairs

    def merit(experiment: Experiment) -> tuple[bool, float, float]:
        return _merit(experiment, separable, limits.saturated_sigmas)

    best: Experiment | None = None
    for experiment, predictions in sorted(tried, key=lambda t: merit(t[0]), reverse=True)[:SHORTLIST]:
        if best is not None and merit(best) >= merit(experiment):
            break
        fitted = replace(experiment, separations=separations(predictions, experiment.duration, False))
        best = fitted if best is None else max(best, fitted, key=merit)
    assert best is not None  # the shortlist is not empty
    return best if best.command is None else replace(best, command=beginning(best.command, best.duration))


def write_command(command: Command, path: Path) -> None:
    """Write ``NAME.command.csv``, as `anglecam.io.session.read_command` reads it: ``time_s,command_deg``."""
    with write_atomically(path) as stream:
        stream.write("time_s,command_deg\n")
        for time, angle in zip(command.time, np.degrees(command.angle), strict=True):
            stream.write(f"{time:.6f},{angle:.6f}\n")


def _merit(experiment: Experiment, pairs: Sequence[Pair], saturated_sigmas: float) -> tuple[bool, float, float]:
    """Rank experiments that separate all pairs first, by their log-likelihood ratio per second; others by distance."""
    distance = _smallest(experiment.separations, pairs)
    enough = distance >= experiment.separated_sigmas
    return enough, min(distance, saturated_sigmas) ** 2 / experiment.duration if enough else 0.0, distance


def _smallest(separations: dict[Pair, float], pairs: Sequence[Pair]) -> float:
    return min(separations[pair] for pair in pairs)


def _names(fits: Sequence[Fit]) -> list[str]:
    """Name each model by the effects that not all models share."""
    effects = [[e.id for e in plant_of(fit).effects] for fit in fits]
    shared = set.intersection(*(set(ids) for ids in effects))
    return [" + ".join(i for i in ids if i not in shared) or "no further effect" for ids in effects]


def _candidates(fits: Sequence[Fit], records: Sequence[Record]) -> list[CandidateExperiment]:
    seen = _angles(fits[0], records)
    if all(r.command is None for r in records):
        return candidate_releases(seen)
    stiffness = max(float(fit.parameters[1]) for fit in fits)
    return candidate_commands(records, math.sqrt(max(stiffness, 0.0)) / (2.0 * math.pi))


def _angles(fit: Fit, records: Sequence[Record]) -> Floats:
    """Return all measured angles from equilibrium, rad: without the fitted zeros."""
    states = fit.model.states
    return np.concatenate(
        [r.angle - nuisance[states:].sum() for r, nuisance in zip(records, fit.nuisance, strict=True)]
    )


def _foresee_all(
    candidate: CandidateExperiment, fits: Sequence[Fit], records: Sequence[Record], policy: Policy
) -> list[_Foreseen]:
    """Predict one candidate with each model; return nothing if it moves the body beyond the recorded angles."""
    foreseen = [_foresee(candidate, fit, records) for fit in fits]
    if not all(np.all(np.abs(values) < RUNAWAY) for f in foreseen for values in (f.record.angle, f.slopes)):
        return []  # a model diverges
    if candidate.command is None:
        return foreseen
    seen = np.concatenate([_angles(fits[0], records), *(r.command.angle for r in records if r.command is not None)])
    angles = np.concatenate([f.record.angle for f in foreseen])
    margin = policy.next_experiment.angle_excess_share * np.ptp(seen)
    inside = np.all((angles >= seen.min() - margin) & (angles <= seen.max() + margin))
    return foreseen if inside else []


def _foresee(candidate: CandidateExperiment, fit: Fit, records: Sequence[Record]) -> _Foreseen:
    plant = plant_of(fit)
    time = np.arange(0.0, LONGEST, np.median([r.interval for r in records]))
    if candidate.command is None:
        state = np.array([candidate.released, 0.0])
    else:
        held = Command(np.zeros(1), candidate.command.angle[:1])
        state = plant.run(fit.parameters, np.array([0.0, SETTLE]), held, np.zeros(2))[-1]
    zero_known = all(r.zero_known for r in records)
    unknowns = np.concatenate([fit.parameters, state, [] if zero_known else [0.0]])
    unstated = np.full(len(time), np.nan)
    blank = Record(candidate.description, time, time, candidate.command, zero_known, unstated, None, records[0].view)
    record = replace(blank, angle=_predict(plant, unknowns, blank))
    return _Foreseen(record, unknowns, _slopes(plant, unknowns, record))


def _predict(plant: Plant, unknowns: Floats, record: Record) -> Floats:
    p = len(plant.names)
    parameters, state, zero = unknowns[:p], unknowns[p : p + plant.states], unknowns[p + plant.states :]
    return zero.sum() + plant.predict(parameters, record.time, record.command, state, record.view)


def _slopes(plant: Plant, unknowns: Floats, record: Record) -> Floats:
    """Return one-sided finite differences, (n, k), with steps towards the inner side of a bound."""
    p = len(plant.names)
    base = _predict(plant, unknowns, record)
    steps = np.full(len(unknowns), 1e-6)
    steps[:p] = 1e-5 * np.maximum(plant.scales, np.abs(unknowns[:p]))
    steps[:p] = np.where(unknowns[:p] + steps[:p] > plant.upper, -steps[:p], steps[:p])
    slopes = np.ones((len(base), len(unknowns)))
    for j in range(p + plant.states):  # the derivative with respect to the zero is 1
        moved = unknowns.copy()
        moved[j] += steps[j]
        with np.errstate(over="ignore", invalid="ignore"):  # a diverging model is left out later
            slopes[:, j] = (_predict(plant, moved, record) - base) / steps[j]
    return slopes


def _information_root(fit: Fit) -> Floats:
    """Return R, (p, p): a change δ of the parameters raises the cost of the recordings so far by |Rδ|²."""
    return np.asarray(np.linalg.qr(fit.slopes.projected, mode="r"))


def _linear_distance(target: Record, model: _Foreseen, known: Floats, duration: float, phi: float) -> float:
    """Return the distance, rad, from a target to the nearest prediction of a model linearised at its parameters."""
    n, p = int(np.sum(target.time < duration)), len(known)
    off = np.append(whiten(target, phi, target.angle - model.record.angle)[:n], np.zeros(p))
    slopes = np.zeros((n + p, len(model.unknowns)))
    slopes[:n], slopes[n:, :p] = whiten(target, phi, model.slopes)[:n], known
    size = np.linalg.norm(slopes, axis=0)
    basis, _ = np.linalg.qr(slopes[:, size > 0.0] / size[size > 0.0])
    return float(np.linalg.norm(off - basis @ (basis.T @ off)))


def _fitted_distance(target: Record, model: _Foreseen, fit: Fit, known: Floats, duration: float, phi: float) -> float:
    """Return the same distance without linearisation, within the bounds of the parameters."""
    plant, p, part = plant_of(fit), len(known), target.between(0.0, duration)

    def errors(unknowns: Floats) -> Floats:
        off = whiten(part, phi, _predict(plant, unknowns, part) - part.angle)
        return np.append(off, known @ (unknowns[:p] - fit.parameters))

    def slopes(unknowns: Floats) -> Floats:
        below = np.zeros((p, len(unknowns)))
        below[:, :p] = known
        return np.concatenate([whiten(part, phi, _slopes(plant, unknowns, part)), below])

    free = np.full(len(model.unknowns) - p, np.inf)
    lower, upper = np.append(plant.lower, -free), np.append(plant.upper, free)
    inside = np.clip(model.unknowns, np.nextafter(lower, np.inf), np.nextafter(upper, -np.inf))
    # the plant may diverge at a trial step; its cost is then not finite and the step is rejected. SciPy divides by a
    # derivative that underflows where the gradient is nearly zero
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = least_squares(errors, inside, slopes, (lower, upper), x_scale="jac", ftol=1e-4, max_nfev=40)
    return float(np.sqrt(2.0 * found.cost))
