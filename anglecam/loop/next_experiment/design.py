"""The separating experiment: which command tells, soonest, the models that recordings cannot tell apart.

Were A true, a new recording would lie some way off the nearest that B can predict for it once B has been fitted again
to everything, the recordings so far among it:

    d² = min over p, x₀, z of  |W(y_A − z − y_B(p, x₀))|²/σ² + |R(p − p_B)|²/σ²

RᵀR is what the recordings so far know of B's parameters, W whitens the noise. The log-likelihood ratio of A to B then
grows by a normal variable of mean d²/2 and variance d² (Cox, J. R. Statist. Soc. B 24, 1962). Hunter and Reiner,
Technometrics 7, 1965, take the experiment with the largest difference of two predictions; Box and Hill, Technometrics
9, 1967, weigh it by how well each model can predict, as R does here. Of several pairs the hardest counts.

d is first worked out for every candidate with B linear about p_B; for the few best, B is fitted outright to the new
recording.
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
from anglecam.effects import LEDGER
from anglecam.identification.fit import Fit, whiten
from anglecam.identification.noise import Noise
from anglecam.io.files import write_atomically
from anglecam.loop.next_experiment.commands import (
    LONGEST,
    CandidateExperiment,
    beginning,
    candidate_commands,
    candidate_releases,
)
from anglecam.loop.refit import plant_of
from anglecam.models.plant import Plant

Pair = tuple[str, str]

DURATIONS = (4.0, 8.0, LONGEST)
"""s."""
ENOUGH = 3.0
"""Standard deviations of the noise at which two models are told apart: log-likelihoods are then 4.5 ± 3 apart."""
CERTAIN = 6.0
"""The same at which more of it tells nothing new: of experiments that reach it the shorter is the better."""
SHORTLIST = 5
"""Experiments for which the other model is fitted outright, at most."""
FINEST = math.radians(1e-3)
"""Noise is not taken to be smaller: forward models and files are not much finer."""
MARGIN = 0.02
"""Share of the range of angles seen by which a prediction may exceed it."""
SETTLE = 3.0
"""s in which a head comes to rest before a recording begins."""


@dataclass(frozen=True)
class Experiment:
    """What to record next."""

    command: Command | None
    """``None`` for a free swing."""
    description: str
    """The command in words."""
    duration: float
    """s to film, the rest at the beginning among it."""
    separations: dict[Pair, float]
    """Names of two models → standard deviations of the noise between what either predicts and the nearest that the
    other can, whichever is less."""

    @property
    def separation(self) -> float:
        """Of the hardest pair that this experiment separates, or of the hardest if it separates none."""
        return _hardest(self.separations, self.separated or tuple(self.separations))

    @property
    def per_second(self) -> float:
        """Log-likelihood ratio, nat/s, expected for that pair."""
        return 0.5 * self.separation**2 / self.duration

    @property
    def separated(self) -> tuple[Pair, ...]:
        """Pairs that it tells apart."""
        return tuple(pair for pair, distance in self.separations.items() if distance >= ENOUGH)

    @property
    def advice(self) -> str:
        """What to do, as text: this experiment, and for pairs that it does not separate what their effects say."""
        what = "release" if self.command is None else "command"
        lines = [f"No {what} within the rig's limits tells the models apart in {LONGEST:g} s."]
        if self.separated:
            apart = "; ".join(
                f"{first} and {second} then lie {self.separations[first, second]:.2g} σ of the noise apart"
                for first, second in self.separated
            )
            do = "Film" if self.command is None else "Play and film"
            lines = [f"{do} {self.duration:g} s: {self.description}; {apart}."]
        for (first, second), distance in self.separations.items():
            if distance < ENOUGH:
                effects = [e for e in LEDGER if e.id in f"{first} + {second}".split(" + ")]
                own = "; ".join(f"{e.id}: {e.separating_experiment}" for e in effects)
                lines.append(f"{first} and {second} stay {distance:.2g} σ apart, too near to tell. {own}")
        return "\n".join(lines)


@dataclass(frozen=True)
class _Foreseen:
    """What one model predicts for one candidate."""

    record: Record
    """With the predicted angle for a measured one."""
    unknowns: Floats
    """(k,) parameters, initial state, and the zero unless it is declared."""
    slopes: Floats
    """(n, k) derivatives of the angle."""


def separating_experiment(fits: Sequence[Fit], records: Sequence[Record], noise: Noise) -> Experiment | None:
    """Choose what to record next to tell models apart that describe the recordings so far alike.

    Parameters
    ----------
    fits : sequence of Fit
        Of a `Plant` each, with what each of them takes to be the cause, all on ``records``.
    records : sequence of Record
        The recordings so far: they show what commands the rig stands, and how it is filmed.
    noise : Noise
        Of the angle.

    Returns
    -------
    Experiment or None
        That with the highest log-likelihood ratio to be expected per second, as far as it is needed, among those which
        separate all pairs that any separates; if none separates a pair, that which comes nearest. ``None`` for fewer
        than two models, and where no model can foresee any candidate.

    Raises
    ------
    TypeError
        For a fit of something else than a `Plant`.
    """
    if len(fits) < 2:
        return None
    names = _names(fits)
    candidates = _candidates(fits, records)
    foreseen = [_foresee_all(candidate, fits, records) for candidate in candidates]
    possible = [(c, f) for c, f in zip(candidates, foreseen, strict=True) if f]
    if not possible:
        return None
    sigma = max(noise.sigma, FINEST)
    known = [_knowledge(fit) for fit in fits]

    def separations(predictions: Sequence[_Foreseen], duration: float, outright: bool) -> dict[Pair, float]:
        def nearest(true: int, other: int) -> float:
            target, model = predictions[true].record, predictions[other]
            if outright:
                return _fitted(target, model, fits[other], known[other], duration, noise.phi) / sigma
            return _linear(target, model, known[other], duration, noise.phi) / sigma

        pairs = combinations(range(len(fits)), 2)
        return {(names[i], names[j]): float(min(nearest(i, j), nearest(j, i))) for i, j in pairs}

    tried = [
        (Experiment(c.command, c.description, duration, separations(f, duration, False)), f)
        for c, f in possible
        for duration in DURATIONS
    ]
    pairs = tuple(tried[0][0].separations)
    wanted = tuple(p for p in pairs if max(e.separations[p] for e, _ in tried) >= ENOUGH) or pairs
    best: Experiment | None = None
    for experiment, predictions in sorted(tried, key=lambda t: _merit(t[0], wanted), reverse=True)[:SHORTLIST]:
        if best is not None and _merit(best, wanted) >= _merit(experiment, wanted):
            break
        outright = replace(experiment, separations=separations(predictions, experiment.duration, True))
        best = outright if best is None else max(best, outright, key=lambda e: _merit(e, wanted))
    assert best is not None  # the shortlist is not empty
    return best if best.command is None else replace(best, command=beginning(best.command, best.duration))


def write_command(command: Command, path: Path) -> None:
    """Write ``NAME.command.csv``, as `anglecam.io.session.read_command` reads it: ``time_s,command_deg``."""
    with write_atomically(path) as stream:
        stream.write("time_s,command_deg\n")
        for time, angle in zip(command.time, np.degrees(command.angle), strict=True):
            stream.write(f"{time:.6f},{angle:.6f}\n")


def _merit(experiment: Experiment, pairs: Sequence[Pair]) -> tuple[bool, float, float]:
    """Rank what separates all pairs before what does not, the former by what they tell in a second."""
    distance = _hardest(experiment.separations, pairs)
    enough = distance >= ENOUGH
    return enough, min(distance, CERTAIN) ** 2 / experiment.duration if enough else 0.0, distance


def _hardest(separations: dict[Pair, float], pairs: Sequence[Pair]) -> float:
    return min(separations[pair] for pair in pairs)


def _names(fits: Sequence[Fit]) -> list[str]:
    """Name each model after the effects that it does not share with all."""
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
    """Return all measured angles from equilibrium, rad: less the zeros that were fitted."""
    states = fit.model.states
    return np.concatenate([r.angle - own[states:].sum() for r, own in zip(records, fit.nuisance, strict=True)])


def _foresee_all(candidate: CandidateExperiment, fits: Sequence[Fit], records: Sequence[Record]) -> list[_Foreseen]:
    """Predict one candidate with each model; nothing if it would take the head where it has never been."""
    foreseen = [_foresee(candidate, fit, records) for fit in fits]
    if not all(np.all(np.isfinite(f.record.angle)) and np.all(np.isfinite(f.slopes)) for f in foreseen):
        return []  # a model runs away
    if candidate.command is None:
        return foreseen
    seen = np.concatenate([_angles(fits[0], records), *(r.command.angle for r in records if r.command is not None)])
    angles = np.concatenate([f.record.angle for f in foreseen])
    margin = MARGIN * np.ptp(seen)
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
    """Difference the prediction once for each unknown, on the inner side of a bound."""
    p = len(plant.names)
    base = _predict(plant, unknowns, record)
    steps = np.full(len(unknowns), 1e-6)
    steps[:p] = 1e-5 * np.maximum(plant.scales, np.abs(unknowns[:p]))
    steps[:p] = np.where(unknowns[:p] + steps[:p] > plant.upper, -steps[:p], steps[:p])
    slopes = np.ones((len(base), len(unknowns)))
    for j in range(p + plant.states):  # the zero's is one
        moved = unknowns.copy()
        moved[j] += steps[j]
        slopes[:, j] = (_predict(plant, moved, record) - base) / steps[j]
    return slopes


def _knowledge(fit: Fit) -> Floats:
    """Return (p, p) R: a change δ of the parameters raises the cost of the recordings so far by |Rδ|²."""
    p = len(fit.parameters)
    shared, own = fit.jacobian[:, :p], fit.jacobian[:, p:]
    basis, _ = np.linalg.qr(own[:, np.linalg.norm(own, axis=0) > 0.0])
    return np.asarray(np.linalg.qr(shared - basis @ (basis.T @ shared), mode="r"))


def _linear(target: Record, model: _Foreseen, known: Floats, duration: float, phi: float) -> float:
    """Return the distance, rad, from a target to the nearest that a model linear about its parameters can give."""
    n, p = int(np.sum(target.time < duration)), len(known)
    off = np.append(whiten(target, phi, target.angle - model.record.angle)[:n], np.zeros(p))
    slopes = np.zeros((n + p, len(model.unknowns)))
    slopes[:n], slopes[n:, :p] = whiten(target, phi, model.slopes)[:n], known
    size = np.linalg.norm(slopes, axis=0)
    basis, _ = np.linalg.qr(slopes[:, size > 0.0] / size[size > 0.0])
    return float(np.linalg.norm(off - basis @ (basis.T @ off)))


def _fitted(target: Record, model: _Foreseen, fit: Fit, known: Floats, duration: float, phi: float) -> float:
    """Return the same distance with the model as it is, within the bounds of its parameters."""
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
    # a trial step may let the plant run away; its cost is then not finite and the step is refused
    with np.errstate(over="ignore", invalid="ignore"):
        found = least_squares(errors, inside, slopes, (lower, upper), x_scale="jac", ftol=1e-4, max_nfev=40)
    return float(np.sqrt(2.0 * found.cost))
