"""PD gains for a human-like nod: the smallest gains with a wanted rise time and overshoot.

The paper's example is an adult whose head turned 70° in 0.3 s with hardly any overshoot (Fig. 10 (b)). K_d damps the
neck, which slows it without changing its steady state; K_p makes it faster and reduces the steady state.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from anglecam.data.typing import Floats
from anglecam.neck.constraints import Constraint, least
from anglecam.neck.pd import ClosedLoop, PdGains, close_loop, rest_gain

_LARGEST_GAIN = 50.0
"""Upper bound of K_p·G(0), and of K_d·G(0) in wanted rise times: far more than any margin allows."""


@dataclass(frozen=True)
class NodTarget:
    """The wanted response of the head."""

    rise_time: float = 0.3
    """From 10 % to 90 % of the way, s."""
    overshoot: float = 0.0
    """Share of the way."""
    rise_tolerance: float = 0.02
    """Allowed deviation, as a share of the rise time."""
    overshoot_tolerance: float = 0.005
    """Allowed excess; a smaller overshoot is always allowed."""


ADULT = NodTarget()
"""The paper's adult: 0.3 s, no overshoot."""


@dataclass(frozen=True)
class Tuned:
    """A tuned loop, compared with the wanted response."""

    loop: ClosedLoop
    """With gains, figures and margins."""
    wanted: NodTarget
    constraints: tuple[Constraint, ...]
    """Each with value, limit and whether it is active."""
    unmet: tuple[str, ...]
    """A line for each constraint that cannot be met; empty if all are met."""

    @property
    def feasible(self) -> bool:
        """Whether every constraint is met."""
        return all(c.met for c in self.constraints)


def tune_pd(
    plant: control.TransferFunction,
    wanted: NodTarget = ADULT,
    *,
    largest_loss: float = 0.05,
    largest_sensitivity: float = 2.0,
) -> Tuned:
    """Return the smallest gains with which a linear plant has the wanted response.

    Parameters
    ----------
    plant : control.TransferFunction
        Stable and strictly proper. For a large-angle neck pass the result of `anglecam.neck.pd.linearised`, then
        simulate the gains on the neck itself with `anglecam.neck.pd.simulate_pd`.
    wanted : NodTarget
        Rise and overshoot.
    largest_loss : float
        Largest share of the steady state that K_p may take away.
    largest_sensitivity : float
        Largest M_s; with 2 the locus stays 0.5 away from −1.

    Returns
    -------
    Tuned
        Gains that are not negative (relative to the sign of the plant); if the target cannot be met, those with the
        smallest violation.

    Raises
    ------
    ValueError
        If the plant is not stable or has no steady state.
    """
    rest = rest_gain(plant)
    if not (plant.poles().real < 0.0).all() or rest == 0.0:
        raise ValueError("gains can be tuned only for a stable plant whose steady state is not zero")

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
    """Return the constraints on a response: rise time from both sides, overshoot from above."""
    spare = wanted.rise_tolerance * wanted.rise_time
    return (
        Constraint("rise time", "s", rise_time, wanted.rise_time + spare, False, wanted.rise_time),
        Constraint("rise time", "s", rise_time, wanted.rise_time - spare, True, wanted.rise_time),
        Constraint("overshoot", "share", overshoot, wanted.overshoot + wanted.overshoot_tolerance, False, 0.1),
    )
