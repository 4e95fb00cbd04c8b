"""The quantities that a certificate states, each a parameter of an effect of the ledger.

Torques are divided by the moment of inertia, because motion alone does not show either of them. The breakaway torque is
a parameter of its own here; in the ledger it is the excess over the friction while sliding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from anglecam.data.typing import Floats
from anglecam.effects import Effect, Parameter

DEGREE = math.degrees(1.0)


@dataclass(frozen=True)
class Quantity:
    """One quantity of a certificate."""

    id: str
    """Identifier in ``certificate.json``."""
    name: str
    """Name in sentences."""
    key: str
    """Key of its value in ``certificate.json``; it ends in the unit."""
    unit: str
    """Unit as it follows a number."""
    effect_id: str
    """The effect of the ledger that it is a parameter of."""
    parameter: str
    """Name of that parameter."""
    to_file: float
    """Factor from SI to ``unit``; for a limit, from the reciprocal of the parameter."""
    meaning: str
    """Definition, in a sentence."""
    is_limit: bool = False
    """Whether the parameter is the reciprocal of the quantity, so that 0 means that there is no limit."""
    is_torque: bool = False
    """Whether it is a torque divided by the moment of inertia, which c converts to degrees of command."""
    vanishing: int = 1
    """Number of parameters that vanish where this one does, itself included."""

    def in_file(self, value: float) -> float:
        """Convert a parameter's value from SI to the unit in files; an absent limit is infinite."""
        if not self.is_limit:
            return value * self.to_file
        return self.to_file / value if value > 0.0 else math.inf

    def interval_in_file(self, lower: float, upper: float) -> tuple[float, float]:
        """Convert an interval of the parameter; the ends of a limit change places."""
        ends = self.in_file(lower), self.in_file(upper)
        return (ends[1], ends[0]) if self.is_limit else ends


QUANTITIES = (
    Quantity(
        "backlash",
        "backlash",
        "backlash_deg",
        "°",
        "backlash",
        "half_width_deg",
        2.0 * DEGREE,
        "the whole play between servo and body, in degrees of command",
    ),
    Quantity(
        "coulomb_friction",
        "Coulomb friction",
        "coulomb_friction_deg_per_s2",
        " °/s²",
        "coulomb_friction",
        "friction_deg_per_s2",
        DEGREE,
        "dry friction torque while sliding, divided by the moment of inertia",
        is_torque=True,
    ),
    Quantity(
        "breakaway_friction",
        "breakaway friction",
        "breakaway_friction_deg_per_s2",
        " °/s²",
        "coulomb_friction",
        "breakaway_deg_per_s2",
        DEGREE,
        "torque at which the resting body breaks away, divided by the moment of inertia",
        is_torque=True,
        vanishing=2,  # sliding friction cannot exceed it
    ),
    Quantity(
        "dead_time",
        "dead time",
        "dead_time_s",
        " s",
        "dead_time",
        "tau_s",
        1.0,
        "time from a change of the command to the first change of the torque",
    ),
    Quantity(
        "lag",
        "lag",
        "lag_s",
        " s",
        "actuator_lag",
        "lag_s",
        1.0,
        "time constant with which the torque approaches its new value",
    ),
    Quantity(
        "speed_limit",
        "speed limit",
        "speed_limit_deg_per_s",
        " °/s",
        "rate_limit",
        "rate_deg_per_s",
        DEGREE,
        "greatest speed at which the servo's set-point moves",
        is_limit=True,
    ),
    Quantity(
        "torque_limit",
        "torque limit",
        "torque_limit_deg_per_s2",
        " °/s²",
        "torque_saturation",
        "limit_deg_per_s2",
        DEGREE,
        "greatest torque of the servo, divided by the moment of inertia",
        is_limit=True,
        is_torque=True,
    ),
)
"""In the order in which the certificate lists them."""

_BREAKAWAY = Parameter(
    "breakaway_deg_per_s2", "S", 0.0, 0.0, 500.0, (0.0, 0.03, 0.1, 0.3, 0.6, 1.0, 1.7, 3.0, 5.0), DEGREE, swing_power=1
)
"""Its starts are the excess over the friction while sliding."""
_EXCESS = "breakaway_excess_deg_per_s2"
_SLIDING, _AT_BREAKAWAY = 0, 2
"""Positions among the parameters of ``coulomb_friction``, the fixed included."""


@dataclass(frozen=True)
class BreakawayFriction(Effect):
    """Dry friction whose breakaway level S is a parameter in place of the excess; sliding friction is at most S."""

    def complete(self, fitted: Floats) -> Floats:
        """Return the parameters of the ledger's effect: with sliding friction min(F, S) and the excess over it."""
        values = np.array(super().complete(fitted), dtype=float)
        values[_SLIDING] = min(values[_SLIDING], values[_AT_BREAKAWAY])
        values[_AT_BREAKAWAY] -= values[_SLIDING]
        return values


def with_breakaway(friction: Effect) -> BreakawayFriction:
    """Return dry friction with its breakaway level as a parameter.

    Parameters
    ----------
    friction : Effect
        The ledger's ``coulomb_friction`` with all parameters that these recordings can show.

    Returns
    -------
    BreakawayFriction
        With the parameters up to the breakaway level; the Stribeck speed stays at its null.
    """
    at = [p.name for p in friction.parameters].index(_EXCESS)
    scale = friction.parameters[at].upper / _BREAKAWAY.upper
    level = replace(_BREAKAWAY, upper=friction.parameters[at].upper, starts=tuple(scale * s for s in _BREAKAWAY.starts))
    content = {name: getattr(friction, name) for name in Effect.__dataclass_fields__}
    return BreakawayFriction(**content | {"parameters": (*friction.parameters[:at], level)})
