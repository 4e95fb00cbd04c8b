"""The neck at large angles, Eq. (31), as a model that output error can fit in physical parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numba import njit

from anglecam.data.camera_evidence import UNKNOWN_VIEW, View
from anglecam.data.command import NO_COMMAND, Command
from anglecam.data.typing import Floats
from anglecam.neck.large_angle import LargeAngleNeck, linearise, restoring_tangent, restoring_torque

MAX_STEP = 0.004
"""Longest Runge-Kutta step, s; see `anglecam.models.plant.MAX_STEP`."""
NODES = 512
"""Number of angles at which torque and tangent are tabulated. The error of the cubic between them is below 2e-7 N·m,
and within 1° of a linkage's toggle below 2e-5 N·m."""


@njit
def _accelerate(theta, omega, drive, low, step, torque, tangent, gamma, constants):  # type: ignore[no-untyped-def]
    """Return θ̈ of Eq. (31), with everything that depends on the angle alone interpolated from tables."""
    place = (theta - low) / step
    if not 0.0 <= place < len(torque) - 1:
        return np.nan
    k = int(place)
    s = place - k
    r = 1.0 - s
    back = r * r * ((1.0 + 2.0 * s) * torque[k] + s * step * tangent[k])
    back += s * s * ((1.0 + 2.0 * r) * torque[k + 1] - r * step * tangent[k + 1])
    ratio = r * gamma[k] + s * gamma[k + 1]
    curve = (gamma[k + 1] - gamma[k]) / step
    inertia, rotor, viscous, motor = constants
    moving = (viscous + motor * ratio + rotor * curve * omega) * omega
    return (drive - back - moving) / (inertia + rotor * ratio)


@njit(
    "float64[:, ::1](float64[::1], float64, float64, float64[::1], float64[::1], float64, float64,"
    " float64[::1], float64[::1], float64[::1], UniTuple(float64, 4), float64)",
    cache=True,
)
def _integrate(time, theta, omega, switches, drives, low, step, torque, tangent, gamma, constants, max_step):  # type: ignore[no-untyped-def]
    """Integrate by fourth-order Runge-Kutta from stop to stop: the requested instants and the command's switches."""
    states = np.empty((len(time), 2))
    states[0] = theta, omega
    k, m, now = 0, len(switches), time[0]
    while k + 1 < m and switches[k + 1] <= now:
        k += 1
    for i in range(1, len(time)):
        while now < time[i]:
            stop = time[i]
            if k + 1 < m and switches[k + 1] < stop:
                stop = switches[k + 1]
            steps = max(1, int(np.ceil((stop - now) / max_step)))
            h = (stop - now) / steps
            u = drives[k]
            for _ in range(steps):
                k1 = _accelerate(theta, omega, u, low, step, torque, tangent, gamma, constants)
                v2 = omega + 0.5 * h * k1
                k2 = _accelerate(theta + 0.5 * h * omega, v2, u, low, step, torque, tangent, gamma, constants)
                v3 = omega + 0.5 * h * k2
                k3 = _accelerate(theta + 0.5 * h * v2, v3, u, low, step, torque, tangent, gamma, constants)
                v4 = omega + h * k3
                k4 = _accelerate(theta + h * v3, v4, u, low, step, torque, tangent, gamma, constants)
                theta += h * (omega + 2.0 * v2 + 2.0 * v3 + v4) / 6.0
                omega += h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
            now = stop
            while k + 1 < m and switches[k + 1] <= now:
                k += 1
        states[i] = theta, omega
    return states


@dataclass(frozen=True)
class Quantity:
    """A quantity of the neck that can be estimated."""

    name: str
    """Name in result files; it ends in the unit used there."""
    lower: float
    """Lower bound, SI."""
    upper: float
    """Upper bound, SI; stiffness and damping below the integrator's limit of stability."""
    scale: float
    """Magnitude, SI, that scales the step of a difference quotient."""
    to_file: float = 1.0
    """Factor from SI to the unit in ``name``."""


QUANTITIES = (
    Quantity("damping_nms", 0.0, 3.0, 0.01),
    Quantity("torque_gain_nm_per_v", 1e-3, 1e3, 0.1),
    Quantity("sensor_gain_v_per_rad", 0.0, 100.0, 0.1),
    Quantity("spring_rate_n_per_m", 1.0, 5e5, 100.0),
    Quantity("pretension_error_nm", -5.0, 5.0, 0.05),
    Quantity("neutral_deg", -math.pi / 2, math.pi / 2, 0.1, math.degrees(1.0)),
    Quantity("common_stretch_m", 0.0, 0.2, 0.01),
)
"""C; c3; h; K; excess of the springs' torque at neutral; θ0; common stretch of two springs."""
DEFAULT = ("damping_nms", "torque_gain_nm_per_v", "sensor_gain_v_per_rad", "spring_rate_n_per_m")
FREE_SWING = ("damping_nms", "spring_rate_n_per_m")
"""Quantities that a swing without a command determines. c3 and h enter only as their product, which acts as K does
except for curvature."""


@dataclass(frozen=True)
class LargeAngle:
    """Eq. (31) with some of its quantities free and the others known.

    Everything in Eq. (31) can be divided by the inertia, so mass, L and J_cg are taken as known, and the command
    determines only the product of c3 and C_i. The rotor's inertia and damping are too small to be identified. The
    singular values of the Jacobian decide which of the other quantities can be free. The table gives them for relative
    changes divided by σ, for five recordings of 8 s at 30 Hz with σ = 0.2° and unknown zeros: steps, chirps and
    triangles between −21° and 28° on the paper's neck with the exact linkage and two springs.

    ===================== ====================== =============================================================
    free                  singular values        relative uncertainty
    ===================== ====================== =============================================================
    C, c3, h, K           4200, 730, 200, 57     0.35 %, 0.30 %, 1.7 %, 0.6 %
    the same up to ±5°    920, 150, 41, 1.4      1.7 %, 1.5 %, 69 %, 23 %
    and with constant γ   780, 140, 38, 0.1      1.9 %, 1.6 %, 840 %, 233 %
    C, c3, h, K, excess   4200, 730, 205, 150, … 0.36 %, 0.31 %, 1.7 %, 0.6 %, 0.7 % of the weight's moment
    C, c3, h, K, θ0       4200, 730, 200, 60, 15 0.36 %, 0.31 %, 2.2 %, 1.3 %, 6 %
    C, c3, h, K, stretch  4200, 730, 240, 190, … 0.35 %, 0.30 %, 8.5 %, 2.8 %, 2.3 %
    ===================== ====================== =============================================================

    At small angles only a, b and c are identifiable, Eq. (28), and h and K act as one quantity. Only the curvature of
    spring, linkage and weight separates them. The first row is therefore the `DEFAULT`. Where the head stays within a
    few degrees, or γ is taken as constant, leave out h or K.

    The quantities that are held fixed must be right at large angles. On the same neck a constant γ leaves 0.45° RMS,
    with h at its bound, where the linear model leaves 0.24°. The paper's single spring, which holds nothing below −21°,
    diverges from every start, and the fit's cost is then infinite.
    """

    neck: LargeAngleNeck = field(default_factory=LargeAngleNeck)
    """Values of the fixed quantities, and starting values of the free ones."""
    free: tuple[str, ...] = DEFAULT
    """Names of the free quantities, from `QUANTITIES`."""

    states = 2
    """Unknown initial states of a recording: angle (rad) and rate (rad/s)."""

    def __post_init__(self) -> None:
        known = [q.name for q in QUANTITIES]
        for name in self.free:
            if name not in known:
                raise ValueError(f"no quantity {name!r}; choose from {', '.join(known)}")
        if "common_stretch_m" in self.free and self.neck.common_stretch is None:
            raise ValueError("common_stretch_m: a neck with one spring has none")

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters in their order, as result files name them."""
        return self.free

    @property
    def lower(self) -> Floats:
        """Lower bounds, SI."""
        return np.array([q.lower for q in self._quantities])

    @property
    def upper(self) -> Floats:
        """Upper bounds, SI."""
        return np.array([q.upper for q in self._quantities])

    @property
    def scales(self) -> Floats:
        """Magnitudes, SI, that scale the steps of difference quotients."""
        return np.array([q.scale for q in self._quantities])

    @property
    def to_file(self) -> Floats:
        """Factors from SI to the units in `names`."""
        return np.array([q.to_file for q in self._quantities])

    @property
    def nominal(self) -> Floats:
        """The free quantities at the values of `neck`, SI."""
        p = self.neck.parameters
        values = {
            "damping_nms": p.damping,
            "torque_gain_nm_per_v": p.servo.torque_gain,
            "sensor_gain_v_per_rad": p.servo.sensor_gain,
            "spring_rate_n_per_m": p.spring.rate,
            "pretension_error_nm": self.neck.pretension_error,
            "neutral_deg": p.head.neutral,
            "common_stretch_m": self.neck.common_stretch or 0.0,
        }
        return np.array([values[name] for name in self.free])

    def starts(self, abc: Floats) -> list[Floats]:
        """Return starting values of a fit from a linear model of the same recordings.

        Parameters
        ----------
        abc : (3,) ndarray
            a (1/s), b (1/s²) and c (1/s²) of Eq. (30), of small angles; command and angle are both of the head.

        Returns
        -------
        list of (p,) ndarray
            SI, in the order of `names`. Eq. (33) at neutral is solved for C and c3. As b alone does not separate h
            from K, it is solved once for h with K of `neck` and once for K with h of `neck`; `nominal` comes last.
        """
        a, b, c = abc
        near, servo = linearise(self.neck), self.neck.parameters.servo
        gamma, spring = float(self.neck.ratio.slope(0.0)), self.neck.parameters.spring
        gain = c * near.psi / servo.command_gain
        stiffness = b * near.psi - near.eta + servo.torque_gain * servo.sensor_gain * gamma  # of the feedback
        rate = spring.rate + (stiffness - gain * servo.sensor_gain * gamma) / (spring.base * spring.arm)
        found = {
            "damping_nms": a * near.psi - servo.back_emf_damping * gamma,
            "torque_gain_nm_per_v": gain,
        }
        known = dict(zip(self.free, self.nominal, strict=True)) | found
        guesses = [known | {"sensor_gain_v_per_rad": stiffness / (gain * gamma)}, known | {"spring_rate_n_per_m": rate}]
        values = [[guess[name] for name in self.free] for guess in guesses]
        return [np.clip(value, self.lower, self.upper) for value in values] + [self.nominal]

    def neck_at(self, parameters: Floats) -> LargeAngleNeck:
        """Return the neck with the given parameters, SI, in the order of `names`."""
        value = dict(zip(self.free, (float(v) for v in parameters), strict=True))
        p, servo = self.neck.parameters, self.neck.parameters.servo
        # c3 is set through the amplifier gain, which appears nowhere else in Eq. (31)
        amplifier = value.get("torque_gain_nm_per_v", servo.torque_gain) / servo.torque_gain * servo.amplifier_gain
        whole = replace(
            p,
            servo=replace(
                servo,
                amplifier_gain=amplifier,
                sensor_gain=value.get("sensor_gain_v_per_rad", servo.sensor_gain),
            ),
            head=replace(p.head, neutral=value.get("neutral_deg", p.head.neutral)),
            spring=replace(p.spring, rate=value.get("spring_rate_n_per_m", p.spring.rate)),
            damping=value.get("damping_nms", p.damping),
        )
        return replace(
            self.neck,
            parameters=whole,
            common_stretch=value.get("common_stretch_m", self.neck.common_stretch),
            pretension_error=value.get("pretension_error_nm", self.neck.pretension_error),
        )

    def predict(
        self, parameters: Floats, time: Floats, command: Command | None, state: Floats, view: View = UNKNOWN_VIEW
    ) -> Floats:
        """Return the (n,) angle, rad, of `run`."""
        return self.run(parameters, time, command, state)[:, 0]

    def run(self, parameters: Floats, time: Floats, command: Command | None, state: Floats) -> Floats:
        """Run the neck freely from an initial state; see `anglecam.models.plant.Plant.run`.

        The command, rad, becomes the input voltage C_i·command, Eq. (29). From the instant at which the head would
        leave the reach of its linkage, angle and rate are not finite.
        """
        neck, nodes = self.neck_at(parameters), self._nodes
        p = neck.parameters
        held = NO_COMMAND if command is None else command.held()
        constants = (p.head.inertia, p.servo.rotor_inertia, p.damping, p.servo.back_emf_damping)
        return _integrate(
            np.ascontiguousarray(time),
            float(state[0]),
            float(state[1]),
            np.ascontiguousarray(held.time),
            p.servo.torque_gain * p.servo.command_gain * np.ascontiguousarray(held.angle),
            nodes[0],
            nodes[1] - nodes[0],
            restoring_torque(neck, nodes),
            restoring_tangent(neck, nodes),
            self._slope,
            constants,
            MAX_STEP,
        )

    @cached_property
    def _nodes(self) -> Floats:
        low, high = self.neck.ratio.reach
        return np.linspace(low, high, NODES)

    @cached_property
    def _slope(self) -> Floats:
        return self.neck.ratio.slope(self._nodes)

    @property
    def _quantities(self) -> list[Quantity]:
        table = {q.name: q for q in QUANTITIES}
        return [table[name] for name in self.free]
