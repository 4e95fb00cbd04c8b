"""Linkage geometry: the four-bar's angle-dependent ratio between servo and head in place of a constant.

    θ̈ = φ′(θ)·(c·u − b·φ(θ)) − a·θ̇,   φ = θ + A·(φ4(θ) − θ)

φ4(θ) is the crank's angle, divided by the ratio at neutral: the head angle that it would mean if γ were constant, with
φ4(0) = 0 and φ4′(0) = 1. By virtual work the servo's torque reaches the head with the lever φ′. A is 1 for the paper's
links and 0 for the constant γ of Eq. (3). All of b is attributed to the servo's position feedback.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from anglecam.data.typing import Floats
from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.neck.fourbar import NEUTRAL_SERVO, FourBar, head_angle, reach, servo_angle
from anglecam.neck.transmission import slope

_NODES = 1025
_LINKS = FourBar()
_NEUTRAL = float(head_angle(_LINKS, NEUTRAL_SERVO))
_LOW, _HIGH = (_NEUTRAL - end for end in reversed(reach(_LINKS)))
_GRID = np.linspace(_LOW, _HIGH, _NODES)[1:-1]
_CRANK = servo_angle(_LINKS, _NEUTRAL - _GRID)
_AT_NEUTRAL = float(slope(_LINKS, NEUTRAL_SERVO))
_PHI = -_AT_NEUTRAL * (_CRANK - NEUTRAL_SERVO)
_LEVER = _AT_NEUTRAL / slope(_LINKS, _CRANK)


def _servo_with(grid: Floats, crank: Floats, levers: Floats) -> Any:
    """Compile the port for tables over the angle.

    Numba compiles the values of enclosed arrays in, and finds the code again only for the same values.
    """
    spacing = grid[1] - grid[0]

    @ports.servo
    def _servo(torque: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
        amount = parameters[0]
        if amount == 0.0:
            return torque
        # beyond the reach of the links the last ratio holds: a trial step of the fit may go there
        inside = min(max(theta, grid[0]), grid[-1])
        place = (inside - grid[0]) / spacing
        i = min(int(place), len(grid) - 2)
        part = place - i
        phi = theta + amount * ((1.0 - part) * crank[i] + part * crank[i + 1] - inside)
        lever = 1.0 + amount * ((1.0 - part) * levers[i] + part * levers[i + 1] - 1.0)
        return lever * (torque + abc[1] * (theta - phi))

    return _servo


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
    servo=_servo_with(_GRID, _PHI, _LEVER),
)
