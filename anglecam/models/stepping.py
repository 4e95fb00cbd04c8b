"""One step of the nonlinear plant: classical fourth-order Runge-Kutta, with dry friction located as an event.

Dry friction is set-valued at rest. The instant at which the velocity reaches zero is therefore located inside the step.
The load then sticks until the torque on it exceeds the break-away level (Karnopp, J. Dyn. Syst. Meas. Control 107,
1985). Effects with additional states are part of every step, also while the load sticks.

In all functions ``instant`` is (clock, begin): the instant of the last stop, s, and the time since then; ``drive`` is
(segment, lag), see `anglecam.models.drive`; ``plant`` is explained in `anglecam.models.pieces`;
``extra`` is (states, scratch, count): the effects' additional states, memory for `SCRATCH_ROWS` times as many numbers,
and their number. What is written in plural is a pointer to numbers.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from anglecam.effects.ports import shifted
from anglecam.models.drive import drive_at
from anglecam.models.pieces import dry_friction, rates

SCRATCH_ROWS = 7
_MIDDLE, _D1, _D2, _D3, _D4, _STUCK, _NEW = range(SCRATCH_ROWS)
_FREE, _HELD = 0.0, 2.0
"""Directions beside 1 and -1: nothing rubs, and the load sticks, so that only the additional states go on."""


@njit
def _sliding_friction(omega, direction, levels):  # type: ignore[no-untyped-def]  # compiled
    """Return dry friction while sliding, positive against an upward motion (Armstrong-Hélouvry et al. 1994)."""
    level = levels[0] if direction > 0.0 else levels[1]
    if levels[3] > 0.0:
        level += max(levels[2] - level, 0.0) * np.exp(-((omega / levels[3]) ** 2))
    return direction * level


@njit
def _sticks(torque, levels):  # type: ignore[no-untyped-def]  # compiled
    """Return whether dry friction holds the load at rest against a torque."""
    return abs(torque) <= max(levels[2], levels[0] if torque > 0.0 else levels[1])


@njit(forceinline=True)
def _slope(time, theta, omega, states, v, plant, direction, derivatives):  # type: ignore[no-untyped-def]  # compiled
    """Return θ̈ while the load moves in a direction, or sticks; fill the states' derivatives."""
    acceleration, torque = rates(time, theta, omega, states, v, plant, derivatives)
    if direction == _FREE:
        return acceleration
    if direction == _HELD:
        return 0.0
    return acceleration - _sliding_friction(omega, direction, dry_friction(torque, theta, plant))


@njit(forceinline=True)
def _move(states, h, derivatives, count, result):  # type: ignore[no-untyped-def]  # compiled
    """Fill ``result`` with states + h·derivatives."""
    for i in range(count):
        result[i] = states[i] + h * derivatives[i]


@njit
def _runge_kutta(theta, omega, instant, h, drive, plant, direction, extra, row):  # type: ignore[no-untyped-def]
    """Return angle and rate after one step of ``h`` s while the load moves in a direction, or sticks.

    The new additional states fill a row of the scratch memory.
    """
    (clock, begin), (segment, lag), (states, scratch, count) = instant, drive, extra
    v1, v2, v3 = (
        drive_at(begin, segment, lag),
        drive_at(begin + 0.5 * h, segment, lag),
        drive_at(begin + h, segment, lag),
    )
    t1, middle = clock + begin, shifted(scratch, _MIDDLE * count)
    d1, d2 = shifted(scratch, _D1 * count), shifted(scratch, _D2 * count)
    d3, d4 = shifted(scratch, _D3 * count), shifted(scratch, _D4 * count)
    k1 = _slope(t1, theta, omega, states, v1, plant, direction, d1)
    p2, o2 = theta + 0.5 * h * omega, omega + 0.5 * h * k1
    _move(states, 0.5 * h, d1, count, middle)
    k2 = _slope(t1 + 0.5 * h, p2, o2, middle, v2, plant, direction, d2)
    p3, o3 = theta + 0.5 * h * o2, omega + 0.5 * h * k2
    _move(states, 0.5 * h, d2, count, middle)
    k3 = _slope(t1 + 0.5 * h, p3, o3, middle, v2, plant, direction, d3)
    p4, o4 = theta + h * o3, omega + h * k3
    _move(states, h, d3, count, middle)
    k4 = _slope(t1 + h, p4, o4, middle, v3, plant, direction, d4)
    result = shifted(scratch, row * count)
    _move(states, h / 6.0, d1, count, result)
    _move(result, h / 3.0, d2, count, result)
    _move(result, h / 3.0, d3, count, result)
    _move(result, h / 6.0, d4, count, result)
    return theta + h * (omega + 2.0 * o2 + 2.0 * o3 + o4) / 6.0, omega + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0


@njit
def _rest(theta, instant, h, drive, plant, extra):  # type: ignore[no-untyped-def]  # compiled
    """Return the additional states after ``h`` seconds in which the load sticks at ``theta``."""
    _, scratch, count = extra
    if count > 0:
        _runge_kutta(theta, 0.0, instant, h, drive, plant, _HELD, extra, _STUCK)
    return shifted(scratch, _STUCK * count)


@njit
def _keep(extra, row):  # type: ignore[no-untyped-def]  # compiled
    """Make a row of the scratch memory the additional states."""
    states, scratch, count = extra
    for i in range(count):
        states[i] = scratch[row * count + i]


@njit
def _pulled(now, theta, states, clock, drive, plant, extra):  # type: ignore[no-untyped-def]  # compiled
    """Return the torque on the resting load, rad/s², and whether dry friction holds it."""
    (segment, lag), (_, scratch, count) = drive, extra
    v = drive_at(now, segment, lag)
    torque, servo = rates(clock + now, theta, 0.0, states, v, plant, shifted(scratch, _D1 * count))
    return torque, _sticks(torque, dry_friction(servo, theta, plant))


@njit
def advance(theta, omega, instant, h, drive, plant, extra):  # type: ignore[no-untyped-def]  # compiled
    """Advance by ``h`` seconds, through any number of standstills.

    Returns angle (rad) and rate (rad/s), and changes the additional states.
    """
    if plant[4]:
        return _advance_with_friction(theta, omega, instant, h, drive, plant, extra)
    theta, omega = _runge_kutta(theta, omega, instant, h, drive, plant, _FREE, extra, _NEW)
    _keep(extra, _NEW)
    return theta, omega


@njit
def _advance_with_friction(theta, omega, instant, h, drive, plant, extra):  # type: ignore[no-untyped-def]  # compiled
    (clock, begin), states = instant, extra[0]
    left = h
    while left > 0.0:
        now = begin + h - left
        if omega == 0.0:
            # the torque at the end of the step counts too: a rising command may break the load away within the step
            torque, held = _pulled(now, theta, states, clock, drive, plant, extra)
            stuck = _rest(theta, (clock, now), left, drive, plant, extra)
            later, held_later = _pulled(begin + h, theta, stuck, clock, drive, plant, extra)
            if held:
                if held_later:
                    _keep(extra, _STUCK)
                    return theta, 0.0
                low, high = 0.0, left
                for _ in range(40):
                    middle = 0.5 * (low + high)
                    stuck = _rest(theta, (clock, now), middle, drive, plant, extra)
                    if _pulled(now + middle, theta, stuck, clock, drive, plant, extra)[1]:
                        low = middle
                    else:
                        high = middle
                _rest(theta, (clock, now), high, drive, plant, extra)
                _keep(extra, _STUCK)
                left -= high
                now += high
                torque = later
                if left <= 0.0:
                    return theta, 0.0
            direction = np.sign(torque)
        else:
            direction = np.sign(omega)
        new_theta, new_omega = _runge_kutta(theta, omega, (clock, now), left, drive, plant, direction, extra, _NEW)
        if new_omega * direction >= 0.0:
            _keep(extra, _NEW)
            return new_theta, new_omega
        # false position (Illinois) on the step length at which the velocity vanishes
        low, high, f_low, f_high = 0.0, left, omega, new_omega
        if omega == 0.0:  # broke away and turned back within one step: search for the turn after the start
            low = 1e-3 * left
            f_low = _runge_kutta(theta, omega, (clock, now), low, drive, plant, direction, extra, _NEW)[1]
            if f_low * direction <= 0.0:
                _rest(theta, (clock, now), left, drive, plant, extra)
                _keep(extra, _STUCK)
                return theta, 0.0
        middle = high
        for _ in range(30):
            middle = (low * f_high - high * f_low) / (f_high - f_low)
            new_theta, new_omega = _runge_kutta(
                theta, omega, (clock, now), middle, drive, plant, direction, extra, _NEW
            )
            if abs(new_omega) < 1e-12 or high - low < 1e-12:
                break
            if new_omega * direction > 0.0:
                low, f_low = middle, new_omega
                f_high *= 0.5
            else:
                high, f_high = middle, new_omega
                f_low *= 0.5
        theta, omega = new_theta, 0.0
        _keep(extra, _NEW)
        left -= max(middle, 1e-9)
    return theta, omega
