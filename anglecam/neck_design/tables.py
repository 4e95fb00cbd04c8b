"""The tables of `anglecam neck` in the terminal, from its numbers: the mechanism itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from rich.table import Table

from anglecam.neck_design.numbers import Numbers

_ROUNDING = 1e-12
"""Of a value, below which its standard uncertainty is the arithmetic's and the value counts as exact."""
FIGURE_COLUMNS = ("rise, s", "overshoot, %", "settling, s")


def kinematics_tables(n: Numbers) -> list[Table]:
    """Tabulate Table 3, limits and what else the links do, the commands of wanted nods, and turning."""
    rows = (
        (
            row["position"], f"{row['counts']:+d}", str(row["command"]), say(row["theta_s_deg"], 1),
            say(row["theta_f_deg"], 2), say(row["nod_deg"], 2), say(row["theta_f_line_deg"], 2),
            say(row["nod_line_deg"], 2), say(row["slope"], 3), say(row["transmission_angle_deg"], 1),
            say(row["resolution_deg_per_count"], 3),
        )
        for row in n["table_3"]
    )  # fmt: skip
    columns = (
        "Table 3", "counts", "command", "θ_s, °", "θ_f exact, °", "Δθ exact, °", "θ_f line, °", "Δθ line, °", "γ exact",
        "μ, °", "°/count",
    )  # fmt: skip
    line, found, worst = n["line"], n["limits"], n["worst_transmission_angle"]
    facts = [
        (
            "straight line, Fig. 4",
            f"θ_f = {say(line['slope'], 4)}·θ_s + {say(line['intercept_deg'], 2)}°, R² = {say(line['r_squared'], 4)} "
            f"over θ_s = {span(line['range_deg'], 0)}",
        ),
        ("γ of the equations of motion", f"{say(n['gamma'], 4)}, {n['gamma_from']}"),
        ("class of the linkage (Grashof)", found["grashof"]),
        ("θ_f between dead centres", span(found["theta_f_deg"])),
        ("θ_s between dead centres", span(found["theta_s_deg"])),
        ("nod that commands reach", span(found["nod_deg"])),
        (
            "worst transmission angle",
            f"μ = {say(worst['transmission_angle_deg'], 1)}° at θ_s = {say(worst['theta_s_deg'], 1)}°",
        ),
    ]
    turning, bearing = n["turning"], n["bearing"]
    ends, neutral, _ = turning["slope_at_ends_and_neutral"]
    facts += [
        ("turning range", span(turning["range_deg"])),
        ("turning slope dφ/ds", f"{say(neutral, 3)} at neutral, {say(ends, 3)} at the ends"),
        ("slot of the turning mechanism", f"{say(1e3 * turning['slot_m'], 1)} mm"),
        ("bearing torque, Eq. (4)", _torque(bearing["torque_N_m"], bearing["torque_kgf_cm"])),
        ("starting torque of the bearing", _torque(bearing["start_torque_N_m"], bearing["start_torque_kgf_cm"])),
    ]
    tables = [table(columns, rows), pairs("mechanism", facts)]
    if n["wanted"]:
        wanted = (
            (
                say(w["nod_deg"], 2), say(w["theta_s_deg"], 2), str(w["command"]), say(w["theta_s_of_command_deg"], 2),
                say(w["nod_of_command_deg"], 2), say(w["error_deg"], 3),
            )
            for w in n["wanted"]
        )  # fmt: skip
        heads = ("wanted nod, °", "θ_s for it, °", "command", "its θ_s, °", "its nod, °", "off by, °")
        tables.append(table(heads, wanted, text=0))
    return tables


def statics_tables(n: Numbers) -> list[Table]:
    """Tabulate balance, pretension and spring against weight."""
    spring, weight, servo, film = n["spring"], n["weight"], n["servo"], n["film"]
    before = spring["stretch_before_m"]
    facts = [
        ("spring K·L2·L6", f"{say(spring['stiffness_N_m'], 3)} N·m/rad"),
        ("weight M_h·g·L", _torque(weight["moment_N_m"], weight["moment_kgf_cm"])),
        ("weight at neutral", f"{say(weight['at_neutral_N_m'], 3)} N·m"),
        ("spring and weight, Eq. (25)", f"{say(n['stiffness_of_spring_and_weight_N_m'], 3)} N·m/rad"),
        ("pretension angle θ_p, Eq. (24)", f"{say(n['pretension_angle_deg'], 2)}° from upright"),
        (
            "stretch at neutral",
            f"{say(1e3 * spring['stretch_behind_m'], 2)} mm"
            + ("" if before is None else f" behind, {say(1e3 * before, 2)} mm before"),
        ),
        ("where two springs stay taut", f"common stretch ≥ {say(1e3 * spring['least_common_stretch_m'], 1)} mm"),
        ("torque left at neutral", f"{say(n['torque_at_neutral_N_m'], 3)} N·m"),
        ("head rests at", f"{say(n['neutral_deg'], 2)}° from neutral"),
        (
            f"servo at {say(servo['supply_V'], 0)} V",
            f"stall torque {say(servo['stall_torque_N_m'], 3)} N·m, "
            f"c3 = {say(servo['torque_gain_N_m_per_V'], 3)} N·m/V",
        ),
        demand_fact(n["demand"]),
        (
            "damping C of the film, Eq. (22)",
            f"{film['damping_N_m_s']:.3g} N·m·s; with SAE 20 oil {film['damping_of_SAE_20_N_m_s']:.2g} N·m·s",
        ),
    ]
    if "wanted" in n:
        wanted = n["wanted"]
        facts.append(
            (
                f"with θ_p = {say(wanted['pretension_angle_deg'], 2)}°",
                f"it rests at {say(wanted['neutral_deg'], 2)}° from neutral",
            )
        )
    columns = (
        "Δθ, °",
        "spring, N·m",
        "weight, N·m",
        "left to the servo, N·m",
        "small angles, N·m",
        "held by, V",
        "at the shaft, N·m",
    )
    keys = (
        "spring_N_m", "weight_N_m", "residual_N_m", "small_angle_N_m", "holding_voltage_V", "torque_at_shaft_N_m",
    )  # fmt: skip
    curve = ((say(row["nod_deg"], 0), *(say(row[key], 3) for key in keys)) for row in n["curve"])
    return [pairs("statics", facts), table(columns, curve, text=0)]


def demand_fact(demand: Numbers) -> tuple[str, str]:
    """Say what torque the servo has to hold at its shaft, beside what it has."""
    asked, stall = demand["torque_at_shaft_N_m"], demand["stall_torque_N_m"]
    return (
        f"servo torque at {say(demand['nod_deg'], 0)}° (shaft)",
        f"{say(asked, 3)} N·m of {say(stall, 3)} N·m at stall: {'exceeded' if asked > stall else 'holds'}",
    )


def sensitivity_tables(n: Numbers) -> list[Table]:
    """Tabulate normalised sensitivities and the figures of Fig. 9's curves."""
    keys = ("rise_time", "overshoot", "settling_time", "steady_state")
    rows = (
        (
            row["symbol"], row["name"], amount(row["value"], row["unit"]),
            *(say(row[f"{key}_percent_per_percent"], 3) for key in keys),
        )
        for row in n["sensitivities"]
    )  # fmt: skip
    columns = ("% for 1 % of", "", "value", "rise", "overshoot", "settling", "gain")
    curves = (
        (
            f"{panel['symbol']} = {amount(curve['value'], panel['unit'])}", say(curve["gamma"], 3), *step_cells(curve),
            say(curve["steady_state_deg_per_V"], 2),
        )
        for panel in n["figure_9"]
        for curve in panel["curves"]
    )  # fmt: skip
    named = ("Fig. 9", "γ", *FIGURE_COLUMNS, "gain, °/V")
    return [table(columns, rows, text=2), table(named, curves)]


def power_tables(n: Numbers) -> list[Table]:
    """Tabulate energy and power of each nod and the source."""
    rows = (
        (
            f"{say(nod['start_s'], 3)} … {say(nod['end_s'], 3)}", say(nod["energy_J"], 3), say(nod["mean_power_W"], 3),
            say(nod["peak_power_W"], 3), say(nod["peak_current_A"], 3), say(nod["lowest_voltage_V"], 3),
        )
        for nod in n["nods"]
    )  # fmt: skip
    columns = ("nod, s", "energy, J", "mean, W", "peak, W", "peak, A", "lowest, V")
    source = n["source"]
    facts = [
        ("source V0", f"{with_sigma(source['open_voltage_V'])} V"),
        ("source R", f"{with_sigma(source['resistance_ohm'])} Ω"),
        ("scatter about it", f"{say(source['residual_V'], 3)} V"),
        ("most a load can draw", f"{say(source['greatest_power_W'], 3)} W"),
        ("between nods", f"{say(n['idle_power_W'], 3)} W"),
        (f"all {n['servos']} servos at once", f"{say(n['all_servos_W'], 1)} W"),
    ]
    return [table(columns, rows), pairs("power", facts)]


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], *, text: int = 1) -> Table:
    """Lay out rows, the first ``text`` columns words and the others numbers."""
    made = Table()
    for i, name in enumerate(columns):
        made.add_column(name, justify="left" if i < text else "right", no_wrap=i == 0)
    for row in rows:
        made.add_row(*row)
    return made


def pairs(name: str, facts: Iterable[Sequence[str]]) -> Table:
    """Lay out names and what is said of them."""
    made = Table(name, "")
    for fact in facts:
        made.add_row(*fact)
    return made


def step_cells(n: Numbers) -> tuple[str, str, str]:
    """Say rise, overshoot and settling; see `FIGURE_COLUMNS`."""
    return say(n["rise_time_s"], 3), say(n["overshoot_percent"], 1), say(n["settling_time_s"], 3)


def say(value: Any, digits: int) -> str:
    """Write a number; a dash for what is not known, no sign for what rounds to zero."""
    if value is None or not math.isfinite(value):
        return "∞" if value == math.inf else "–"
    return f"{round(float(value), digits) + 0.0:.{digits}f}".replace("-", "−")


def span(ends: Sequence[float], digits: int = 2) -> str:
    """Write a range of angles in degrees."""
    return f"{say(ends[0], digits)}° … {say(ends[1], digits)}°"


def amount(value: float, unit: str) -> str:
    """Write a quantity of any magnitude."""
    return f"{value:.4g}{'' if unit == '1' else ' ' + unit}".replace("-", "−")


def with_sigma(quantity: Numbers) -> str:
    """Write a value to the second digit of its uncertainty, or to four where it has none."""
    value, sigma = quantity["value"], quantity["sigma"]
    if sigma is None or not _ROUNDING * abs(value) < sigma < math.inf:
        return f"{value:.4g}".replace("-", "−")
    digits = max(0, 1 - math.floor(math.log10(sigma)))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}".replace("-", "−")


def _torque(newton_metres: float, kilogram_centimetres: float) -> str:
    return f"{newton_metres:.3g} N·m ({kilogram_centimetres:.3g} kgf·cm)"
