"""Load-dependent friction: dry friction that grows with the torque which gears and bearings transmit.

    θ̈ = τ − a·θ̇ − μ·|q|·sgn θ̇,   τ = c·u − b·θ,   q = τ + s·b·θ       while sliding
    θ̇ = 0                       while |τ| ≤ μ·|q|                     the load sticks

q is the servo's torque. s is the share of b that springs on the load supply, so that q = c·u − (1 − s)·b·θ. Teeth and
journals are pressed together by the torque that they transmit, and Coulomb's law makes friction proportional to it. The
effect differs from constant dry friction in that it vanishes with the torque. With s = 0 the load never sticks for
μ < 1: the drive then only loses the share μ of its torque, and brakes with the share μ more. With springs the servo
holds a torque at rest, and the body sticks within a band that widens with the angle.
"""

from __future__ import annotations

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values


@ports.friction
def _friction(torque: float, theta: float, abc: Values, parameters: Values) -> tuple[float, float, float, float]:
    level = parameters[0] * abs(torque + parameters[1] * abc[1] * theta)
    return level, level, 0.0, 0.0


EFFECT = Effect(
    id="load_dependent_friction",
    station="load",
    summary="Dry friction grows with the torque that gears and bearings transmit.",
    equation="θ̈ = c·u − a·θ̇ − b·θ − μ·|c·u − (1 − s)·b·θ|·sgn θ̇; θ̇ = 0 while |c·u − b·θ| ≤ μ·|c·u − (1 − s)·b·θ|",
    relaxes="Eq. (22): damping is viscous only; Eq. (3): the linkage transmits without loss",
    parameters=(
        Parameter("friction_share_of_torque", "μ", 0.0, 0.0, 0.9, (0.03, 0.1, 0.3)),
        Parameter("spring_share", "s", 0.0, 0.0, 1.0, (0.3, 0.8)),
    ),
    aliases=("coulomb_friction", "quadratic_drag", "damping_asymmetry"),
    separating_experiment=(
        "a slow triangle of small amplitude about neutral and about the end of the range: friction of bearings under"
        " load widens the lag with the angle, constant friction does not"
    ),
    source="Armstrong-Hélouvry, Control of Machines with Friction, 1991, sec. 3.3; Dowson, History of Tribology, 1979",
    kinked=True,
    friction=_friction,
    in_free_swing=False,
)
