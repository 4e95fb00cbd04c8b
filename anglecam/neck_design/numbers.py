"""What `anglecam neck` works out of the mechanism itself, as numbers whose keys end in their unit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from anglecam.data.step_figures import StepFigures
from anglecam.io.neck_file import Neck
from anglecam.neck.command_table import (
    STRAIGHT,
    command_of_nod,
    nod_limits,
    nod_of_command,
    resolution,
    servo_of_command,
    table_3,
)
from anglecam.neck.damping import SAE_20_VISCOSITY
from anglecam.neck.fourbar import head_angle, servo_angle
from anglecam.neck.large_angle import holding_voltage
from anglecam.neck.linear import linear_neck, passive_stiffness
from anglecam.neck.parameters import PAPER
from anglecam.neck.power import SERVOS, PowerUse
from anglecam.neck.sensitivity import FIGURES, Figure9, Sensitivity
from anglecam.neck.servo import torque_speed
from anglecam.neck.statics import neutral_angle, pretension, pretension_angle, slack_limit, static_curve
from anglecam.neck.transmission import limits, slope, straight_line, transmission_angle, worst_transmission_angle
from anglecam.neck.turning import (
    KGF_CM,
    bearing_torque,
    slider,
    turning_range,
    turning_servo_angle,
    turning_slope,
    turning_start_torque,
)
from anglecam.neck.variation import NOD, PARAMETERS, nod_range, nod_slope
from anglecam.neck_design.demand import SUPPLY, demand_notes, demand_numbers

Numbers = dict[str, Any]

UNSTABLE = "the neck is unstable, Eq. (35): it falls from neutral, so its response has no figures"
EVERY = math.radians(5.0)
"""Between the angles at which spring and weight are tabulated, rad."""


def kinematics_numbers(neck: Neck, wanted: Sequence[float] = ()) -> Numbers:
    """Work out Table 3, the line of Fig. 4, limits, transmission angle, resolution and the turning mechanism.

    Parameters
    ----------
    neck : Neck
        Its links, command scale, turning mechanism and bearing.
    wanted : sequence of float
        Nods to find the command of, rad.

    Returns
    -------
    dict
        Keys end in their unit.

    Raises
    ------
    ValueError
        Where the links cannot close or a wanted nod is beyond them.
    """
    linkage, scale = neck.parameters.linkage, neck.scale
    rows = table_3(linkage, scale)
    line, found = straight_line(linkage, *STRAIGHT), limits(linkage)
    worst = worst_transmission_angle(linkage, rows[2].theta_s, rows[0].theta_s)
    beyond = [row for row in rows if not found.crank[0] <= row.theta_s <= found.crank[1]]
    lowest, highest = nod_limits(linkage, scale)
    return {
        "table_3": [
            {
                "position": row.position,
                "counts": row.counts,
                "command": row.command,
                "theta_s_deg": math.degrees(row.theta_s),
                "theta_a_deg": math.degrees(row.theta_a),
                "theta_f_deg": math.degrees(row.theta_f),
                "nod_deg": math.degrees(row.nod),
                "theta_f_line_deg": math.degrees(row.theta_f_line),
                "nod_line_deg": math.degrees(row.nod_line),
                "slope": float(slope(linkage, row.theta_s)),
                "transmission_angle_deg": math.degrees(float(transmission_angle(linkage, row.theta_s))),
                "resolution_deg_per_count": math.degrees(float(resolution(row.command, linkage, scale))),
            }
            for row in rows
        ],
        "line": {
            "slope": line.slope,
            "intercept_deg": math.degrees(line.intercept),
            "r_squared": line.r_squared,
            "range_deg": np.degrees(STRAIGHT).tolist(),
        },
        "gamma": neck.parameters.gamma,
        "gamma_from": _origin_of_gamma(neck),
        "limits": {
            "grashof": found.kind,
            "theta_f_deg": np.degrees(found.rocker).tolist(),
            "theta_s_deg": np.degrees(found.crank).tolist(),
            "nod_deg": [math.degrees(lowest), math.degrees(highest)],
        },
        "worst_transmission_angle": {
            "theta_s_deg": math.degrees(worst.theta_s),
            "transmission_angle_deg": math.degrees(worst.mu),
        },
        "wanted": [_wanted(neck, nod) for nod in wanted],
        "turning": _turning(neck),
        "bearing": _bearing(neck),
        "notes": [
            f"Table 3's command {row.command} ({row.position}) turns the servo to {math.degrees(row.theta_s):.1f}°, "
            f"beyond a dead centre of the links, where the head has turned back"
            for row in beyond
        ],
    }


def _origin_of_gamma(neck: Neck) -> str:
    linkage, gamma = neck.parameters.linkage, neck.parameters.gamma
    if math.isclose(gamma, nod_slope(linkage), rel_tol=1e-9):
        low, high = np.degrees(nod_range(linkage))
        return f"line fitted over a nod of ±{math.degrees(NOD):.0f}°, θ_s from {low:.1f}° to {high:.1f}°"
    return "printed by the paper, over Fig. 4's range of θ_s" if gamma == PAPER.gamma else "declared"


def _wanted(neck: Neck, nod: float) -> Numbers:
    linkage, scale = neck.parameters.linkage, neck.scale
    command = int(command_of_nod(nod, linkage, scale))
    exact = float(servo_angle(linkage, float(head_angle(linkage, scale.neutral)) - nod))
    reached = float(nod_of_command(command, linkage, scale))
    return {
        "nod_deg": math.degrees(nod),
        "theta_s_deg": math.degrees(exact),
        "command": command,
        "theta_s_of_command_deg": math.degrees(float(servo_of_command(command, scale))),
        "nod_of_command_deg": math.degrees(reached),
        "error_deg": math.degrees(reached - nod),
    }


def _turning(neck: Neck) -> Numbers:
    mechanism = neck.turning
    low, high = turning_range(mechanism)
    ends = turning_servo_angle(mechanism, [low, 0.0, high])
    return {
        "range_deg": [math.degrees(low), math.degrees(high)],
        "slope_at_ends_and_neutral": turning_slope(mechanism, ends).tolist(),
        "slot_m": float(np.ptp(slider(mechanism, np.linspace(ends[0], ends[2], 361)))),
    }


def _bearing(neck: Neck) -> Numbers:
    head = neck.parameters.head
    running = bearing_torque(head.mass * head.gravity, neck.bearing.friction, neck.bearing.bore)
    start = turning_start_torque(running)
    return {
        "torque_N_m": running,
        "torque_kgf_cm": running / KGF_CM,
        "start_torque_N_m": start,
        "start_torque_kgf_cm": start / KGF_CM,
    }


def statics_numbers(neck: Neck, theta_p: float | None = None) -> Numbers:
    """Work out what carries the head: balance, pretension, spring against weight, and what the servo has to add.

    Parameters
    ----------
    neck : Neck
        Its springs, head, servo and film.
    theta_p : float, optional
        A pretension angle, rad from upright, to find neutral for.

    Returns
    -------
    dict
        Keys end in their unit.

    Raises
    ------
    ValueError
        Where nothing balances the head.
    """
    p, large = neck.parameters, neck.large_angle
    lowest, highest = nod_limits(p.linkage, neck.scale)
    delta = EVERY * np.arange(math.ceil(lowest / EVERY), math.floor(highest / EVERY) + 1)
    curve = static_curve(p, large.preload, delta)
    voltage = holding_voltage(large, delta)
    servo = torque_speed(p.servo, SUPPLY / p.servo.amplifier_gain)
    at_shaft = np.abs(large.ratio.slope(delta) * curve.residual)
    hardest = int(np.nanargmax(at_shaft))
    demand = demand_numbers(p, delta[hardest], at_shaft[hardest], np.abs(curve.residual).max())
    numbers: Numbers = {
        "spring": {
            "stiffness_N_m": p.spring.rate * p.spring.base * p.spring.arm,
            "stretch_behind_m": large.preload.behind,
            "stretch_before_m": large.preload.before,
            "least_common_stretch_m": slack_limit(p.spring, lowest, highest),
        },
        "weight": {
            "moment_N_m": p.head.weight_moment,
            "moment_kgf_cm": p.head.weight_moment / KGF_CM,
            "at_neutral_N_m": p.head.weight_moment * math.sin(p.head.neutral),
        },
        "stiffness_of_spring_and_weight_N_m": passive_stiffness(p),
        "pretension_angle_deg": math.degrees(pretension_angle(p)),
        "torque_at_neutral_N_m": large.pretension_error,
        "neutral_deg": math.degrees(neutral_angle(p, large.preload)),
        "servo": {
            "torque_gain_N_m_per_V": p.servo.torque_gain,
            "supply_V": SUPPLY,
            "stall_torque_N_m": servo.stall_torque,
            "no_load_speed_rad_per_s": servo.no_load_speed,
        },
        "demand": demand,
        "film": {
            "damping_N_m_s": neck.film.damping,
            "damping_of_SAE_20_N_m_s": replace(neck.film, viscosity=SAE_20_VISCOSITY).damping,
        },
        "curve": [
            {
                "nod_deg": math.degrees(delta[i]),
                "spring_N_m": float(curve.spring[i]),
                "weight_N_m": float(curve.weight[i]),
                "residual_N_m": float(curve.residual[i]),
                "small_angle_N_m": float(curve.small_angle[i]),
                "holding_voltage_V": float(voltage[i]),
                "torque_at_shaft_N_m": float(at_shaft[i]),
            }
            for i in range(len(delta))
        ],
        "notes": [*([] if linear_neck(p).stiffness > 0.0 else [UNSTABLE]), *demand_notes(demand)],
    }
    if theta_p is not None:
        stretched = pretension(p, theta_p, common=large.common_stretch)
        numbers["wanted"] = {
            "pretension_angle_deg": math.degrees(theta_p),
            "neutral_deg": math.degrees(neutral_angle(p, stretched)),
        }
    return numbers


def sensitivity_numbers(rows: Sequence[Sensitivity], figure: Figure9) -> Numbers:
    """Put normalised sensitivities and the curves of Fig. 9 into numbers, keys with units."""
    return {
        "sensitivities": [
            {
                "symbol": row.symbol,
                "name": PARAMETERS[row.symbol].name,
                "value": row.value,
                "unit": PARAMETERS[row.symbol].unit,
                **{f"{name}_percent_per_percent": getattr(row, name) for name in FIGURES},
            }
            for row in rows
        ],
        "figure_9": [
            {
                "symbol": panel.symbol,
                "unit": panel.unit,
                "curves": [
                    {
                        "value": curve.value,
                        "gamma": curve.neck.gamma,
                        "stable": curve.stable,
                        **step_numbers(curve.figures),
                        "steady_state_deg_per_V": math.degrees(curve.figures.steady_state),
                    }
                    for curve in panel.curves
                ],
            }
            for panel in figure.panels
        ],
    }


def power_numbers(use: PowerUse) -> Numbers:
    """Put energy and power of each nod and the fitted source into numbers, keys with units."""
    source = use.source
    sigmas = np.sqrt(np.diag(source.covariance))
    return {
        "nods": [
            {
                "start_s": nod.start,
                "end_s": nod.end,
                "energy_J": nod.energy,
                "charge_A_s": nod.charge,
                "mean_power_W": nod.mean_power,
                "peak_power_W": nod.peak_power,
                "peak_current_A": nod.peak_current,
                "lowest_voltage_V": nod.lowest_voltage,
            }
            for nod in use.nods
        ],
        "source": {
            "open_voltage_V": {"value": source.open_voltage, "sigma": float(sigmas[0])},
            "resistance_ohm": {"value": source.resistance, "sigma": float(sigmas[1])},
            "correlation": float(source.covariance[0, 1] / sigmas.prod()) if sigmas.all() else 0.0,
            "residual_V": source.residual,
            "current_range_A": list(source.range),
            "greatest_power_W": source.greatest_power,
        },
        "idle_power_W": use.idle_power,
        "servos": SERVOS,
        "all_servos_W": use.all_servos,
    }


def without_dust(value: Any) -> Any:
    """Round every float in nested numbers to 12 significant digits: what is beyond is the arithmetic's."""
    if isinstance(value, dict):
        return {key: without_dust(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_dust(item) for item in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value


def step_numbers(figures: StepFigures) -> Numbers:
    """Return rise, overshoot and settling of a step as ``model.json`` has them."""
    return {
        "rise_time_s": figures.rise_time,
        "overshoot": figures.overshoot,
        "overshoot_percent": 100.0 * figures.overshoot,
        "settling_time_s": figures.settling_time,
    }
