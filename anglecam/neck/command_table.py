"""Table 3: convert between the 8-bit command, the servo angle and the head angle.

The paper describes the command in four places, which do not agree:

- Table 3 sends an "unsigned 8-bit" 127 for fully up, 0 for neutral and 125 for fully down. Unsigned
  numbers cannot mean that: up and down would be two counts apart, with neutral far from both. The column "servo status"
  (maximum, neutral, minimum) supplies the missing sign: 127 and 125 are counts from neutral, to either side.
- In the text the command runs over 0-254 with neutral at 0. Over that range neutral is the middle, 127: up is then
  127 + 127 = 254, the top, and down 127 − 125 = 2. A Pololu controller, Table 2, uses this range in its Mini SSC II
  mode, where 255 opens a message and cannot be a position. The 0 of the text is again a count from neutral.
- In Fig. 13 the range 0-255 turns the servo's arm by 180°, 0.71° per count, and the step starts at 127. θ_a of Table 3
  is 81° for 127 counts and −73° for 125: 0.64° per count upwards and 0.58° downwards. At the rate of Fig. 13, 125
  counts would turn the crank to 47°, 11° past its dead centre at 57.5°, where the head has turned back.
- Table 2 resolves 1 µs, "about 0.1°". Mini SSC II spreads 0-254 over 500-2500 µs, 7.9 µs or about 0.7° per count,
  which agrees with Fig. 13.

Here a command is a byte from 0 to 254 with neutral in the middle, and a scale gives the servo angle per count.
`TABLE_3`, the default, follows the rows of the table, with one rate for each direction; `FIGURE_13` has the single rate
of Fig. 13. Neither is a calibration of a particular servo: pass measured rates where they are known.

At neutral the crank is at 135° and θ_f = 46.8°; the paper rounds it to 45° and its extremes to 20° and 70°.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats, Integers
from anglecam.neck.fourbar import NEUTRAL_SERVO, FourBar, head_angle, servo_angle
from anglecam.neck.transmission import limits, slope, straight_line

HIGHEST = 254
"""Largest command; 255 opens a message."""
MIDDLE = 127
"""Command at neutral."""

STRAIGHT = (math.radians(60.0), math.radians(220.0))
"""Range of θ_s over which the straight line of Fig. 4 is fitted, rad."""


@dataclass(frozen=True)
class CommandScale:
    """Servo angle per count of the command; the defaults are those of Table 3."""

    neutral: float = NEUTRAL_SERVO
    """θ_s at the middle command, rad."""
    up: float = math.radians(81.0) / 127
    """Servo angle per count above the middle, rad."""
    down: float = math.radians(73.0) / 125
    """Servo angle per count below the middle, rad."""


TABLE_3 = CommandScale()
"""127 counts for +81°, 125 counts for −73°."""
FIGURE_13 = CommandScale(up=math.pi / 255, down=math.pi / 255)
"""255 counts turn the servo's arm by 180°."""


@dataclass(frozen=True)
class NeckPosition:
    """A row of Table 3, computed from its command."""

    position: Literal["upward", "neutral", "down"]
    counts: int
    """Counts from neutral, as printed but signed."""
    command: int
    """Byte that is sent, 0 to 254."""
    theta_s: float
    """Servo angle, rad."""
    theta_a: float
    """Servo angle from neutral, rad."""
    theta_f: float
    """Head angle, exact, rad."""
    nod: float
    """Δθ, head angle from neutral, upward positive, exact, rad."""
    theta_f_line: float
    """Head angle from the straight line of Fig. 4, rad."""
    nod_line: float
    """Δθ from that line, rad."""


def servo_of_command(command: ArrayLike, scale: CommandScale = TABLE_3) -> Floats:
    """Return the servo angle of a command.

    Parameters
    ----------
    command : array_like of int
        0 to 254.
    scale : CommandScale
        Servo angle per count.

    Returns
    -------
    ndarray
        θ_s, rad.

    Raises
    ------
    ValueError
        If a command is not a whole number from 0 to 254.
    """
    sent = np.asarray(command, dtype=float)
    wrong = ~((sent >= 0) & (sent <= HIGHEST) & (sent == np.round(sent)))
    if np.any(wrong):
        raise ValueError(f"command {sent[wrong].flat[0]:g} is not a whole number from 0 to {HIGHEST}")
    counts = sent - MIDDLE
    return np.asarray(scale.neutral + counts * np.where(counts < 0, scale.down, scale.up))


def command_of_servo(theta_s: ArrayLike, scale: CommandScale = TABLE_3) -> Integers:
    """Return the command nearest to a servo angle.

    Parameters
    ----------
    theta_s : array_like
        Servo angle, rad.
    scale : CommandScale
        Servo angle per count.

    Returns
    -------
    ndarray of int
        0 to 254.

    Raises
    ------
    ValueError
        If an angle is more than half a count beyond those of commands 0 and 254.
    """
    servo = np.asarray(theta_s, dtype=float)
    away = servo - scale.neutral
    command = MIDDLE + np.round(away / np.where(away < 0, scale.down, scale.up))
    beyond = ~((command >= 0) & (command <= HIGHEST))
    if np.any(beyond):
        low, high = np.degrees(servo_of_command([0, HIGHEST], scale))
        wanted = math.degrees(servo[beyond].flat[0])
        raise ValueError(f"servo angle {wanted:.1f}° is beyond the commands' {low:.1f}° to {high:.1f}°")
    return np.asarray(command.astype(np.int64))


def nod_limits(linkage: FourBar, scale: CommandScale = TABLE_3) -> tuple[float, float]:
    """Return the lowest and highest nod that commands reach without passing a dead centre of the crank.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    scale : CommandScale
        Servo angle per count.

    Returns
    -------
    tuple of float
        Δθ from neutral, upward positive, rad.

    Raises
    ------
    ValueError
        If neutral itself lies past a dead centre.
    """
    dead_low, dead_high = limits(linkage).crank
    if not dead_low < scale.neutral < dead_high:
        raise ValueError(
            f"neutral at a servo angle of {math.degrees(scale.neutral):.1f}° is not between the dead centres at "
            f"{math.degrees(dead_low):.1f}° and {math.degrees(dead_high):.1f}°"
        )
    low, high = servo_of_command([0, HIGHEST], scale)
    ends = [max(low, dead_low), min(high, dead_high)]
    lowest, highest = head_angle(linkage, scale.neutral) - head_angle(linkage, ends)
    return float(lowest), float(highest)


def nod_of_command(command: ArrayLike, linkage: FourBar, scale: CommandScale = TABLE_3) -> Floats:
    """Return the nod of a command, by exact closure of the links.

    Parameters
    ----------
    command : array_like of int
        0 to 254.
    linkage : FourBar
        Link lengths, m.
    scale : CommandScale
        Servo angle per count.

    Returns
    -------
    ndarray
        Δθ from neutral, upward positive, rad.

    Raises
    ------
    ValueError
        If a command is not a whole number from 0 to 254, or the links cannot close there.
    """
    return np.asarray(head_angle(linkage, scale.neutral) - head_angle(linkage, servo_of_command(command, scale)))


def command_of_nod(nod: ArrayLike, linkage: FourBar, scale: CommandScale = TABLE_3) -> Integers:
    """Return the command whose servo angle is nearest to that of a wanted nod.

    Parameters
    ----------
    nod : array_like
        Δθ from neutral, upward positive, rad.
    linkage : FourBar
        Link lengths, m.
    scale : CommandScale
        Servo angle per count.

    Returns
    -------
    ndarray of int
        0 to 254.

    Raises
    ------
    ValueError
        If a nod is beyond `nod_limits`, or these do not exist.
    """
    wanted = np.asarray(nod, dtype=float)
    low, high = nod_limits(linkage, scale)
    slack = 1e-9  # a limit that was rounded when written down must still be accepted
    beyond = ~((wanted >= low - slack) & (wanted <= high + slack))
    if np.any(beyond):
        raise ValueError(
            f"a nod of {math.degrees(wanted[beyond].flat[0]):.2f}° is beyond the neck's "
            f"{math.degrees(low):.2f}° to {math.degrees(high):.2f}°"
        )
    rocker = head_angle(linkage, scale.neutral) - np.clip(wanted, low, high)
    return command_of_servo(servo_angle(linkage, rocker), scale)


def resolution(command: ArrayLike, linkage: FourBar, scale: CommandScale = TABLE_3) -> Floats:
    """Return the head angle per count around a command, from the slope of the linkage there.

    Parameters
    ----------
    command : array_like of int
        0 to 254. At neutral, where the rate changes, the larger rate is used.
    linkage : FourBar
        Link lengths, m.
    scale : CommandScale
        Servo angle per count.

    Returns
    -------
    ndarray
        |γ|·θ_s per count, rad.

    Raises
    ------
    ValueError
        If a command is not a whole number from 0 to 254, or the links cannot close there.
    """
    servo = servo_of_command(command, scale)
    counts = np.asarray(command) - MIDDLE
    per_count = np.select([counts > 0, counts < 0], [scale.up, scale.down], max(scale.up, scale.down))
    return np.asarray(np.abs(slope(linkage, servo)) * per_count)


def table_3(linkage: FourBar, scale: CommandScale = TABLE_3) -> tuple[NeckPosition, NeckPosition, NeckPosition]:
    """Compute Table 3: its three commands, by exact closure and by the straight line of Fig. 4.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    scale : CommandScale
        Servo angle per count.

    Returns
    -------
    tuple of NeckPosition
        Upward, neutral, down.

    Raises
    ------
    ValueError
        If the links cannot close at one of the commands or on the line's 60° to 220°.
    """
    line = straight_line(linkage, *STRAIGHT)

    def row(position: Literal["upward", "neutral", "down"], counts: int) -> NeckPosition:
        servo = float(servo_of_command(MIDDLE + counts, scale))
        away = servo - scale.neutral
        return NeckPosition(
            position=position,
            counts=counts,
            command=MIDDLE + counts,
            theta_s=servo,
            theta_a=away,
            theta_f=float(head_angle(linkage, servo)),
            nod=float(nod_of_command(MIDDLE + counts, linkage, scale)),
            theta_f_line=line.slope * servo + line.intercept,
            nod_line=-line.slope * away,
        )

    return row("upward", 127), row("neutral", 0), row("down", -125)
