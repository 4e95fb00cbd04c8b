"""What `anglecam neck` works out of the moving neck: responses, design, control; keys end in their unit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anglecam.neck.constraints import Constraint
from anglecam.neck.design import Relations
from anglecam.neck.joint import Joint, Quantity
from anglecam.neck.linear import LinearNeck, linear_neck, passive_stiffness
from anglecam.neck.parameters import PAPER, NeckParameters
from anglecam.neck.pd import ClosedLoop, Margins, PdMotion
from anglecam.neck.pd_tuning import Nod, Tuned
from anglecam.neck.step import linear_step_figures
from anglecam.neck.synthesis import Synthesis
from anglecam.neck.variation import NOD, PARAMETERS
from anglecam.neck_design.demand import demand_notes, demand_numbers, saturation_notes
from anglecam.neck_design.numbers import UNSTABLE, Numbers, step_numbers
from anglecam.neck_design.procedure import Plant
from anglecam.neck_design.systems import System

UNITS = {
    "a": "per_s",
    "b": "per_s2",
    "c": "rad_per_s2_V",
    "inertia": "kg_m2",
    "gamma": "",
    "spring": "N_m",
    "weight": "N_m",
    "damping": "N_m_s",
    "sensor_gain": "V_per_rad",
    "motor_constant": "N_m_per_A",
    "amplifier_gain": "",
    "gear_ratio": "",
    "output_impedance": "ohm",
    "torque_gain": "N_m_per_V",
    "motor_torque_gain": "N_m_per_V",
    "torque_gain_gap": "N_m_per_V",
    "back_emf_ratio": "V_s_per_rad",
    "sensor_gain_bound": "V_per_rad",
    "damping_bound": "N_m_s",
    "spring_bound": "N_m",
    "stiffness": "N_m",
}
"""Of the quantities of `anglecam.neck.design`, as keys end in them."""
_SPOKEN = {"ohm": "Ω", "N_m": "N·m", "N_m_s": "N·m·s", "kg_m2": "kg·m²", "per_s": "1/s", "per_s2": "1/s²"}
_SPOKEN |= {"V_per_rad": "V/rad", "N_m_per_A": "N·m/A", "N_m_per_V": "N·m/V", "V_s_per_rad": "V·s/rad", "": "1"}
_SPOKEN |= {"rad_per_s2_V": "rad/(s²·V)"}


def key_of(name: str) -> str:
    """Return a design quantity's name with its unit."""
    return f"{name}_{UNITS[name]}".rstrip("_")


def spoken_unit(name: str) -> str:
    """Return a design quantity's unit as it is printed."""
    return _SPOKEN[UNITS[name]]


def response_numbers(
    systems: Sequence[System], height: float, rmse: Mapping[str, float], neck: NeckParameters = PAPER
) -> Numbers:
    """Set models side by side.

    Parameters
    ----------
    systems : sequence of System
        To step.
    height : float
        Of the step, rad.
    rmse : mapping
        Of each system beside a measurement, rad, by its name; empty without one.
    neck : NeckParameters
        Whose responses some of the systems are.

    Returns
    -------
    dict
        Keys end in their unit.
    """
    told = []
    for system in systems:
        figures = system.figures(height)
        row: Numbers = {
            "name": system.name,
            "equation": system.equation,
            **step_numbers(figures),
            "gain": figures.steady_state,
            "steady_state_deg": math.degrees(figures.steady_state * height),
        }
        if system.transfer is not None:
            row["numerator"], row["denominator"] = (list(map(float, side)) for side in system.transfer)
        if system.name in rmse:
            row["measured_rmse_deg"] = math.degrees(rmse[system.name])
        told.append(row)
    notes = [] if linear_neck(neck).stiffness > 0.0 else [UNSTABLE]
    # the error is the whole input while the head has not moved
    notes += saturation_notes(
        neck.servo.amplifier_gain * neck.servo.command_gain * height,
        "at the step's start: the models have no such limit",
    )
    return {"step_deg": math.degrees(height), "models": told, "notes": notes}


def design_numbers(
    found: Joint,
    routes: Sequence[Relations],
    explained: NeckParameters | None,
    made: Synthesis | None,
    declared: NeckParameters = PAPER,
    nod: float = NOD,
) -> Numbers:
    """Tell the design procedure's steps 3 to 6 and, where wished for, the neck that does what is wished.

    Parameters
    ----------
    found : Joint
        a, b, c.
    routes : sequence of Relations
        Each way through Eqs. (34) and (35).
    explained : NeckParameters or None
        The neck whose Eq. (28) is that motion.
    made : Synthesis or None
        The neck made to a wish.
    declared : NeckParameters
        The neck as it was declared: what a wish is held beside, and whose servo holds the nod without one.
    nod : float
        The farthest nod to be held, rad.

    Returns
    -------
    dict
        Every quantity with ``value`` and ``sigma``; keys end in their unit.
    """
    a, b, c = (found[name].value for name in ("a", "b", "c"))
    figures = linear_step_figures([c], [1.0, a, b])
    numbers: Numbers = {
        "identified": _quantities(found, ("a", "b", "c")),
        "step": {**step_numbers(figures), "gain_rad_per_V": figures.steady_state},
        "routes": [
            {
                "route": route.route,
                "known": _quantities(route.quantities, route.given),
                "found": _quantities(route.quantities, route.found),
                "stable": route.stable,
                "contradictions": list(route.contradictions),
            }
            for route in routes
        ],
        "explained_neck": None if explained is None else neck_numbers(explained),
    }
    if made is not None:
        numbers["synthesis"] = _synthesis(made, declared)
    holding = declared if made is None else made.neck
    at_head = abs(passive_stiffness(holding)) * nod
    numbers["demand"] = demand_numbers(holding, nod, abs(holding.gamma) * at_head, at_head)
    numbers["notes"] = demand_notes(numbers["demand"])
    return numbers


def neck_numbers(neck: NeckParameters) -> Numbers:
    """List what a neck is made of, by the paper's symbols, with units."""
    told = {symbol: {"value": p.read(neck), "unit": p.unit, "name": p.name} for symbol, p in PARAMETERS.items()}
    told["L_3"] = {"value": neck.linkage.coupler, "unit": "m", "name": "coupler"}
    return told


def _quantities(joint: Joint, names: Sequence[str]) -> Numbers:
    return {key_of(name): _quantity(joint[name]) for name in names}


def _quantity(quantity: Quantity) -> Numbers:
    return {"value": quantity.value, "sigma": quantity.sigma}


def _synthesis(made: Synthesis, declared: NeckParameters) -> Numbers:
    linear: LinearNeck = made.linear
    return {
        "feasible": made.feasible,
        "unmet": list(made.unmet),
        "changes": {
            symbol: {
                "before": before if symbol == "K_d" else PARAMETERS[symbol].read(declared),
                "after": after,
                "unit": unit_of_change(symbol),
            }
            for symbol, (before, after) in made.changes.items()
        },
        "neck": neck_numbers(made.neck),
        "a_per_s": linear.a,
        "b_per_s2": linear.b,
        "c_rad_per_s2_V": linear.c,
        "derivative_gain_V_s_per_rad": made.gains.derivative,
        "command_gain_V_per_rad": made.command_gain,
        "step": {**step_numbers(made.figures), "gain_rad_per_V": made.figures.steady_state},
        "constraints": [constraint_numbers(c) for c in made.constraints],
    }


def unit_of_change(symbol: str) -> str:
    """Return the unit of what a synthesis may change."""
    return "V·s/rad" if symbol == "K_d" else PARAMETERS[symbol].unit


def constraint_numbers(constraint: Constraint) -> Numbers:
    """Tell a constraint with value, limit and unit."""
    return {
        "name": constraint.name,
        "unit": constraint.unit,
        "value": constraint.value,
        "limit": constraint.limit,
        "sense": "≥" if constraint.at_least else "≤",
        "met": constraint.met,
        "active": constraint.active,
    }


def pd_numbers(plant: Plant, loops: Sequence[ClosedLoop], tuned: Tuned | None, simulated: PdMotion | None) -> Numbers:
    """Tell closed loops and, where gains were tuned, what came of it.

    Parameters
    ----------
    plant : Plant
        What is controlled.
    loops : sequence of ClosedLoop
        One for each pair of gains.
    tuned : Tuned or None
        Gains for a wanted nod.
    simulated : PdMotion or None
        What these gains do to the neck at large angles.

    Returns
    -------
    dict
        Keys end in their unit; the gains are in the plant's unit of input over that of its output.
    """
    unit = plant.unit
    numbers: Numbers = {
        "plant": plant.name,
        "gains_of": plant.gains_of,
        "gain_units": {"proportional": plant.gain_unit, "derivative_s": plant.rate_unit},
        "steady_state_unit": plant.output,
        "loops": [_loop(loop, unit) for loop in loops],
    }
    if tuned is not None:
        numbers["tuned"] = {
            **_loop(tuned.loop, unit),
            "wanted": _nod(tuned.wanted),
            "feasible": tuned.feasible,
            "unmet": list(tuned.unmet),
            "constraints": [constraint_numbers(c) for c in tuned.constraints],
        }
    if simulated is not None:
        numbers["large_angles"] = {
            **step_numbers(simulated.figures),
            "steady_state_deg": math.degrees(simulated.figures.steady_state),
            "peak_voltage_V": float(np.abs(simulated.voltage).max()),
        }
    return numbers


def _loop(loop: ClosedLoop, unit: str) -> dict[str, Any]:
    return {
        "proportional": loop.gains.proportional,
        "derivative_s": loop.gains.derivative,
        **step_numbers(loop.figures),
        f"steady_state_{unit}".rstrip("_"): loop.figures.steady_state,
        "loss": loop.loss,
        "loss_percent": 100.0 * loop.loss,
        **_margins(loop.margins),
    }


def _margins(margins: Margins) -> Numbers:
    return {
        "gain_margin": margins.gain,
        "gain_margin_dB": 20.0 * math.log10(margins.gain) if margins.gain > 0.0 else math.nan,
        "phase_margin_deg": math.degrees(margins.phase),
        "delay_margin_s": margins.delay,
        "modulus_margin": margins.modulus,
        "sensitivity": margins.sensitivity,
    }


def _nod(nod: Nod) -> Numbers:
    return {"rise_time_s": nod.rise_time, "overshoot": nod.overshoot, "overshoot_percent": 100.0 * nod.overshoot}
