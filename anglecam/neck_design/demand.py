"""What a neck asks of its servo, held against what the servo has at its supply; keys end in their unit."""

from __future__ import annotations

import math
from typing import Any

from anglecam.neck.parameters import NeckParameters
from anglecam.neck.servo import torque_speed

Numbers = dict[str, Any]

SUPPLY = 6.0
"""V that the paper's servo is driven with."""


def demand_numbers(neck: NeckParameters, nod: float, at_shaft: float, at_head: float) -> Numbers:
    """Hold what the servo is asked for against what it has at `SUPPLY`.

    Parameters
    ----------
    neck : NeckParameters
        Its servo.
    nod : float
        At which the torque is asked, rad.
    at_shaft : float
        Torque at the servo's shaft, |γ| of that at the head, N·m.
    at_head : float
        Torque that Eq. (12) takes from the servo, N·m: the motor's voltage follows from it, G_a·e = G_a·T/c3.

    Returns
    -------
    dict
        Keys end in their unit.
    """
    servo = neck.servo
    return {
        "nod_deg": math.degrees(nod),
        "torque_at_shaft_N_m": float(at_shaft),
        "stall_torque_N_m": torque_speed(servo, SUPPLY / servo.amplifier_gain).stall_torque,
        "motor_voltage_V": float(at_head) * servo.amplifier_gain / servo.torque_gain,
        "supply_V": SUPPLY,
    }


def demand_notes(demand: Numbers) -> list[str]:
    """Say in a line each where the servo lacks torque and where its amplifier saturates."""
    asked, stall, supply = demand["torque_at_shaft_N_m"], demand["stall_torque_N_m"], demand["supply_V"]
    told = []
    if asked > stall:
        told.append(
            f"the servo's stall torque is exceeded: {asked:.3g} N·m at the shaft to hold {demand['nod_deg']:.0f}°, of "
            f"{stall:.3g} N·m at {supply:g} V"
        )
    return told + saturation_notes(demand["motor_voltage_V"], "to hold the head there by Eq. (12)")


def saturation_notes(voltage: float, when: str) -> list[str]:
    """Say in a line that the motor is asked for more than `SUPPLY`, V; nothing where it is not."""
    if not abs(voltage) > SUPPLY:
        return []
    return [f"the motor saturates: amplifier gain × error asks {abs(voltage):.3g} V of {SUPPLY:g} V {when}"]
