"""One step of the nonlinear plant: classical fourth-order Runge-Kutta, with dry friction located as an event.

Dry friction is set-valued at rest. The instant at which the velocity reaches zero is therefore located inside the step.
The load then sticks until the torque on it exceeds the break-away level (Karnopp, J. Dyn. Syst. Meas. Control 107,
1985). Effects with additional states are part of every step, also while the load sticks.

In all functions ``extra`` is the tuple of the effects' additional states, empty if no effect of the ledger has any;
``clock`` is the instant of the last stop, s, and ``begin`` the time since then.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from anglecam.models.drive import drive_at


@njit
def _sliding_friction(omega, direction, friction):  # type: ignore[no-untyped-def]  # compiled
    """Return dry friction while sliding, positive against an upward motion (Armstrong-Hélouvry et al. 1994)."""
    level = friction[0] if direction > 0.0 else friction[1]
    if friction[3] > 0.0:
        level += max(friction[2] - level, 0.0) * np.exp(-((omega / friction[3]) ** 2))
    return direction * level


@njit
def _sticks(torque, friction):  # type: ignore[no-untyped-def]  # compiled
    """Return whether dry friction holds the load at rest against a torque."""
    return abs(torque) <= max(friction[2], friction[0] if torque > 0.0 else friction[1])


def compile_advance(effects):  # type: ignore[no-untyped-def]  # compiled
    """Return the compiled step of a ledger's equation of motion.

    Numba cannot cache a function that gets other compiled functions as arguments, so it is built around them.

    Parameters
    ----------
    effects : CompiledEffects
        From `anglecam.models.compiled_effects.compile_effects`.

    Returns
    -------
    compiled function
        (θ, ω, extra, clock, begin, h, segment, lag, abc, rows) → θ, ω and extra after ``h`` seconds.
    """
    rates, friction, moved = effects.rates, effects.friction, effects.moved

    @njit(forceinline=True)
    def sliding(torque, theta, omega, direction, abc, rows):  # type: ignore[no-untyped-def]  # compiled
        """Return dry friction while the load slides in one direction; 0 where nothing rubs."""
        if direction == 0.0:
            return 0.0
        return _sliding_friction(omega, direction, friction(torque, theta, abc, rows))

    @njit(forceinline=True)
    def pulled(now, theta, extra, clock, segment, lag, abc, rows):  # type: ignore[no-untyped-def]  # compiled
        """Return the torque on the resting load, and whether dry friction holds it."""
        torque, servo, _ = rates(clock + now, theta, 0.0, extra, drive_at(now, segment, lag), abc, rows)
        return torque, _sticks(torque, friction(servo, theta, abc, rows))

    @njit(forceinline=True)
    def runge_kutta(theta, omega, extra, clock, begin, h, segment, lag, abc, rows, direction):  # type: ignore[no-untyped-def]
        """Advance by one step of ``h`` seconds while the load slides in one direction."""
        v1, v2, v3 = (
            drive_at(begin, segment, lag),
            drive_at(begin + 0.5 * h, segment, lag),
            drive_at(begin + h, segment, lag),
        )
        t1 = clock + begin
        a1, q1, d1 = rates(t1, theta, omega, extra, v1, abc, rows)
        k1 = a1 - sliding(q1, theta, omega, direction, abc, rows)
        p2, o2 = theta + 0.5 * h * omega, omega + 0.5 * h * k1
        a2, q2, d2 = rates(t1 + 0.5 * h, p2, o2, moved(extra, 0.5 * h, d1), v2, abc, rows)
        k2 = a2 - sliding(q2, p2, o2, direction, abc, rows)
        p3, o3 = theta + 0.5 * h * o2, omega + 0.5 * h * k2
        a3, q3, d3 = rates(t1 + 0.5 * h, p3, o3, moved(extra, 0.5 * h, d2), v2, abc, rows)
        k3 = a3 - sliding(q3, p3, o3, direction, abc, rows)
        p4, o4 = theta + h * o3, omega + h * k3
        a4, q4, d4 = rates(t1 + h, p4, o4, moved(extra, h, d3), v3, abc, rows)
        k4 = a4 - sliding(q4, p4, o4, direction, abc, rows)
        new_theta = theta + h * (omega + 2.0 * o2 + 2.0 * o3 + o4) / 6.0
        new_omega = omega + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
        return (
            new_theta,
            new_omega,
            moved(moved(moved(moved(extra, h / 6.0, d1), h / 3.0, d2), h / 3.0, d3), h / 6.0, d4),
        )

    @njit(forceinline=True)
    def at_rest(theta, extra, clock, begin, h, segment, lag, abc, rows):  # type: ignore[no-untyped-def]  # compiled
        """Advance only the effects' additional states by ``h`` seconds while the load sticks at ``theta``."""
        if len(extra) == 0:
            return extra
        v1, v2, v3 = (
            drive_at(begin, segment, lag),
            drive_at(begin + 0.5 * h, segment, lag),
            drive_at(begin + h, segment, lag),
        )
        t1 = clock + begin
        d1 = rates(t1, theta, 0.0, extra, v1, abc, rows)[2]
        d2 = rates(t1 + 0.5 * h, theta, 0.0, moved(extra, 0.5 * h, d1), v2, abc, rows)[2]
        d3 = rates(t1 + 0.5 * h, theta, 0.0, moved(extra, 0.5 * h, d2), v2, abc, rows)[2]
        d4 = rates(t1 + h, theta, 0.0, moved(extra, h, d3), v3, abc, rows)[2]
        return moved(moved(moved(moved(extra, h / 6.0, d1), h / 3.0, d2), h / 3.0, d3), h / 6.0, d4)

    @njit(forceinline=True)
    def advance(theta, omega, extra, clock, begin, h, segment, lag, abc, rows):  # type: ignore[no-untyped-def]
        """Advance by ``h`` seconds, through any number of standstills.

        Returns angle (rad), rate (rad/s) and additional states.
        """
        if not rows[6]:
            return runge_kutta(theta, omega, extra, clock, begin, h, segment, lag, abc, rows, 0.0)
        left = h
        while left > 0.0:
            now = begin + h - left
            if omega == 0.0:
                # the torque at the end of the step counts too: a rising command may break the load away within the step
                torque, held = pulled(now, theta, extra, clock, segment, lag, abc, rows)
                stuck = at_rest(theta, extra, clock, now, left, segment, lag, abc, rows)
                later, held_later = pulled(begin + h, theta, stuck, clock, segment, lag, abc, rows)
                if held:
                    if held_later:
                        return theta, 0.0, stuck
                    low, high = 0.0, left
                    for _ in range(40):
                        middle = 0.5 * (low + high)
                        stuck = at_rest(theta, extra, clock, now, middle, segment, lag, abc, rows)
                        if pulled(now + middle, theta, stuck, clock, segment, lag, abc, rows)[1]:
                            low = middle
                        else:
                            high = middle
                    extra = at_rest(theta, extra, clock, now, high, segment, lag, abc, rows)
                    left -= high
                    now += high
                    torque = later
                    if left <= 0.0:
                        return theta, 0.0, extra
                direction = np.sign(torque)
            else:
                direction = np.sign(omega)
            new_theta, new_omega, new_extra = runge_kutta(
                theta, omega, extra, clock, now, left, segment, lag, abc, rows, direction
            )
            if new_omega * direction >= 0.0:
                return new_theta, new_omega, new_extra
            # false position (Illinois) on the step length at which the velocity vanishes
            low, high, f_low, f_high = 0.0, left, omega, new_omega
            if omega == 0.0:  # broke away and turned back within one step: search for the turn after the start
                low = 1e-3 * left
                f_low = runge_kutta(theta, omega, extra, clock, now, low, segment, lag, abc, rows, direction)[1]
                if f_low * direction <= 0.0:
                    return theta, 0.0, at_rest(theta, extra, clock, now, left, segment, lag, abc, rows)
            middle = high
            for _ in range(30):
                middle = (low * f_high - high * f_low) / (f_high - f_low)
                new_theta, new_omega, new_extra = runge_kutta(
                    theta, omega, extra, clock, now, middle, segment, lag, abc, rows, direction
                )
                if abs(new_omega) < 1e-12 or high - low < 1e-12:
                    break
                if new_omega * direction > 0.0:
                    low, f_low = middle, new_omega
                    f_high *= 0.5
                else:
                    high, f_high = middle, new_omega
                    f_low *= 0.5
            theta, omega, extra = new_theta, 0.0, new_extra
            left -= max(middle, 1e-9)
        return theta, omega, extra

    return advance
