"""What the motion and the film have beyond the base model, one section for each effect; absent unless named.

θ is the head's angle, u the command, and forces are angular accelerations: rad/s². The first eighteen carry the
public names of the effects that anglecam looks for, the last four are known to nobody outside this package.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from synth.spec.base import Finite, NotNegative, Positive, Section, Share

SlantDeg = Annotated[float, Field(gt=-80, lt=80, allow_inf_nan=False)]


class DeadTime(Section):
    """The command acts later."""

    tau_s: NotNegative


class ActuatorLag(Section):
    """A first-order lag between command and torque."""

    tau_s: Positive


class RateLimit(Section):
    """The effective command moves no faster than this."""

    r_deg_per_s: Positive


class TorqueSaturation(Section):
    """The servo's part of the torque, c·u − share·b·θ, stays within ±limit."""

    limit: Positive
    """rad/s²."""
    share: Share = 1.0
    """Of b that is the servo's own; a neck's servo has its own feedback instead."""


class Backlash(Section):
    """Play between command and load: the load side is moved only by contact with one flank or the other."""

    half_width_deg: Positive


class DeadZone(Section):
    """The servo ignores position errors below this: c·dz(u − (b/c)·θ) in place of c·u − b·θ."""

    half_width_deg: Positive


class CoulombFriction(Section):
    """Dry friction."""

    torque: NotNegative
    """While sliding upwards, and downwards unless said otherwise, rad/s²."""
    downward: NotNegative | None = None
    """While sliding downwards, rad/s²."""
    breakaway: NotNegative | None = None
    """To leave rest in either direction, rad/s²; the sliding friction where not given."""
    stribeck_deg_per_s: Positive | None = None
    """Speed within which friction falls from breakaway to sliding, exp(−(ω/ω_s)²); at once where not given."""

    @model_validator(mode="after")
    def _breakaway_holds_more(self) -> CoulombFriction:
        if self.breakaway is not None and self.breakaway < max(self.torque, self.downward or 0.0):
            raise ValueError("breakaway must not be smaller than torque")
        if self.stribeck_deg_per_s is not None and self.breakaway is None:
            raise ValueError("stribeck_deg_per_s needs a breakaway to fall from")
        return self


class QuadraticDrag(Section):
    """−q·θ̇·|θ̇|."""

    q: NotNegative
    """1/rad."""


class StiffeningSpring(Section):
    """−k3·θ³; negative k3 softens."""

    k3: Finite
    """1/(s²·rad²)."""


class GravityGeometry(Section):
    """G·(sin(θ0 + θ) − sin θ0 − θ·cos θ0): what the linear model leaves out of gravity."""

    strength: Finite
    """G = M_h·g·L/J, rad/s²."""
    gravity_deg: Finite
    """θ0, of the centre of mass from upright at neutral."""


class LinkageGeometry(Section):
    """The four-bar's own γ(θ) between servo and head in place of a constant."""

    share: Share = 1.0
    """Of b that acts through the linkage as the servo's position feedback."""


class ConstantTorque(Section):
    """A steady torque."""

    torque: Finite
    """rad/s²."""


class CameraTilt(Section):
    """The plane of motion is seen at a slant."""

    tilt_deg: SlantDeg
    axis_deg: Finite = 0.0
    """Of the axis in the picture about which the camera is turned: 0 looks from above, 90 from the side."""


class PivotOffset(Section):
    """The mark is not on the axis of rotation but on the bearing beside it."""

    dx_px: Finite
    dy_px: Finite


class LensDistortion(Section):
    """Radial distortion about the middle of the picture: r·(1 + k1·r²), r in units of the focal length."""

    k1: Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)]


class RollingShutter(Section):
    """Each row is exposed later than the one above it; the middle row at the frame's own time."""

    row_time_s: Annotated[float, Field(ge=0, le=1e-3, allow_inf_nan=False)]


class ClockScale(Section):
    """The clip's clock runs fast: its seconds number so many for each true one."""

    scale: Annotated[float, Field(gt=0.5, lt=2, allow_inf_nan=False)]


class AngleDrift(Section):
    """The camera sags about its own line of sight, so that the measured angle creeps."""

    rate_deg_per_s: Annotated[float, Field(ge=-5, le=5, allow_inf_nan=False)]


class SlackSpring(Section):
    """A spring that only pulls: −stiffness·(θ − slack) above `slack_deg`, nothing below."""

    stiffness: Positive
    """1/s²."""
    slack_deg: Finite = 0.0


class FlexibleAppendage(Section):
    """Something on the head that swings by itself, an antenna, and shakes the head in turn."""

    frequency_hz: Positive
    """Of the appendage with the head held."""
    damping_ratio: NotNegative = 0.02
    inertia_share: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)] = 0.1
    """Of its inertia to the head's."""


class PeriodicDisturbance(Section):
    """A torque from elsewhere that swings by itself: amplitude·sin(2π·f·t + phase)."""

    amplitude: Positive
    """rad/s²."""
    frequency_hz: Positive
    phase: Finite = 0.0
    """rad, at time 0 of each recording."""


class WarmingDamping(Section):
    """Damping that falls as motion warms the oil: a·(1 − share·w), where ẇ = (1 − w)·θ̇²/work and w starts at 0."""

    share: Share
    """Of the damping that is gone when all is warm."""
    work: Positive
    """∫θ̇² dt after which 1/e of the way is left, rad²/s."""


class Effects(Section):
    """Any number at once."""

    dead_time: DeadTime | None = None
    actuator_lag: ActuatorLag | None = None
    rate_limit: RateLimit | None = None
    torque_saturation: TorqueSaturation | None = None
    backlash: Backlash | None = None
    dead_zone: DeadZone | None = None
    coulomb_friction: CoulombFriction | None = None
    quadratic_drag: QuadraticDrag | None = None
    stiffening_spring: StiffeningSpring | None = None
    gravity_geometry: GravityGeometry | None = None
    linkage_geometry: LinkageGeometry | None = None
    constant_torque: ConstantTorque | None = None
    camera_tilt: CameraTilt | None = None
    pivot_offset: PivotOffset | None = None
    lens_distortion: LensDistortion | None = None
    rolling_shutter: RollingShutter | None = None
    clock_scale: ClockScale | None = None
    angle_drift: AngleDrift | None = None
    slack_spring: SlackSpring | None = None
    flexible_appendage: FlexibleAppendage | None = None
    periodic_disturbance: PeriodicDisturbance | None = None
    warming_damping: WarmingDamping | None = None

    @model_validator(mode="after")
    def _one_servo(self) -> Effects:
        limited, linked = self.torque_saturation, self.linkage_geometry
        if limited and linked and limited.share != linked.share:
            raise ValueError("torque_saturation.share and linkage_geometry.share are the same servo's and must agree")
        return self
