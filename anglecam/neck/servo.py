"""The RC servo of Fig. 5, block by block: Eqs. (5)-(12).

    e = U_in − h·θ_a                                                                                     Eq. (5)
    E_m = e·G_a − R_a·I_m                                                                                Eq. (6)
    E_m = K_m·ω_m,   T_m = K_m·I_m,   T_m = G_g·T_g,   T_g = J_r·θ̈_a + T                                 Eqs. (7)-(10)
    c3·U_in = J_r·θ̈_a + K_m²/(G_g²·R_a)·θ̇_a + c3·h·θ_a + T,   c3 = K_m·G_a/(G_g·R_a)                     Eq. (11)
    T = c3·U_in − γ·(J_r·Δθ̈ + K_m²/(G_g²·R_a)·Δθ̇ + c3·h·Δθ)                                             Eq. (12)

Eq. (10) states ω_m = θ̇_a, but then the motor's damping in Eq. (11) would contain G_g instead of G_g². Eq. (11) follows
with ω_m = θ̇_a/G_g, which also holds for a lossless gear whose torques obey Eq. (9), and is used here. Eqs. (11) and
(12) agree in every sign. Eq. (12) applies the torque of the gear to the head unchanged; the factor 1/γ that virtual
work gives is not in the paper (see `anglecam.neck.linear` on γ). J_r is added on the gear side without reflection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats
from anglecam.neck.parameters import ServoParameters


@dataclass(frozen=True)
class TorqueSpeed:
    """The straight line of torque over speed of a servo at a constant error signal."""

    stall_torque: float
    """At standstill, N·m."""
    no_load_speed: float
    """Speed of the servo's arm without load, rad/s."""

    def torque(self, omega_a: ArrayLike) -> Floats:
        """Return the torque, N·m, at a speed of the servo's arm, rad/s."""
        return np.asarray(self.stall_torque * (1.0 - np.asarray(omega_a, dtype=float) / self.no_load_speed))


def error_signal(servo: ServoParameters, voltage: ArrayLike, theta_a: ArrayLike) -> Floats:
    """Return the error between input and potentiometer, Eq. (5).

    Parameters
    ----------
    servo : ServoParameters
        With the sensor gain h.
    voltage : array_like
        U_in, V.
    theta_a : array_like
        Angle of the servo's arm from neutral, rad.

    Returns
    -------
    ndarray
        e, V.
    """
    return np.asarray(np.asarray(voltage, dtype=float) - servo.sensor_gain * np.asarray(theta_a, dtype=float))


def motor_speed(servo: ServoParameters, omega_a: ArrayLike) -> Floats:
    """Return the speed of the motor, rad/s, at a speed of the servo's arm, rad/s: ω_m = θ̇_a/G_g, see Eq. (10) above."""
    return np.asarray(np.asarray(omega_a, dtype=float) / servo.gear_ratio)


def back_emf(servo: ServoParameters, omega_m: ArrayLike) -> Floats:
    """Return the back electromotive force of the motor, V, at its speed, rad/s, Eq. (7)."""
    return np.asarray(servo.motor_constant * np.asarray(omega_m, dtype=float))


def motor_current(servo: ServoParameters, error: ArrayLike, omega_m: ArrayLike) -> Floats:
    """Return the motor current, Eqs. (6)-(7): I_m = (G_a·e − K_m·ω_m)/R_a.

    Parameters
    ----------
    servo : ServoParameters
        Motor and amplifier, without inductance and without a voltage limit, as in the paper.
    error : array_like
        e, V.
    omega_m : array_like
        Speed of the motor, rad/s.

    Returns
    -------
    ndarray
        I_m, A.
    """
    amplified = servo.amplifier_gain * np.asarray(error, dtype=float)
    return np.asarray((amplified - back_emf(servo, omega_m)) / servo.output_impedance)


def gear_torque(servo: ServoParameters, current: ArrayLike) -> Floats:
    """Return the torque after the gear, N·m, at a motor current, A, Eqs. (8)-(9): T_g = K_m·I_m/G_g."""
    return np.asarray(servo.motor_constant * np.asarray(current, dtype=float) / servo.gear_ratio)


def servo_torque(
    servo: ServoParameters, voltage: ArrayLike, theta_a: ArrayLike, omega_a: ArrayLike, alpha_a: ArrayLike = 0.0
) -> Floats:
    """Return the torque of the servo from the motion of its arm, Eq. (11) solved for T.

    Parameters
    ----------
    servo : ServoParameters
        Motor, amplifier, gear and sensor.
    voltage : array_like
        U_in, V.
    theta_a, omega_a, alpha_a : array_like
        Angle (rad), speed (rad/s) and acceleration (rad/s²) of the servo's arm from neutral.

    Returns
    -------
    ndarray
        T, N·m.
    """
    error = error_signal(servo, voltage, theta_a)
    current = motor_current(servo, error, motor_speed(servo, omega_a))
    return np.asarray(gear_torque(servo, current) - servo.rotor_inertia * np.asarray(alpha_a, dtype=float))


def drive_torque(
    servo: ServoParameters, gamma: float, voltage: ArrayLike, delta: ArrayLike, omega: ArrayLike, alpha: ArrayLike = 0.0
) -> Floats:
    """Return the torque on the head from the motion of the head, Eq. (12).

    Parameters
    ----------
    servo : ServoParameters
        Motor, amplifier, gear and sensor.
    gamma : float
        γ of Eq. (3), θ_a = γ·Δθ.
    voltage : array_like
        U_in, V.
    delta, omega, alpha : array_like
        Angle from neutral (rad), speed (rad/s) and acceleration (rad/s²) of the head.

    Returns
    -------
    ndarray
        T, N·m.
    """
    arm = (gamma * np.asarray(motion, dtype=float) for motion in (delta, omega, alpha))
    return servo_torque(servo, voltage, *arm)


def torque_speed(servo: ServoParameters, error: float) -> TorqueSpeed:
    """Return the torque-speed line at a constant error, Eqs. (6)-(9).

    Parameters
    ----------
    servo : ServoParameters
        Motor, amplifier and gear.
    error : float
        e, V. The motor gets G_a·e, so a supply of 6 V corresponds to e = 6 V/G_a.

    Returns
    -------
    TorqueSpeed
        Stall torque c3·e and no-load speed G_a·G_g·e/K_m.
    """
    speed = servo.amplifier_gain * servo.gear_ratio * error / servo.motor_constant
    return TorqueSpeed(stall_torque=servo.torque_gain * error, no_load_speed=speed)
