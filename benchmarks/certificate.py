"""Measures how often the intervals and bounds of a certificate hold the truth, and how wide they are.

    .venv/bin/python -m benchmarks.certificate --seeds 5 --out build/certificate.jsonl

Each session of five recordings with noise of 0.05° comes from `synth`, has one effect of a plain size drawn from its
seed, or none, and is certified. A session is one line of the file; a run with an existing file continues it. The table
counts, for the quantity whose effect acts, the intervals that hold its true size and, for the others, those that hold
absence.
"""

from __future__ import annotations

import json
import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from anglecam.certificate.certify import Certified, certify
from anglecam.certificate.quantity import QUANTITIES
from anglecam.loop.close import close_records
from benchmarks.blind.judged import read_lines
from benchmarks.blind.sessions import HELD_OUT, session

Keys = dict[str, float]


def _friction(rng: np.random.Generator) -> Keys:
    torque = rng.uniform(1.0, 3.0)
    return {"torque": torque, "breakaway": torque * rng.uniform(1.1, 1.6)}


SIZES: dict[str, Callable[[np.random.Generator], Keys]] = {
    "backlash": lambda rng: {"half_width_deg": rng.uniform(0.15, 0.5)},
    "coulomb_friction": _friction,
    "dead_time": lambda rng: {"tau_s": rng.uniform(0.01, 0.04)},
    "actuator_lag": lambda rng: {"tau_s": rng.uniform(0.01, 0.04)},
    "rate_limit": lambda rng: {"r_deg_per_s": rng.uniform(150.0, 500.0)},
    "torque_saturation": lambda rng: {"limit": rng.uniform(60.0, 120.0), "share": rng.uniform(0.4, 1.0)},
}
"""Plain sizes of the effects, by their ids, as the specs of `synth` state them."""
CASES = ("nothing", *SIZES)
"""What acts in a session; the place of a case is part of its seed."""


def truths(case: str, keys: Keys) -> dict[str, float]:
    """Return the true value of every quantity, in the unit of its key; infinite for a limit that is not there."""
    true = {one.id: math.inf if one.is_limit else 0.0 for one in QUANTITIES}
    present = {
        "backlash": lambda: {"backlash": 2.0 * keys["half_width_deg"]},
        "coulomb_friction": lambda: {
            "coulomb_friction": math.degrees(keys["torque"]),
            "breakaway_friction": math.degrees(keys["breakaway"]),
        },
        "dead_time": lambda: {"dead_time": keys["tau_s"]},
        "actuator_lag": lambda: {"lag": keys["tau_s"]},
        "rate_limit": lambda: {"speed_limit": keys["r_deg_per_s"]},
        "torque_saturation": lambda: {"torque_limit": math.degrees(keys["limit"])},
    }
    return true | (present[case]() if case in present else {})


def judged(one: Certified, truth: float) -> dict[str, Any]:
    """Return the state, the interval and whether it holds the truth."""
    low, high = one.quantity.interval_in_file(*one.interval)
    value = None if one.profile is None else one.quantity.in_file(one.profile.estimate)
    holds = None if one.state == "not_determined" else low <= truth <= high
    return {"state": one.state, "true": truth, "value": value, "low": low, "high": high, "holds": holds}


def run(case: str, seed: int) -> dict[str, Any]:
    """Draw, close and certify one session; no two have the same plant, commands or noise."""
    number = len(CASES) * seed + CASES.index(case)
    keys = SIZES[case](np.random.default_rng([number, 1])) if case in SIZES else {}
    records = session({case: keys} if keys else {}, seed=number)
    start = time.perf_counter()
    verdict = close_records(records, held_out=HELD_OUT, seed=seed)
    closed = time.perf_counter()
    certificate = certify(verdict)
    true = truths(case, keys)
    return {
        "case": case,
        "seed": seed,
        "keys": keys,
        "verdict": verdict.verdict,
        "found": [a.alias_set for a in verdict.accepted],
        "close_s": closed - start,
        "certify_s": time.perf_counter() - closed,
        "quantities": {one.quantity.id: judged(one, true[one.quantity.id]) for one in certificate.quantities},
    }


def table(lines: list[dict[str, Any]]) -> str:
    """Return the table of the result in Markdown."""
    heads = (
        "quantity",
        "present",
        "interval holds the size",
        "median half-width ÷ size",
        "absent",
        "holds absence",
        "median bound",
    )
    rows = ["| " + " | ".join(heads) + " |", "| --- " * len(heads) + "|"]
    for quantity in QUANTITIES:
        each = [line["quantities"][quantity.id] for line in lines]
        present = [q for q in each if math.isfinite(q["true"]) and q["true"] != 0.0]
        absent = [q for q in each if q not in present]
        measured = [q for q in present if q["state"] == "measured"]
        widths = [0.5 * (q["high"] - q["low"]) / q["true"] for q in measured]
        bounds = [q["low"] if quantity.is_limit else q["high"] for q in absent if q["state"] == "bounded"]
        sign = "above" if quantity.is_limit else "below"
        cells = [
            quantity.name,
            f"measured in {len(measured)} of {len(present)}",
            _share(present),
            f"{statistics.median(widths):.2g}" if widths else "–",
            str(len(absent)),
            _share(absent),
            f"{sign} {statistics.median(bounds):.3g}{quantity.unit}" if bounds else "–",
        ]
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _share(each: list[dict[str, Any]]) -> str:
    stated = [q["holds"] for q in each if q["holds"] is not None]
    return f"{sum(stated)} of {len(stated)}"


def main(
    seeds: Annotated[int, typer.Option(help="Sessions per case.")] = 5,
    first: Annotated[int, typer.Option(help="First seed.")] = 0,
    out: Annotated[Path, typer.Option(help="File of results.")] = Path("build/certificate.jsonl"),
) -> None:
    """Certify the sessions and print the table."""
    out.parent.mkdir(parents=True, exist_ok=True)
    done = {(line["case"], line["seed"]) for line in read_lines(out)}
    for seed in range(first, first + seeds):
        for case in CASES:
            if (case, seed) not in done:
                with out.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(run(case, seed)) + "\n")
    print(table(read_lines(out)))


if __name__ == "__main__":
    typer.run(main)
