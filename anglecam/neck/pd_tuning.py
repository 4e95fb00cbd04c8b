"""Gains for a human-like nod: a wanted rise time and overshoot, met with the least control.

The paper's example is an adult whose head turned 70° in 0.3 s with hardly any overshoot (Fig. 10 (b)). Damping by K_d
slows a neck down without changing where it rests; K_p makes it faster and takes some of the steady state away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import control
import numpy as np
from numpy.typing import NDArray

from anglecam.errors import InputError
from anglecam.io.files import read_json
from anglecam.neck.constraints import Constraint, least
from anglecam.neck.pd import ClosedLoop, PdGains, close_loop, rest_gain

Floats = NDArray[np.float64]

_LARGEST_GAIN = 50.0
"""Of K_p·G(0), and of K_d·G(0) in wanted rise times: far more than any margin allows."""


@dataclass(frozen=True)
class Nod:
    """The response that is wanted."""

    rise_time: float = 0.3
    """From 10 % to 90 % of the way, s."""
    overshoot: float = 0.0
    """Share of the way."""
    rise_tolerance: float = 0.02
    """Share of the rise time by which it may be missed."""
    overshoot_tolerance: float = 0.005
    """By which the overshoot may be larger; it may always be smaller."""


ADULT = Nod()
"""The paper's adult: 0.3 s, no overshoot."""


@dataclass(frozen=True)
class Tuned:
    """A loop that was tuned, and how it stands to what was wanted."""

    loop: ClosedLoop
    """With gains, figures and margins."""
    wanted: Nod
    constraints: tuple[Constraint, ...]
    """Each with value, limit and whether it is active."""
    unmet: tuple[str, ...]
    """Which cannot be met, in a line each; empty where all are."""

    @property
    def feasible(self) -> bool:
        """Whether all that was wanted is met."""
        return all(c.met for c in self.constraints)


def tune_pd(
    plant: control.TransferFunction,
    wanted: Nod = ADULT,
    *,
    largest_loss: float = 0.05,
    largest_sensitivity: float = 2.0,
) -> Tuned:
    """Choose the smallest gains with which a linear plant nods as wanted.

    Parameters
    ----------
    plant : control.TransferFunction
        Stable and strictly proper; of a large-angle neck that of `anglecam.neck.pd.linearised`, and
        `anglecam.neck.pd.simulate_pd` then tells what the gains do to the neck itself.
    wanted : Nod
        Rise and overshoot.
    largest_loss : float
        Share of the steady state that K_p may take away.
    largest_sensitivity : float
        M_s that is still robust; 2 keeps the locus 0.5 away from −1.

    Returns
    -------
    Tuned
        Not negative gains (in the sense of the plant's sign); where the wish cannot be met the nearest miss.

    Raises
    ------
    ValueError
        If the plant is not stable or has no steady state.
    """
    rest = rest_gain(plant)
    if not (plant.poles().real < 0.0).all() or rest == 0.0:
        raise ValueError("gains are tuned for a plant that comes to rest by itself, away from zero")

    def loop(x: Floats) -> ClosedLoop:
        return close_loop(plant, PdGains(float(x[0]) / rest, float(x[1]) * wanted.rise_time / rest))

    def evaluate(x: Floats) -> tuple[float, tuple[Constraint, ...]]:
        closed = loop(x)
        return float(x @ x), (
            *nod_constraints(wanted, closed.figures.rise_time, closed.figures.overshoot),
            Constraint("steady state taken away", "share", closed.loss, largest_loss, False, 0.01),
            Constraint("sensitivity M_s", "1", closed.margins.sensitivity, largest_sensitivity, False, 0.1),
        )

    starts = [np.array(x) for x in ((0.0, 0.1), (0.0, 0.5), (0.0, 2.0), (1.0, 0.5))]
    best = least(evaluate, np.zeros(2), np.full(2, _LARGEST_GAIN), starts)
    return Tuned(loop(best.at), wanted, best.constraints, best.unmet)


def nod_constraints(wanted: Nod, rise_time: float, overshoot: float) -> tuple[Constraint, ...]:
    """Return what a response has to meet: rise from both sides, overshoot from above."""
    spare = wanted.rise_tolerance * wanted.rise_time
    return (
        Constraint("rise time", "s", rise_time, wanted.rise_time + spare, False, wanted.rise_time),
        Constraint("rise time", "s", rise_time, wanted.rise_time - spare, True, wanted.rise_time),
        Constraint("overshoot", "share", overshoot, wanted.overshoot + wanted.overshoot_tolerance, False, 0.1),
    )


def nod_from_responses(path: Path, number: int | None = None) -> Nod:
    """Take the wanted nod from a measured one, robot's or person's.

    Parameters
    ----------
    path : Path
        ``NAME.responses.json`` of ``anglecam measure``.
    number : int, optional
        Which of its responses, from 0; the median of all without it.

    Returns
    -------
    Nod
        With twice the measured uncertainty for tolerance, where that is more than the usual one.

    Raises
    ------
    InputError
        Naming the file and what is wrong with it.
    """
    try:
        told = read_json(path)
        all_of_it = [[_figure(r[key]) for key in ("rise_time_s", "overshoot")] for r in told]
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or fault})") from fault
    except (ValueError, KeyError, TypeError) as fault:
        raise InputError(f"{path}: not a list of responses with rise_time_s and overshoot") from fault
    if number is not None and not 0 <= number < len(all_of_it):
        raise InputError(f"{path}: no response {number} among {len(all_of_it)}, counted from 0")
    chosen = all_of_it if number is None else all_of_it[number : number + 1]
    whole = np.array([r for r in chosen if np.isfinite([r[0][0], r[1][0]]).all()])
    if not len(whole):
        raise InputError(f"{path}: none of {len(chosen)} responses has both a rise time and an overshoot")
    (rise, rise_sigma), (overshoot, overshoot_sigma) = np.median(whole, axis=0)
    if not rise > 0.0:
        raise InputError(f"{path}: the rise time is {rise:g} s")
    usual = Nod()
    return Nod(
        float(rise),
        float(overshoot),
        float(np.nanmax([usual.rise_tolerance, 2.0 * rise_sigma / rise])),
        float(np.nanmax([usual.overshoot_tolerance, 2.0 * overshoot_sigma])),
    )


def _figure(told: dict[str, float | None]) -> tuple[float, float]:
    """Return value and sigma; a missing one is NaN."""
    value, sigma = told["value"], told.get("sigma")
    return math.nan if value is None else float(value), math.nan if sigma is None else float(sigma)
