"""Linkage geometry: the four-bar's angle-dependent ratio between servo and head in place of a constant.

    θ̈ = φ′(θ)·(c·u − b·φ(θ)) − a·θ̇,   φ = θ + A·(φ4(θ) − θ)

φ4(θ) is the crank's angle, divided by the ratio at neutral: the head angle that it would mean if γ were constant, with
φ4(0) = 0 and φ4′(0) = 1. By virtual work the servo's torque reaches the head with the lever φ′. A is 1 for the paper's
links and 0 for the constant γ of Eq. (3). All of b is attributed to the servo's position feedback.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.neck.fourbar import NEUTRAL_SERVO, FourBar, head_angle, reach, servo_angle
from anglecam.neck.transmission import slope

_NODES = 1025
_LINKS = FourBar()
_NEUTRAL = float(head_angle(_LINKS, NEUTRAL_SERVO))
_LOW, _HIGH = (_NEUTRAL - end for end in reversed(reach(_LINKS)))
_GRID = np.linspace(_LOW, _HIGH, _NODES)[1:-1]
_SPACING = _GRID[1] - _GRID[0]
_CRANK = servo_angle(_LINKS, _NEUTRAL - _GRID)
_AT_NEUTRAL = float(slope(_LINKS, NEUTRAL_SERVO))
_PHI = -_AT_NEUTRAL * (_CRANK - NEUTRAL_SERVO)
_LEVER = _AT_NEUTRAL / slope(_LINKS, _CRANK)


@njit
def _servo(torque: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    amount = parameters[0]
    if amount == 0.0:
        return torque
    # beyond the reach of the links the last ratio holds: a trial step of the fit may go there
    inside = min(max(theta, _GRID[0]), _GRID[-1])
    place = (inside - _GRID[0]) / _SPACING
    i = min(int(place), len(_GRID) - 2)
    part = place - i
    phi = theta + amount * ((1.0 - part) * _PHI[i] + part * _PHI[i + 1] - inside)
    lever = 1.0 + amount * ((1.0 - part) * _LEVER[i] + part * _LEVER[i + 1] - 1.0)
    return lever * (torque + abc[1] * (theta - phi))


EFFECT = Effect(
    id="linkage_geometry",
    station="load",
    summary="The linkage transmits the servo's motion to the body with a ratio that changes with the angle.",
    equation="θ̈ = φ′(θ)·(c·u − b·φ(θ)) − a·θ̇, φ = θ + A·(φ4(θ) − θ) with the four-bar's φ4",
    relaxes="Eq. (3), Fig. 4: γ is constant",
    parameters=(Parameter("share_of_four_bar", "A", null=0.0, lower=-0.5, upper=1.5, starts=(0.3, 1.0)),),
    aliases=("stiffening_spring", "gravity_geometry"),
    separating_experiment="slow stairs over the whole range: the linkage shows in the angle at which each step ends",
    source="the paper, Eqs. (1)-(3); anglecam.neck.transmission",
    rank=-1,
    servo=_servo,
)
