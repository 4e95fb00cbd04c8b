"""A certificate in words: each quantity's statement, its aliases, the conditions, and why intervals may not hold."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from anglecam.certificate.certify import Certificate, Certified
from anglecam.loop.refit import effects_of

SUM_OF_DELAYS = (
    "No lamp in the picture shows the first change of the command, so this is the sum of dead time and of the offset "
    "between the clocks of command and angle."
)
LAG_WITHOUT_LAMP = (
    "No lamp in the picture shows the first change of the command: if the clock of the command is late against that of "
    "the angle, the lag is larger by about as much."
)
NOT_NAMED = (
    "The verdict does not name its effect, which may be absent: up to 5 % of the intervals exclude an absent effect by "
    "chance."
)
PART_OF_THE_REST = (
    "The verdict does not name its effect. Its interval excludes absence, but it may only take up a part of the "
    "structure that the model leaves."
)
ONE_AT_A_TIME = "Dead time and a lag of the same length act almost alike: this is the interval with no {other}."


def statement(one: Certified, clock_shared: bool = False, certified: bool = True) -> str:
    """Return what the recordings show of a quantity, as one phrase.

    Parameters
    ----------
    one : Certified
        The quantity.
    clock_shared : bool
        Whether command and angle have one clock, so that dead time is not the sum with a clock offset.
    certified : bool
        Whether the quantity's value is stated (`Certificate.certifies`).

    Returns
    -------
    str
        Such as ``backlash below 0.12°``; ends are rounded outwards.
    """
    quantity = one.quantity
    name = quantity.name
    if quantity.id == "dead_time" and not clock_shared:
        name = "dead time plus clock offset"
    if one.profile is None:
        return f"{name}: not determined by these recordings"
    low, high = quantity.interval_in_file(*one.interval)
    if not certified:
        return f"{name}: not certified"
    if one.state == "not_determined":
        known = [f"above {_down(low, quantity.unit)}"] if math.isfinite(low) and low > 0.0 else []
        known += [f"below {_up(high, quantity.unit)}"] if math.isfinite(high) else []
        return f"{name}: not determined by these recordings" + (f" ({known[0]})" if known else "")
    if one.state == "measured":
        value = quantity.in_file(one.profile.estimate)
        digits = _decimals(0.5 * (high - low))
        unit = quantity.unit
        return f"{name} {_fixed(value, digits)}{unit} ({_fixed(low, digits)} to {_fixed(high, digits)}{unit})"
    if quantity.is_limit:
        return f"{name} above {_down(low, quantity.unit)}"
    if low < quantity.in_file(one.profile.null):
        digits = _decimals(0.5 * (high - low))
        return f"{name} between {_fixed(low, digits)} and {_fixed(high, digits)}{quantity.unit}"
    return f"{name} below {_up(high, quantity.unit)}"


def aliases(one: Certified, certificate: Certificate) -> list[str]:
    """Return what could be mistaken for a quantity in these recordings, a sentence each."""
    if not certificate.is_certified:
        return []
    if not certificate.certifies(one):
        return [PART_OF_THE_REST]
    notes = [NOT_NAMED] if one.state == "measured" and not one.accepted else []
    shared = certificate.clock.shared
    named = {e.id for e in effects_of(certificate.verdict.after)}
    if one.rivals:
        listed = ", ".join(_plain(rival) for rival in one.rivals)
        notes.append(f"These recordings cannot distinguish it from: {listed}. The interval leaves each of them open.")
    if one.quantity.id == "dead_time":
        notes += [] if shared else [SUM_OF_DELAYS]
        if "actuator_lag" not in {*named, *one.rivals}:
            notes.append(ONE_AT_A_TIME.format(other="lag"))
    if one.quantity.id == "lag":
        notes += [] if shared else [LAG_WITHOUT_LAMP]
        if "dead_time" not in {*named, *one.rivals}:
            notes.append(ONE_AT_A_TIME.format(other="dead time"))
    return notes


def doubt(certificate: Certificate) -> str | None:
    """Return why the intervals do not hold; ``None`` if they do."""
    verdict = certificate.verdict
    if certificate.holds:
        return None
    error, noise = np.degrees(verdict.after_held_out.rmse), np.degrees(verdict.noise.sigma)
    size = f"its error on data that it was not fitted to is {error:.2g}°"
    size += f", the noise {noise:.2g}°" if verdict.noise.known else ""
    if not certificate.is_certified:
        return (
            f"Nothing is certified. The model leaves structure that no effect explains ({size}). What is missing may "
            "have changed every value; the report shows its shape."
        )
    return (
        f"The intervals may be too narrow. The model explains most of the motion, but leaves structure that no further "
        f"effect explains ({size})."
    )


def conditions(certificate: Certificate) -> list[str]:
    """Return the conditions under which the intervals hold, a sentence each."""
    verdict, clock = certificate.verdict, certificate.clock
    effects = ", ".join(_plain(e.id) for e in effects_of(verdict.after)) or "none"
    fitted = ", ".join(dict.fromkeys(r.name for r in verdict.fitted))
    known = "" if verdict.noise.known else ", which is an upper limit"
    lines = [
        f"Model: θ̈ = c·u − a·θ̇ − b·θ with these effects of the verdict ({verdict.verdict.replace('_', ' ')}): "
        f"{effects}. A quantity whose effect is not among them was added alone.",
        f"Recordings: {fitted}. Noise of the angle: {np.degrees(verdict.noise.sigma):.2g}° ({verdict.noise.source})"
        f"{known}.",
        "Each interval is that of the profile likelihood with 95 % confidence, widened for correlated residuals and "
        "for systematic errors of the measurement. An upper or lower bound has at least 97.5 %.",
        "Torques are divided by the moment of inertia of all that moves; in degrees of command they are divided by c, "
        "too.",
    ]
    if clock.lamp:
        lines.append(
            f"A lamp shows the first change of the command; its standard uncertainty of {1e3 * clock.sigma:.2g} ms is "
            "included in the dead time."
        )
    return lines


def _plain(effect_id: str) -> str:
    return effect_id.replace("_", " ").replace("coulomb", "Coulomb")


def _decimals(half_width: float) -> int:
    """Return the decimals that show two digits of an interval's half-width."""
    return int(np.clip(1 - math.floor(math.log10(max(half_width, 1e-12))), 0, 9))


def _fixed(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−")


def _up(value: float, unit: str) -> str:
    return _rounded(value, math.ceil) + unit


def _down(value: float, unit: str) -> str:
    return _rounded(value, math.floor) + unit


def _rounded(value: float, towards: Callable[[float], int]) -> str:
    """Return two significant digits, rounded towards one side."""
    if value == 0.0:
        return "0"
    power = math.floor(math.log10(abs(value))) - 1
    mantissa = towards(round(value / 10.0**power, 9))
    return f"{mantissa * 10**power:.0f}" if power >= 0 else f"{mantissa * 10.0**power:.{-power}f}"
