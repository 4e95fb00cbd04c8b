"""Command curve: the servo's angle is not proportional to the command.

    θ̈ = c·v(u) − a·θ̇ − b·θ,   v′(u) = e^(g·s(x)),   s = x·cos ψ + x²·sin ψ,   x = u/U,   v(0) = 0,   U = 15°

The exponential keeps the curve rising: v ≈ u + p·u²/2 + (q + p²/2)·u³/3 with p = g·cos ψ/U and q = g·sin ψ/U². g is the
logarithm of the change of slope at the command U, ψ says how much of it is the same on both sides (90°) or opposite
(0°). c is the slope at zero command. The body then rests at c·v(u)/b, as it does with a spring that is not linear; but
after a small step about any level it swings with the same frequency and damping.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Knots, Parameter

UNIT = math.radians(15.0)
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


def _curve(u: Floats, strength: float, shape: float) -> Floats:
    """Return v(u), rad, by Gauss's quadrature of the slope."""
    x = 0.5 * (1.0 + _PLACES) * np.asarray(u)[..., None] / UNIT
    slope = np.exp(np.clip(strength * (x * math.cos(shape) + x**2 * math.sin(shape)), -20.0, 20.0))
    return 0.5 * np.asarray(u) * (slope @ _WEIGHTS)


def _bend(given: Knots, parameters: Floats) -> Knots:
    """Bend every level; a ramp stays a ramp between its ends."""
    strength, shape = float(parameters[0]), float(parameters[1])
    if strength == 0.0:
        return given
    level = _curve(given.level, strength, shape)
    span = np.append(np.diff(given.time), 1.0)
    end = _curve(given.level + given.slope * span, strength, shape)
    slope = np.divide(end - level, span, out=np.zeros(len(level)), where=span > 0.0)
    return Knots(given.time, level, slope)


EFFECT = Effect(
    id="command_curve",
    station="command",
    summary="Equal steps of the command turn the servo by unequal angles.",
    equation="θ̈ = c·v(u) − a·θ̇ − b·θ, v′(u) = e^(g·s), s = x·cos ψ + x²·sin ψ, x = u/15°",
    relaxes="Eqs. (4), (5): the reference is proportional to the command",
    parameters=(
        Parameter("curve_strength", "g", 0.0, 0.0, 5.0, (0.1,)),
        Parameter(
            "curve_shape_deg",
            "ψ",
            0.5 * math.pi,
            -math.tau,
            math.tau,
            tuple(0.25 * math.pi * eighth for eighth in range(-3, 5)),
            math.degrees(1.0),
            circular=True,
        ),
    ),
    aliases=("stiffening_spring", "linkage_geometry", "gravity_geometry", "one_sided_spring"),
    separating_experiment=(
        "small steps about several levels: behind a curved command the body swings with one frequency, on a spring that"
        " is not linear it does not"
    ),
    source="Giri, Bai (eds.), Block-oriented Nonlinear System Identification, 2010, ch. 1: Hammerstein systems",
    rank=-1,
    command=_bend,
    in_free_swing=False,
)
