"""A mechanism as MJCF, the XML format of MuJoCo: a hinge with a position servo.

    J·θ̈ = clip(c·J·v − s·b·J·θ, ±T·J) − (1 − s)·b·J·θ − a·J·θ̇ − …

The servo's share s of the stiffness is the actuator's feedback, and the rest is the joint's spring. Quadratic drag and
a cubic spring are terms of the joint's polynomials of damping and stiffness; a weight is a mass at a distance.
https://mujoco.readthedocs.io/en/stable/XMLreference.html
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from anglecam.identification.simulators.mechanism import CAMERA, Exported, Mechanism

STEP = 5e-4
"""Longest time step, s; a dead time is a whole number of steps."""
SLEW_STEP = 1e-4
"""The same with a speed limit, whose set-point MuJoCo moves once in a step."""
GRAVITY = 9.81
"""m/s²."""
RIGID = "0.9999 0.9999 0.001 0.5 2"
"""Impedance of dry friction. With MuJoCo's default a body that friction holds creeps."""
EXPRESSED = {
    "dead_time",
    "actuator_lag",
    "rate_limit",
    "torque_saturation",
    "coulomb_friction",
    "quadratic_drag",
    "stiffening_spring",
    "gravity_geometry",
    "constant_torque",
    "end_stop",
}
NO_FRICTION = {
    "asymmetry_deg_per_s2": "difference between the two directions",
    "breakaway_excess_deg_per_s2": "breakaway torque above the sliding one",
    "stribeck_speed_deg_per_s": "Stribeck's curve",
}
"""Parameters of dry friction that MuJoCo does not have."""
Attributes = dict[str, str]


@dataclass
class _Joint:
    """The attributes of the elements, as they are filled in, and what they cannot express."""

    option: Attributes
    joint: Attributes
    inertial: Attributes
    servo: Attributes
    left_out: list[str] = field(default_factory=list)
    element: str = "general"


def mjcf_of(mechanism: Mechanism, inertia: float = 1.0) -> Exported:
    """Return a mechanism as the content of an MJCF file.

    Parameters
    ----------
    mechanism : Mechanism
        From `anglecam.identification.simulators.mechanism.read_mechanism`.
    inertia : float
        Moment of inertia of all that moves about the axis, kg·m². Motion alone does not show it; all torques are
        proportional to it.

    Returns
    -------
    Exported
        Angles and commands are radians from neutral.
    """
    parts = _Joint(
        {"timestep": _text(STEP), "integrator": "RK4", "gravity": f"0 0 -{GRAVITY:g}"},
        {"name": "angle", "type": "hinge", "axis": "0 1 0"},
        {"pos": "0 0 0", "mass": "1", "diaginertia": " ".join([_text(inertia)] * 3)},
        {"name": "servo", "joint": "angle"},
    )
    _fill_inertia(parts, mechanism, inertia)
    _fill_friction(parts, mechanism, inertia)
    _fill_stops(parts, mechanism)
    if mechanism.c is None:
        parts.left_out.append("no command was recorded: the joint has no actuator")
        _fill_springs(parts, mechanism, inertia, 0.0, _constant(mechanism))
    else:
        _fill_servo(parts, mechanism, inertia, mechanism.c)
    for name in mechanism.effects:
        if name in CAMERA:
            parts.left_out.append(f"{name}: an effect of the camera; the joint moves without it")
        elif name not in EXPRESSED:
            parts.left_out.append(f"{name}: MuJoCo's joint and actuator cannot express it; left out")
    return Exported(_document(parts, mechanism, inertia), tuple(parts.left_out))


def _fill_inertia(parts: _Joint, mechanism: Mechanism, inertia: float) -> None:
    """Place the weight; its arm is half of the longest that the moment of inertia allows."""
    weight = mechanism.value("gravity_geometry", "gravity_deg_per_s2")
    if weight <= 0.0:
        return
    upright = mechanism.value("gravity_geometry", "gravity_deg", math.nan)
    if math.isnan(upright):
        parts.left_out.append("gravity_geometry: its direction gravity_deg is not in the file; left out")
        return
    arm = 0.5 * GRAVITY / weight
    mass = weight * inertia / (GRAVITY * arm)
    about = inertia - mass * arm**2
    parts.inertial = {
        "pos": f"{_text(arm * math.sin(upright))} 0 {_text(arm * math.cos(upright))}",
        "mass": _text(mass),
        "diaginertia": " ".join([_text(about)] * 3),
    }


def _weight(mechanism: Mechanism) -> tuple[float, float]:
    """Return the torque and the stiffness, per inertia, that balance the weight at neutral."""
    upright = mechanism.value("gravity_geometry", "gravity_deg", math.nan)
    weight = mechanism.value("gravity_geometry", "gravity_deg_per_s2")
    if math.isnan(upright):
        return 0.0, 0.0
    return -weight * math.sin(upright), weight * math.cos(upright)


def _fill_friction(parts: _Joint, mechanism: Mechanism, inertia: float) -> None:
    drag = mechanism.value("quadratic_drag", "q_per_rad")
    parts.joint["damping"] = _text(mechanism.a * inertia) + (f" {_text(drag * inertia)} 0" if drag else "")
    friction = mechanism.effects.get("coulomb_friction")
    if friction is None:
        return
    parts.joint |= {
        "frictionloss": _text(friction.get("friction_deg_per_s2", 0.0) * inertia),
        "solimpfriction": RIGID,
        "solreffriction": f"{_text(2.0 * STEP)} 1",
    }
    parts.left_out += [
        f"coulomb_friction: MuJoCo's frictionloss has no {what}"
        for name, what in NO_FRICTION.items()
        if friction.get(name, 0.0) != 0.0
    ]


def _fill_stops(parts: _Joint, mechanism: Mechanism) -> None:
    stops = mechanism.effects.get("end_stop")
    if stops is None:
        return
    lower, upper = (stops.get(f"{side}_stop_deg") for side in ("lower", "upper"))
    parts.joint["range"] = (
        f"{_text(-math.tau if lower is None else lower)} {_text(math.tau if upper is None else upper)}"
    )
    parts.left_out.append(
        "end_stop: written as the joint's range, whose stiffness is MuJoCo's and not the identified one"
    )


def _fill_springs(parts: _Joint, mechanism: Mechanism, inertia: float, servo: float, constant: float = 0.0) -> None:
    """Give the joint the stiffness and the constant torque that the servo does not have; both are per inertia."""
    left = mechanism.b + _weight(mechanism)[1] - servo
    cubic = mechanism.value("stiffening_spring", "k3_per_s2")
    if left or cubic:
        parts.joint["stiffness"] = _text(left * inertia) + (f" 0 {_text(cubic * inertia)}" if cubic else "")
    if constant and left and not cubic:
        parts.joint["springref"] = _text(constant / left)
    elif constant:
        parts.left_out.append("a constant torque: MuJoCo's joint cannot express it here; left out")


def _fill_servo(parts: _Joint, mechanism: Mechanism, inertia: float, c: float) -> None:
    limited, slow = "torque_saturation" in mechanism.effects, "rate_limit" in mechanism.effects
    share = mechanism.value("torque_saturation", "servo_share", 1.0) if limited else 1.0
    constant = _constant(mechanism)
    lag = mechanism.value("actuator_lag", "lag_s")
    if slow:  # a PID's stiffness is its gain, and it has no constant torque
        _fill_springs(parts, mechanism, inertia, c, constant)
        slew = mechanism.value("rate_limit", "rate_deg_per_s")
        parts.element, parts.option["timestep"] = "pid", _text(SLEW_STEP)
        parts.servo |= {"kp": _text(c * inertia), "slewmax": _text(slew), "input": "pos"}
    else:
        _fill_springs(parts, mechanism, inertia, share * mechanism.b)
        bias = f"{_text(constant * inertia)} {_text(-share * mechanism.b * inertia)} 0"
        parts.servo |= {"gaintype": "fixed", "gainprm": _text(c * inertia), "biastype": "affine", "biasprm": bias}
        parts.servo |= {"dyntype": "filterexact", "dynprm": _text(lag)} if lag > 0.0 else {}
    if limited:
        limit = mechanism.value("torque_saturation", "limit_deg_per_s2") * inertia
        parts.servo["forcerange"] = f"{_text(-limit)} {_text(limit)}"
    _fill_delay(parts, mechanism.value("dead_time", "tau_s"))
    if slow and lag > 0.0:
        parts.left_out.append("actuator_lag: MuJoCo has no lag behind a speed limit; left out")
    if slow and limited:
        parts.left_out.append("torque_saturation: beside a speed limit, all of c·u − c·θ counts as the servo's")
    elif limited and constant:
        parts.left_out.append("torque_saturation: the limit includes the servo's constant torque")


def _constant(mechanism: Mechanism) -> float:
    """Return the constant torque per inertia, rad/s², with what holds the weight at neutral."""
    return mechanism.value("constant_torque", "torque_deg_per_s2") + _weight(mechanism)[0]


def _fill_delay(parts: _Joint, delay: float) -> None:
    if delay < 0.0:
        parts.left_out.append("dead_time: it is negative, so the command's clock is late; left out")
    elif delay > 0.0:
        steps = math.ceil(delay / float(parts.option["timestep"]))
        parts.option["timestep"] = _text(delay / steps)
        parts.servo |= {"delay": _text(delay), "nsample": str(steps + 1)}


def _document(parts: _Joint, mechanism: Mechanism, inertia: float) -> str:
    lines = [
        f"{mechanism.name}: θ̈ = c·u − a·θ̇ − b·θ with a = {mechanism.a:.6g} 1/s, b = {mechanism.b:.6g} 1/s²"
        + ("" if mechanism.c is None else f", c = {mechanism.c:.6g} 1/s²"),
        f"effects: {', '.join(mechanism.effects) or 'none'}",
        f"moment of inertia: {inertia:g} kg·m², stated and not identified; all torques are proportional to it",
        "angle and command are radians from neutral; hold the command's mean over a time step",
        *(f"NOT EXPRESSED: {line}" for line in parts.left_out),
    ]
    comment = "\n".join(f"  {line.replace('--', '- -')}" for line in lines)
    actuator = (
        "" if mechanism.c is None else f"\n  <actuator>\n    {_element(parts.element, parts.servo)}\n  </actuator>"
    )
    return f"""<!-- written by anglecam
{comment}
-->
<mujoco model="{_escaped(mechanism.name)}">
  <compiler angle="radian"/>
  {_element("option", parts.option)}
  <worldbody>
    <body name="body">
      {_element("joint", parts.joint)}
      {_element("inertial", parts.inertial)}
      <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" contype="0" conaffinity="0"/>
    </body>
  </worldbody>{actuator}
</mujoco>
"""


def _element(tag: str, attributes: Attributes) -> str:
    return f"<{tag} " + " ".join(f'{name}="{_escaped(value)}"' for name, value in attributes.items()) + "/>"


def _escaped(text: str) -> str:
    from xml.sax.saxutils import escape

    return escape(text, {'"': "&quot;"})


def _text(value: float) -> str:
    return f"{value:.12g}"
