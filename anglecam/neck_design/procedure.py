"""The seven steps of the paper's design procedure in a row, from what a user gives to what each step takes.

1 a mechanism (`anglecam.io.neck_file`), 2 a person's nod (`wanted_nod`, `wish_of`), 3 a motion (`identified_motion`), 4
and 5 what is known and each route through Eqs. (34)-(35) (`routes_of`), 6 a neck that explains it (`explain`), 7 its
control (`chosen_plant`, `default_gains`, `simulated_loop`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from anglecam.errors import InputError
from anglecam.identification.export import SECOND_ORDER, read_model, transfer_function
from anglecam.io.neck_file import DeclaredNeck
from anglecam.io.responses_json import nod_from_responses
from anglecam.neck.correlated import CorrelatedQuantities
from anglecam.neck.design import (
    Relations,
    by_inertia,
    by_inertia_and_motor,
    by_motor,
    explained_neck,
    identified,
)
from anglecam.neck.large_angle import LargeAngleNeck, acceleration
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import NeckParameters
from anglecam.neck.pd import (
    FIG_16_K_D,
    FIG_16_K_P,
    ClosedLoop,
    PdMotion,
    linear_plant,
    rest_gain,
    simulate_pd,
    sys2,
)
from anglecam.neck.pd_tuning import ADULT, NodTarget
from anglecam.neck.synthesis import Wish
from anglecam.neck_design.systems import STEP, SYS1
from anglecam.neck_design.units import Unit

if TYPE_CHECKING:
    import control

_SETTLINGS = 4.0
"""Settling times for which a controlled neck is simulated."""


def identified_motion(
    abc: Sequence[float | None], sigma: Sequence[float] | None, model: Path | None, command_gain: float
) -> CorrelatedQuantities:
    """Take a, b, c as given, from a ``model.json``, or the paper's SYS1.

    Parameters
    ----------
    abc : sequence of float or None
        1/s, 1/s² and 1/s², angle per command; all or none.
    sigma : sequence of float or None
        Their standard uncertainties; not for a model, which has its own covariance.
    model : Path or None
        Of second order.
    command_gain : float
        C_i, V/rad: the design relations hold c per volt.

    Returns
    -------
    CorrelatedQuantities
        ``a``, ``b`` and ``c`` (rad/(s²·V)).

    Raises
    ------
    ValueError
        Where too much or too little is given.
    InputError
        Where the model cannot be read or is not of second order.
    """
    given = [value for value in abc if value is not None]
    if len(given) not in (0, 3):
        raise ValueError("give all of --a, --b and --c, or none of them")
    per_volt = np.array([1.0, 1.0, 1.0 / command_gain])
    if model is None:
        a, b, c = np.array(given or SYS1) * per_volt
        return identified(a, b, c, np.asarray(sigma or (0.0, 0.0, 0.0)) * per_volt)
    if given or sigma:
        raise ValueError("--model has its own a, b, c and their uncertainties: leave out --a, --b, --c and --sigma")
    read = read_model(model)
    if read.linearised:
        raise InputError(
            f"{model}: a model of the neck at large angles: it holds C, c3, h and K themselves, which the design "
            "relations would only find from a, b and c"
        )
    if read.names != SECOND_ORDER:
        raise InputError(
            f"{model}: the design relations need a, b and c: a driven model of second order (--estimator oe2 or ekf)"
        )
    a, b, c = read.values * per_volt
    return identified(a, b, c, read.covariance * np.outer(per_volt, per_volt))


def routes_of(found: CorrelatedQuantities, beforehand: CorrelatedQuantities) -> tuple[Relations, ...]:
    """Take every route through Eqs. (34)-(35): `by_inertia`, `by_inertia_and_motor` and `by_motor`."""
    return tuple(route(found, beforehand) for route in (by_inertia, by_inertia_and_motor, by_motor))


def explain(routes: Sequence[Relations], neck: NeckParameters) -> NeckParameters | None:
    """Return the neck of the first route that contradicts nothing, ``None`` where every one does."""
    for route in routes:
        try:
            return explained_neck(route, neck)
        except ValueError:
            continue
    return None


def wish_of(
    rise: float | None, overshoot: float | None, up: float | None, down: float | None, torque: float | None
) -> Wish | None:
    """Take a wish for another neck.

    Parameters
    ----------
    rise, overshoot, up, down, torque : float or None
        s, %, ° above neutral, ° below it, N·m; what is not given is the paper's adult and prototype.

    Returns
    -------
    Wish or None
        ``None`` where nothing is wished for.

    Raises
    ------
    ValueError
        For a rise time or a range that is not positive, or a negative overshoot.
    """
    if all(value is None for value in (rise, overshoot, up, down, torque)):
        return None
    usual = Wish(_nod(rise, overshoot))
    for value, name in ((up, "--wish-up"), (down, "--wish-down"), (torque, "--wish-torque")):
        if value is not None and not 0.0 < value < 180.0:
            raise ValueError(
                f"{name} {value:g}: must be positive" + (" and below 180°" if "torque" not in name else "")
            )
    return Wish(
        usual.nod,
        usual.up if up is None else math.radians(up),
        usual.down if down is None else math.radians(down),
        stall_torque=torque,
    )


def wanted_nod(tune: bool, like: Path | None, rise: float | None, overshoot: float | None) -> NodTarget | None:
    """Take the nod to tune to: the paper's adult, a measured one, or as given; ``None`` where none is asked for."""
    if like is not None:
        if rise is not None or overshoot is not None:
            raise ValueError("--like is a measured nod: leave out --rise and --overshoot")
        return nod_from_responses(like)
    if rise is None and overshoot is None:
        return ADULT if tune else None
    return _nod(rise, overshoot)


@dataclass(frozen=True)
class ControlledPlant:
    """What is to be controlled, and the units of its loop."""

    transfer: control.TransferFunction
    name: str
    output: Unit
    """Of its output per step of the input."""
    gain_unit: str
    """Of K_p."""
    rate_unit: str
    """Of K_d."""
    gains_of: str
    """Of what K_p and K_d are the gains, in words."""


def chosen_plant(model: Path | None, neck: DeclaredNeck | None) -> ControlledPlant:
    """Return what is to be controlled: SYS2, a fitted model or a neck by Eq. (28)."""
    if model is not None:
        read = read_model(model)
        of = "K_p and K_d from angle to command, both of the head"
        return ControlledPlant(
            transfer_function(read), f"the fitted model ({read.name})", Unit("", "°/°"), "°/°", "°·s/°", of
        )
    if neck is not None:
        plant, of = linear_plant(linear_neck(neck.parameters)), "K_p and K_d from the head's angle to the servo's input"
        return ControlledPlant(plant, "the neck by Eq. (28)", Unit("rad_per_V", "rad/V"), "V/rad", "V·s/rad", of)
    step = math.degrees(STEP)
    of = f"Eq. (37) in the paper's input unit: 1 stands for a command of {step:g}°, so K_p = 0.01 is {0.01 * step:g}°/°"
    return ControlledPlant(sys2(), "SYS2", Unit("deg", "°"), "1/°", "s/°", of)


def default_gains(plant: control.TransferFunction) -> tuple[list[float], list[float]]:
    """Return K_p and K_d of Fig. 16; of another plant than SYS2 those with the same K·G(0)."""
    scale = rest_gain(sys2()) / rest_gain(plant)
    return [scale * K for K in FIG_16_K_P], [scale * K for K in FIG_16_K_D]


def simulated_loop(neck: LargeAngleNeck, loop: ClosedLoop) -> PdMotion:
    """Simulate gains, V/rad, on the neck at large angles, for a command of the paper's 22°.

    Parameters
    ----------
    neck : LargeAngleNeck
        Of Eq. (31).
    loop : ClosedLoop
        The same gains about its linear model.

    Returns
    -------
    PdMotion
        From rest at neutral.

    Raises
    ------
    ValueError
        Where the head leaves what it can reach.
    """
    settled = loop.figures.settling_time
    duration = _SETTLINGS * (settled if math.isfinite(settled) else 1.0)
    return simulate_pd(
        lambda delta, omega, voltage: float(acceleration(neck, delta, omega, voltage)),
        loop.gains,
        neck.parameters.servo.command_gain * STEP,
        duration,
    )


def _nod(rise: float | None, overshoot: float | None) -> NodTarget:
    wanted = NodTarget(
        ADULT.rise_time if rise is None else rise, ADULT.overshoot if overshoot is None else overshoot / 100.0
    )
    if not (0.0 < wanted.rise_time < math.inf and 0.0 <= wanted.overshoot < math.inf):
        raise ValueError(
            f"a nod with a rise time of {wanted.rise_time:g} s and an overshoot of {100.0 * wanted.overshoot:g} % "
            "cannot be wanted"
        )
    return wanted
