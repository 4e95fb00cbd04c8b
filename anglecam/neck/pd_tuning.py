"""Gains for a human-like nod: a wanted rise time and overshoot, met with the least control.

The paper's example is an adult whose head turned 70° in 0.3 s with hardly any overshoot (Fig. 10 (b)). Damping by K_d
slows a neck down without changing where it rests; K_p makes it faster and takes some of the steady state away.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from anglecam.data.typing import Floats
from anglecam.neck.constraints import Constraint, least
from anglecam.neck.pd import ClosedLoop, PdGains, close_loop, rest_gain

_LARGEST_GAIN = 50.0
"""Of K_p·G(0), and of K_d·G(0) in wanted rise times: far more than any margin allows."""


@dataclass(frozen=True)
class NodTarget:
    """The response that is wanted."""

    rise_time: float = 0.3
    """From 10 % to 90 % of the way, s."""
    overshoot: float = 0.0
    """Share of the way."""
    rise_tolerance: float = 0.02
    """Share of the rise time by which it may be missed."""
    overshoot_tolerance: float = 0.005
    """By which the overshoot may be larger; it may always be smaller."""


ADULT = NodTarget()
"""The paper's adult: 0.3 s, no overshoot."""


@dataclass(frozen=True)
class Tuned:
    """A loop that was tuned, and how it stands to what was wanted."""

    loop: ClosedLoop
    """With gains, figures and margins."""
    wanted: NodTarget
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
    wanted: NodTarget = ADULT,
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
    wanted : NodTarget
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


def nod_constraints(wanted: NodTarget, rise_time: float, overshoot: float) -> tuple[Constraint, ...]:
    """Return what a response has to meet: rise from both sides, overshoot from above."""
    spare = wanted.rise_tolerance * wanted.rise_time
    return (
        Constraint("rise time", "s", rise_time, wanted.rise_time + spare, False, wanted.rise_time),
        Constraint("rise time", "s", rise_time, wanted.rise_time - spare, True, wanted.rise_time),
        Constraint("overshoot", "share", overshoot, wanted.overshoot + wanted.overshoot_tolerance, False, 0.1),
    )
