"""The torque and voltage that a neck needs from its servo, compared with what the servo has at its supply."""

from __future__ import annotations

import math
from dataclasses import dataclass

from anglecam.neck.parameters import NeckParameters
from anglecam.neck.servo import torque_speed
from anglecam.neck_design.text import number, rounded
from anglecam.neck_design.units import Angle, Torque, Voltage

SUPPLY = 6.0
"""Supply voltage of the paper's servo, V."""


@dataclass(frozen=True)
class ServoDemand:
    """What the servo needs to hold the head at an angle, and what it has at `SUPPLY`."""

    nod: Angle
    """Δθ at which the head is held."""
    torque_at_shaft: Torque
    """Needed at the servo's shaft: |γ| times the torque at the head."""
    stall_torque: Torque
    """Available at the shaft."""
    motor_voltage: Voltage
    """Needed by the motor: G_a·e = G_a·T/c3 with the T of Eq. (12)."""
    supply: Voltage

    def fact(self) -> tuple[str, str]:
        """Return name and value for a table."""
        needed, stall = rounded(self.torque_at_shaft), rounded(self.stall_torque)
        return (
            f"servo torque at {number(math.degrees(self.nod), 0)}° (shaft)",
            f"{number(needed, 3)} N·m of {number(stall, 3)} N·m at stall: {'exceeded' if needed > stall else 'holds'}",
        )

    def notes(self) -> tuple[str, ...]:
        """Return a line where the servo lacks torque and a line where its amplifier saturates."""
        notes = []
        if self.torque_at_shaft > self.stall_torque:
            notes.append(
                f"the servo's stall torque is exceeded: {self.torque_at_shaft:.3g} N·m at the shaft to hold "
                f"{math.degrees(self.nod):.0f}°, of {self.stall_torque:.3g} N·m at {self.supply:g} V"
            )
        return (*notes, *saturation_notes(self.motor_voltage, "to hold the head there by Eq. (12)"))


def servo_demand(neck: NeckParameters, nod: float, torque_at_shaft: float, torque_at_head: float) -> ServoDemand:
    """Compare the torque that a neck needs from its servo with what the servo has at `SUPPLY`.

    Parameters
    ----------
    neck : NeckParameters
        With the servo.
    nod : float
        Δθ at which the head is held, rad.
    torque_at_shaft : float
        Needed at the servo's shaft, N·m.
    torque_at_head : float
        T of Eq. (12) at the head, N·m, from which the motor's voltage follows.

    Returns
    -------
    ServoDemand
        Both sides of the comparison.
    """
    servo = neck.servo
    return ServoDemand(
        nod=nod,
        torque_at_shaft=float(torque_at_shaft),
        stall_torque=torque_speed(servo, SUPPLY / servo.amplifier_gain).stall_torque,
        motor_voltage=float(torque_at_head) * servo.amplifier_gain / servo.torque_gain,
        supply=SUPPLY,
    )


def saturation_notes(voltage: float, when: str) -> tuple[str, ...]:
    """Return a line if the motor needs more than `SUPPLY`, V; nothing otherwise."""
    if not abs(voltage) > SUPPLY:
        return ()
    return (f"the motor saturates: amplifier gain × error asks {abs(voltage):.3g} V of {SUPPLY:g} V {when}",)
