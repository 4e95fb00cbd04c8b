"""A mechanism as URDF: one joint with damping, dry friction and limits, and its transmission.

URDF describes bodies and joints, not controllers: the servo's gain and stiffness are given in comments, as the gains of
a position controller.  https://wiki.ros.org/urdf/XML/joint
"""

from __future__ import annotations

import math
from xml.sax.saxutils import escape

from anglecam.identification.simulators.mechanism import CAMERA, Exported, Mechanism

GRAVITY = 9.81
"""m/s²."""
EXPRESSED = ("coulomb_friction", "torque_saturation", "rate_limit", "gravity_geometry", "end_stop")


def urdf_of(mechanism: Mechanism, inertia: float = 1.0) -> Exported:
    """Return a mechanism as the content of a URDF file.

    Parameters
    ----------
    mechanism : Mechanism
        From `anglecam.identification.simulators.mechanism.read_mechanism`.
    inertia : float
        Moment of inertia of all that moves about the axis, kg·m².

    Returns
    -------
    Exported
        SI units and radians from neutral.
    """
    friction = mechanism.effects.get("coulomb_friction", {})
    left_out = [
        f"b: URDF has no spring; stiffness {mechanism.b * inertia:.6g} N·m/rad",
        *([] if mechanism.c is None else [f"c: URDF has no controller; gain {mechanism.c * inertia:.6g} N·m/rad"]),
    ]
    for name in mechanism.effects:
        if name in CAMERA:
            left_out.append(f"{name}: an effect of the camera; the joint moves without it")
        elif name not in EXPRESSED:
            left_out.append(f"{name}: URDF cannot express it; left out")
    left_out += [
        f"coulomb_friction: URDF's friction has no {name.rsplit('_deg', 1)[0].replace('_', ' ')}"
        for name, value in friction.items()
        if name != "friction_deg_per_s2" and value != 0.0
    ]
    inertial = _inertial(mechanism, inertia, left_out)
    name = escape(mechanism.name, {'"': "&quot;"})
    comment = "\n".join(f"  NOT EXPRESSED: {line.replace('--', '- -')}" for line in left_out)
    kind, limit = _limit(mechanism, inertia)
    damping, loss = mechanism.a * inertia, friction.get("friction_deg_per_s2", 0.0) * inertia
    text = f"""<?xml version="1.0"?>
<!-- written by anglecam
  moment of inertia: {inertia:g} kg·m², stated and not identified; all torques are proportional to it
{comment}
-->
<robot name="{name}">
  <link name="base"/>
  <link name="body">
{inertial}  </link>
  <joint name="angle" type="{kind}">
    <parent link="base"/>
    <child link="body"/>
    <axis xyz="0 1 0"/>
    <dynamics damping="{damping:.12g}" friction="{loss:.12g}"/>
{limit}  </joint>
  <transmission name="servo">
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="angle">
      <hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface>
    </joint>
    <actuator name="servo">
      <mechanicalReduction>1</mechanicalReduction>
    </actuator>
  </transmission>
</robot>
"""
    return Exported(text, tuple(left_out))


def _limit(mechanism: Mechanism, inertia: float) -> tuple[str, str]:
    """Return the joint's type and its limits; URDF demands both effort and velocity where it states one."""
    stops = mechanism.effects.get("end_stop")
    effort = mechanism.value("torque_saturation", "limit_deg_per_s2", math.inf) * inertia
    velocity = mechanism.value("rate_limit", "rate_deg_per_s", math.inf)
    if stops is None and math.isinf(effort) and math.isinf(velocity):
        return "continuous", ""
    # a limit that was not identified is stated as one that nothing reaches
    values = f'effort="{min(effort, 1e9):.12g}" velocity="{min(velocity, 1e9):.12g}"'
    if stops is None:
        return "continuous", f"    <limit {values}/>\n"
    lower, upper = stops.get("lower_stop_deg", -math.tau), stops.get("upper_stop_deg", math.tau)
    return "revolute", f'    <limit lower="{lower:.12g}" upper="{upper:.12g}" {values}/>\n'


def _inertial(mechanism: Mechanism, inertia: float, left_out: list[str]) -> str:
    """Return the body's mass and inertia; a weight is a mass at half of the longest possible arm."""
    weight = mechanism.value("gravity_geometry", "gravity_deg_per_s2")
    upright = mechanism.value("gravity_geometry", "gravity_deg", math.nan)
    place, mass, about = "0 0 0", 1.0, inertia
    if weight > 0.0 and math.isnan(upright):
        left_out.append("gravity_geometry: its direction gravity_deg is not in the file; left out")
    elif weight > 0.0:
        arm = 0.5 * GRAVITY / weight
        place = f"{arm * math.sin(upright):.12g} 0 {arm * math.cos(upright):.12g}"
        mass = weight * inertia / (GRAVITY * arm)
        about = inertia - mass * arm**2
        left_out.append(
            "gravity_geometry: b includes the weight's part at neutral, so a controller must be stiffer by it"
        )
    moments = f'ixx="{about:.12g}" iyy="{about:.12g}" izz="{about:.12g}" ixy="0" ixz="0" iyz="0"'
    return f"""    <inertial>
      <origin xyz="{place}"/>
      <mass value="{mass:.12g}"/>
      <inertia {moments}/>
    </inertial>
"""
