"""The seven steps of the paper's design procedure: from a user's options to the input of each step.

1. a mechanism: `anglecam.io.neck_file`
2. the nod of a person: `wanted_nod`, `wish_of`
3. an identified motion: `identified_motion`
4. the known quantities: `anglecam.io.neck_file`
5. each route through Eqs. (34)-(35): `routes_of`
6. a neck that explains the motion: `explain`
7. control: `chosen_plant`, `default_gains`, `simulated_loop`
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
"""Number of settling times for which a controlled neck is simulated."""


def identified_motion(
    abc: Sequence[float | None], sigma: Sequence[float] | None, model: Path | None, command_gain: float
) -> CorrelatedQuantities:
    """Return a, b, c as given, from a ``model.json``, or from the paper's SYS1.

    Parameters
    ----------
    abc : sequence of float or None
        1/s, 1/s² and 1/s², angle per command; all or none.
    sigma : sequence of float or None
        Their standard uncertainties; not for a model, which contains a covariance.
    model : Path or None
        Of second order.
    command_gain : float
        C_i, V/rad: in the design relations c is per volt.

    Returns
    -------
    CorrelatedQuantities
        ``a``, ``b`` and ``c`` (rad/(s²·V)).

    Raises
    ------
    ValueError
        If too much or too little is given.
    InputError
        If the model cannot be read or is not of second order.
    """
    given = [value for value in abc if value is not None]
    if len(given) not in (0, 3):
        raise ValueError("give all of --a, --b and --c, or none of them")
    per_volt = np.array([1.0, 1.0, 1.0 / command_gain])
    if model is None:
        a, b, c = np.array(given or SYS1) * per_volt
        return identified(a, b, c, np.asarray(sigma or (0.0, 0.0, 0.0)) * per_volt)
    if given or sigma:
        raise ValueError("--model contains a, b, c and their uncertainties: leave out --a, --b, --c and --sigma")
    fitted = read_model(model)
    if fitted.linearised:
        raise InputError(
            f"{model}: a model of the neck at large angles: it already contains C, c3, h and K, which the design "
            "relations find from a, b and c"
        )
    if fitted.names != SECOND_ORDER:
        raise InputError(
            f"{model}: the design relations need a, b and c: a driven model of second order (--estimator oe2 or ekf)"
        )
    a, b, c = fitted.values * per_volt
    return identified(a, b, c, fitted.covariance * np.outer(per_volt, per_volt))


def routes_of(found: CorrelatedQuantities, known: CorrelatedQuantities) -> tuple[Relations, ...]:
    """Return the results of all routes through Eqs. (34)-(35): `by_inertia`, `by_inertia_and_motor`, `by_motor`."""
    return tuple(route(found, known) for route in (by_inertia, by_inertia_and_motor, by_motor))


def explain(routes: Sequence[Relations], neck: NeckParameters) -> NeckParameters | None:
    """Return the neck of the first route without a contradiction; ``None`` if every route has one."""
    for route in routes:
        try:
            return explained_neck(route, neck)
        except ValueError:
            continue
    return None


def wish_of(
    rise: float | None, overshoot: float | None, up: float | None, down: float | None, torque: float | None
) -> Wish | None:
    """Return the wish for another neck.

    Parameters
    ----------
    rise, overshoot, up, down, torque : float or None
        s, %, ° above neutral, ° below it, N·m; defaults are the paper's adult and prototype.

    Returns
    -------
    Wish or None
        ``None`` if no value is given.

    Raises
    ------
    ValueError
        If a rise time or a range is not positive, or an overshoot is negative.
    """
    if all(value is None for value in (rise, overshoot, up, down, torque)):
        return None
    default = Wish(_nod(rise, overshoot))
    for value, name in ((up, "--wish-up"), (down, "--wish-down"), (torque, "--wish-torque")):
        if value is not None and not 0.0 < value < 180.0:
            raise ValueError(
                f"{name} {value:g}: must be positive" + (" and below 180°" if "torque" not in name else "")
            )
    return Wish(
        default.nod,
        default.up if up is None else math.radians(up),
        default.down if down is None else math.radians(down),
        stall_torque=torque,
    )


def wanted_nod(tune: bool, like: Path | None, rise: float | None, overshoot: float | None) -> NodTarget | None:
    """Return the nod to tune to: the paper's adult, a measured one, or as given; ``None`` if no tuning is wanted."""
    if like is not None:
        if rise is not None or overshoot is not None:
            raise ValueError("--like is a measured nod: leave out --rise and --overshoot")
        return nod_from_responses(like)
    if rise is None and overshoot is None:
        return ADULT if tune else None
    return _nod(rise, overshoot)


@dataclass(frozen=True)
class ControlledPlant:
    """The plant of a control loop, and the units of that loop."""

    transfer: control.TransferFunction
    name: str
    output: Unit
    """Unit of its output per step of the input."""
    gain_unit: str
    """Unit of K_p."""
    rate_unit: str
    """Unit of K_d."""
    gains_of: str
    """What K_p and K_d multiply, in words."""


def chosen_plant(model: Path | None, neck: DeclaredNeck | None) -> ControlledPlant:
    """Return the plant to control: a fitted model, a neck by Eq. (28), or else SYS2."""
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
    """Return K_p and K_d of Fig. 16; for a plant other than SYS2, gains with the same K·G(0)."""
    scale = rest_gain(sys2()) / rest_gain(plant)
    return [scale * K for K in FIG_16_K_P], [scale * K for K in FIG_16_K_D]


def simulated_loop(neck: LargeAngleNeck, loop: ClosedLoop) -> PdMotion:
    """Simulate PD gains, V/rad, on the neck at large angles, for the paper's command of 22°.

    Parameters
    ----------
    neck : LargeAngleNeck
        The neck of Eq. (31).
    loop : ClosedLoop
        The loop of its linear model with these gains.

    Returns
    -------
    PdMotion
        From rest at neutral.

    Raises
    ------
    ValueError
        If the head leaves the reach of its linkage.
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
