"""Design a neck for a wanted response: spring, link and gains that meet Eqs. (34)-(35) and the wanted range.

The design is the least change of a given neck that meets every constraint; the change is the sum of the squared
logarithms of the changed quantities. a, b and c of each candidate follow from Eq. (28), so Eq. (34) always holds;
Eq. (35) is one of the constraints. When L6 changes, the coupler L3 changes so that the chain closes at neutral, and γ
follows from the links.

With fixed C and motor a is fixed, and rise time and overshoot cannot both be chosen, because a = 2ζω. Damping comes
from the derivative gain K_d, the paper's remedy, or from C itself, "improving the viscous damping C"; either can be
free.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from anglecam.data.step_figures import StepFigures
from anglecam.data.typing import Floats
from anglecam.neck.constraints import Constraint, least
from anglecam.neck.fourbar import reach, servo_angle
from anglecam.neck.linear import LinearNeck, linear_neck, passive_stiffness
from anglecam.neck.parameters import PAPER, NeckParameters
from anglecam.neck.pd import PdGains
from anglecam.neck.pd_tuning import NodTarget, nod_constraints
from anglecam.neck.statics import pretension_angle
from anglecam.neck.step import linear_step_figures
from anglecam.neck.transmission import worst_transmission_angle
from anglecam.neck.variation import PARAMETERS, neutral_head

BOUNDS: dict[str, tuple[float, float]] = {
    "K": (200.0, 20_000.0),
    "L_6": (0.045, 0.075),
    "h": (1.0, 6.0),
    "G_a": (5.0, 1000.0),
    "C": (0.01, 1.0),
    "K_m": (1e-3, 2e-2),
    "R_a": (0.1, 2.0),
    "L_2": (0.02, 0.08),
    "K_d": (0.0, 1.0),
}
"""Quantities that may be free, with their bounds, SI: h and G_a as in the text; K_d in V·s/rad."""
_DAMPING_GAIN = "K_d"
_TYPICAL_K_D = 0.05
"""K_d, V·s/rad, that costs as much as a change of another quantity by the factor e."""


@dataclass(frozen=True)
class Wish:
    """The wanted response and range of a neck."""

    nod: NodTarget
    """Rise time and overshoot."""
    up: float = math.radians(25.0)
    """Range of the head above neutral, rad."""
    down: float = math.radians(23.5)
    """Range below neutral, rad: that of the paper's links, which Table 3 rounds to 25°."""
    servo_travel: float = math.radians(180.0)
    """Largest travel of the servo arm, rad: Fig. 13."""
    transmission_angle: float = math.radians(40.0)
    """Least angle between coupler and rocker, rad; below it a linkage jams easily."""
    largest_voltage: float = 6.0
    """Largest voltage to hold the head at the end of its range, V."""
    stall_torque: float | None = None
    """Stall torque of the servo at its shaft, N·m, that has to hold the head there; no constraint if ``None``. The
    paper's neck needs 0.71 N·m by Eq. (25) and its servo has 0.47."""


@dataclass(frozen=True)
class Synthesis:
    """A neck made to a wish."""

    neck: NeckParameters
    gains: PdGains
    """K_d of the controller in the feedback path, V·s/rad; 0 if it was not free."""
    linear: LinearNeck
    """Eq. (28) of the neck without the controller."""
    figures: StepFigures
    """Step figures of the neck with its controller, for a step of 1 V."""
    command_gain: float
    """C_i of Eq. (29) with which the head comes to rest at the commanded angle, V/rad."""
    changes: dict[str, tuple[float, float]]
    """Each free quantity before and after, SI."""
    constraints: tuple[Constraint, ...]
    """Each with value, limit and whether it is active."""
    unmet: tuple[str, ...]
    """A line for each constraint that cannot be met; empty if the design is feasible."""

    @property
    def feasible(self) -> bool:
        """Whether every constraint is met."""
        return all(c.met for c in self.constraints)


def synthesise(
    wish: Wish,
    neck: NeckParameters = PAPER,
    free: tuple[str, ...] = ("K", "L_6", "h", "G_a", "K_d"),
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> Synthesis:
    """Return the neck nearest to a given one that meets a wish.

    Parameters
    ----------
    wish : Wish
        Response and range.
    neck : NeckParameters
        The neck to change; quantities that are not free keep their values.
    free : tuple of str
        Names in `BOUNDS`.
    bounds : mapping, optional
        Replace those in `BOUNDS`, SI.

    Returns
    -------
    Synthesis
        If the wish cannot be met, the design with the smallest violation, and the constraints that cannot be met.

    Raises
    ------
    ValueError
        For a name that cannot be free, an empty choice or invalid bounds.
    """
    limits = {name: _limits(name, bounds) for name in free}
    if not limits:
        raise ValueError("nothing is free to change")
    start = {name: 0.0 if name == _DAMPING_GAIN else PARAMETERS[name].read(neck) for name in free}
    # Logarithms of the positive quantities, so that a change by a factor costs the same up and down; K_d starts at 0.
    lower, upper = (np.array([_to_variable(name, limits[name][i]) for name in free]) for i in (0, 1))
    origin = np.array([_to_variable(name, start[name]) for name in free])

    def candidate(x: Floats) -> tuple[NeckParameters, PdGains]:
        made, derivative = neck, 0.0
        for name, variable in zip(free, x, strict=True):
            if name == _DAMPING_GAIN:
                derivative = float(variable) * _TYPICAL_K_D
            elif variable != origin[free.index(name)]:
                made = PARAMETERS[name].changed(made, math.exp(variable))
        return made, PdGains(0.0, derivative)

    def evaluate(x: Floats) -> tuple[float, tuple[Constraint, ...]]:
        return float(((x - origin) ** 2).sum()), design_constraints(wish, *candidate(x))

    best = least(evaluate, lower, upper, [origin])
    made, gains = candidate(best.at)
    linear = linear_neck(made)
    after = [gains.derivative if n == _DAMPING_GAIN else PARAMETERS[n].read(made) for n in free]
    return Synthesis(
        replace(made, servo=replace(made.servo, command_gain=linear.b / linear.c)),
        gains,
        linear,
        _figures(linear, gains),
        linear.b / linear.c,
        {name: (start[name], value) for name, value in zip(free, after, strict=True)},
        best.constraints,
        best.unmet,
    )


def design_constraints(wish: Wish, neck: NeckParameters, gains: PdGains) -> tuple[Constraint, ...]:
    """Return the constraints of a wish, with the values of a neck.

    Parameters
    ----------
    wish : Wish
        Wanted response and range.
    neck : NeckParameters
        Its links close at neutral.
    gains : PdGains
        Gains of its controller.

    Returns
    -------
    tuple of Constraint
        Always the same constraints in the same order: rise time (two), overshoot, stability, upright without servo,
        pretension, range (two), servo travel, transmission angle, voltage and torque, whose limit is infinite if it is
        not required.
    """
    linear, passive = linear_neck(neck), passive_stiffness(neck)
    figures = _figures(linear, gains)
    low, high = reach(neck.linkage)
    middle = neutral_head(neck.linkage)
    ends = servo_angle(neck.linkage, np.clip([middle - wish.up, middle + wish.down], low, high))
    first, last = float(ends.min()), float(ends.max())
    mu = worst_transmission_angle(neck.linkage, first, last).mu
    farthest = max(wish.up, wish.down)
    rows = (
        *nod_constraints(wish.nod, figures.rise_time, figures.overshoot),
        Constraint("stiffness with servo, Eq. (35)", "N·m", linear.stiffness, 0.0, True, 1.0),
        Constraint("stiffness of spring and weight, Eq. (25)", "N·m", passive, 0.0, True, 1.0),
        Constraint("pretension angle, Eq. (24)", "rad", pretension_angle(neck), 0.0, True, 0.1),
        Constraint("range upward", "rad", middle - low, wish.up, True, 0.1),
        Constraint("range downward", "rad", high - middle, wish.down, True, 0.1),
        Constraint("servo travel", "rad", last - first, wish.servo_travel, False, 0.1),
        Constraint("transmission angle", "rad", min(mu, math.pi - mu), wish.transmission_angle, True, 0.1),
        Constraint("voltage at the end", "V", linear.b / linear.c * farthest, wish.largest_voltage, False, 1.0),
    )
    # without a wish for it the torque is only reported: an infinite limit is always met
    torque, most = abs(neck.gamma) * passive * farthest, math.inf if wish.stall_torque is None else wish.stall_torque
    scale = 1.0 if wish.stall_torque is None else wish.stall_torque
    return (*rows, Constraint("servo torque at the end (shaft)", "N·m", torque, most, False, scale))


def _figures(linear: LinearNeck, gains: PdGains) -> StepFigures:
    """Return the step figures of Eq. (30) with −K_p·θ − K_d·θ̇ added to the input."""
    damping = linear.a + linear.c * gains.derivative
    return linear_step_figures([linear.c], [1.0, damping, linear.b + linear.c * gains.proportional])


def _limits(name: str, bounds: Mapping[str, tuple[float, float]] | None) -> tuple[float, float]:
    if name not in BOUNDS:
        raise ValueError(f"{name} cannot be free; there are {', '.join(BOUNDS)}")
    low, high = (bounds or {}).get(name, BOUNDS[name])
    if not (low < high and (low > 0.0 or (name == _DAMPING_GAIN and low == 0.0))):
        raise ValueError(f"{name} between {low:g} and {high:g}: bounds are positive and increase")
    return low, high


def _to_variable(name: str, value: float) -> float:
    """Return the optimiser's variable for a quantity."""
    return value / _TYPICAL_K_D if name == _DAMPING_GAIN else math.log(value)
