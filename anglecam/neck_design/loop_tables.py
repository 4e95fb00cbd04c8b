"""The tables of `anglecam neck` in the terminal, from its numbers: the moving neck."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from anglecam.neck.constraints import shown
from anglecam.neck_design.loop_numbers import UNITS, key_of, spoken_unit
from anglecam.neck_design.numbers import Numbers
from anglecam.neck_design.tables import FIGURE_COLUMNS, amount, demand_fact, pairs, say, step_cells, table, with_sigma

ROUTES = {
    "by_inertia": "known: inertia, spring, weight, C",
    "by_inertia_and_motor": "known: inertia, weight, h, motor",
    "by_motor": "known: motor, spring, weight",
}
SYMBOLS = {
    "inertia": "J + γ·J_r",
    "spring": "K·L2·L6",
    "damping": "C",
    "sensor_gain": "h",
    "torque_gain": "c3",
    "motor_torque_gain": "K_m·G_a/(G_g·R_a)",
    "torque_gain_gap": "difference",
    "back_emf_ratio": "c4",
    "sensor_gain_bound": "h at the bound of Eq. (35)",
    "damping_bound": "C at which c4 = 0",
    "spring_bound": "K·L2·L6 at which h = 0",
    "stiffness": "stiffness b·J, Eq. (35)",
}
"""Of what the routes of `anglecam.neck.design` find."""
_NOTHING = 1e-9
"""In the units of gains."""


def response_tables(n: Numbers) -> list[Table]:
    """Tabulate the models' answers to one step."""
    measured = any("measured_rmse_deg" in m for m in n["models"])
    columns = ["model", f"step of {say(n['step_deg'], 1)}°", *FIGURE_COLUMNS, "comes to rest at, °"]
    columns += ["off the measured, ° RMS"] if measured else []
    rows = (
        [m["name"], m["equation"], *step_cells(m), say(m["steady_state_deg"], 2)]
        + ([say(m.get("measured_rmse_deg"), 3)] if measured else [])
        for m in n["models"]
    )
    return [table(columns, rows, text=2)]


def design_tables(n: Numbers) -> list[Table]:
    """Tabulate what was identified, each route's findings, and a neck made to a wish."""
    found, step = n["identified"], n["step"]
    facts = [(name, f"{with_sigma(found[key_of(name)])} {spoken_unit(name)}") for name in ("a", "b", "c")]
    rise, overshoot, settling = step_cells(step)
    facts.append(("its step", f"rise {rise} s, overshoot {overshoot} %, settling {settling} s"))
    facts.append(("gain", f"{say(step['gain_rad_per_V'], 3)} rad/V"))
    tables = [pairs("step 3: identified", facts)]
    for route in n["routes"]:
        lines = _quantities(route["known"]) if route is n["routes"][0] else []
        lines = [(f"{name} (known)", value) for name, value in lines] + _quantities(route["found"])
        lines.append(("Eq. (35)", "holds" if route["stable"] else "does not hold: the neck falls from neutral"))
        tables.append(pairs(ROUTES.get(route["route"], route["route"]), lines))
    if "synthesis" in n:
        tables += _synthesis(n["synthesis"])
    holds = "the declared neck" if "synthesis" not in n else _made(n["synthesis"])
    return [*tables, pairs(holds, [demand_fact(n["demand"])])]


def contradictions(n: Numbers) -> list[str]:
    """List what is told in plain words: where motion and what is known exclude each other, and what cannot be met."""
    told = [f"{ROUTES.get(r['route'], r['route'])}: {line}" for r in n["routes"] for line in r["contradictions"]]
    return told + [f"the wish: {line}" for line in n.get("synthesis", {}).get("unmet", [])]


def pd_tables(n: Numbers) -> list[Table]:
    """Tabulate closed loops, and gains that were tuned."""
    steady = next(key for key in n["loops"][0] if key.startswith("steady_state"))
    units = n["gain_units"]
    rest = f"steady state, {n['steady_state_unit']}"
    gains = (f"K_p, {units['proportional']}", f"K_d, {units['derivative_s']}")
    columns = (*gains, *FIGURE_COLUMNS, rest, "lost, %", "margin, °", "M_s")
    rows = [_loop(loop, steady) for loop in n["loops"]]
    tables = [table(columns, rows, text=0)]
    tables[0].title, tables[0].title_justify = f"{n['plant']}; {n['gains_of']}", "left"
    if "tuned" in n:
        tuned = n["tuned"]
        tables.append(table(columns, [_loop(tuned, steady)], text=0))
        tables[-1].title, tables[-1].title_justify = f"tuned, {n['plant']}", "left"
        tables.append(_constraints(tuned["constraints"]))
    if "large_angles" in n:
        large = n["large_angles"]
        rise, overshoot, settling = step_cells(large)
        facts = [
            ("rise, overshoot, settling", f"{rise} s, {overshoot} %, {settling} s"),
            ("comes to rest at", f"{say(large['steady_state_deg'], 2)}°"),
            ("peak of the controller", f"{say(large['peak_voltage_V'], 3)} V"),
        ]
        tables.append(pairs("the same gains at large angles, Eq. (31)", facts))
    return tables


def _loop(loop: Numbers, steady: str) -> tuple[str, ...]:
    return (
        f"{_seen(loop['proportional']):.3g}", f"{_seen(loop['derivative_s']):.3g}", *step_cells(loop),
        say(loop[steady], 3), say(loop["loss_percent"], 1), say(loop["phase_margin_deg"], 0),
        say(loop["sensitivity"], 2),
    )  # fmt: skip


def _synthesis(made: Numbers) -> list[Table]:
    rows = [
        (symbol, amount(change["before"], change["unit"]), amount(_seen(change["after"]), change["unit"]))
        for symbol, change in made["changes"].items()
    ]
    links = {symbol: made["neck"][symbol] for symbol in ("L_3", "gamma")}
    rows += [(symbol, "", amount(value["value"], value["unit"])) for symbol, value in links.items()]
    rows.append(("C_i", "", amount(made["command_gain_V_per_rad"], "V/rad")))
    return [table((_made(made), "declared", "after"), rows), _constraints(made["constraints"])]


def _made(made: Numbers) -> str:
    return "made to the wish" if made["feasible"] else "nearest to the wish, which cannot be met"


def _constraints(rows: Sequence[Numbers]) -> Table:
    def line(c: Numbers) -> tuple[str, ...]:
        stands = "missed" if not c["met"] else "met, binds" if c["active"] else "met"
        if not math.isfinite(c["limit"]):
            return c["name"], shown(c["value"], c["unit"]), "–", "not asked"
        return c["name"], shown(c["value"], c["unit"]), f"{c['sense']} {shown(c['limit'], c['unit'])}", stands

    return table(("constraint", "here", "limit", ""), map(line, rows))


def _seen(value: float) -> float:
    """Return zero for what an optimiser left of it."""
    return value if abs(value) > _NOTHING else 0.0


def _quantities(told: Numbers) -> list[tuple[str, str]]:
    names = {key_of(name): name for name in UNITS}
    return [
        (
            SYMBOLS.get(names[key], names[key].replace("_", " ")),
            f"{with_sigma(q)} {spoken_unit(names[key])}".removesuffix(" 1"),
        )
        for key, q in told.items()
    ]
