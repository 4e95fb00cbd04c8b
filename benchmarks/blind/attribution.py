"""Measures how often the loop's verdict is right on randomly drawn sessions, effect by effect.

    .venv/bin/python -m benchmarks.blind.attribution --seeds 20 --out build/attribution.jsonl
    .venv/bin/python -m benchmarks.blind.attribution --summary build/attribution.jsonl

A session is one line of the file. A run with an existing file continues it.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from anglecam.loop.close import close_records
from benchmarks.blind.drawn import LEDGER, OUTSIDE, Keys, draw
from benchmarks.blind.judged import Line, judge, read_lines, show, true_values
from benchmarks.blind.sessions import HELD_OUT, residual_deg, scaled, session, spec_of

SIGMA_DEG = 0.05
PAIRS = (
    ("dead_time", "coulomb_friction"),
    ("actuator_lag", "stiffening_spring"),
    ("rate_limit", "camera_tilt"),
    ("backlash", "quadratic_drag"),
    ("dead_zone", "pivot_offset"),
    ("torque_saturation", "angle_drift"),
    ("clock_scale", "coulomb_friction"),
    ("gravity_geometry", "rolling_shutter"),
)
"""Pairs from different stages of the signal path; every kind of port occurs."""
KINDS = ("coloured", "heavy-tailed", "quantised")
"""Kinds of noise other than white."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Case:
    """The effects of a session, and their size."""

    name: str
    group: str
    effects: tuple[str, ...] = ()
    ratio: float = 1.0
    """Residual of the base model without noise, over the noise."""
    noise: str = "white"
    """Kind of noise, as in `session`."""


CASES = {
    case.name: case
    for case in (
        *(Case(name, "one effect, as large as the noise", (name,)) for name in LEDGER),
        *(Case(f"{name}/4", "one effect, a quarter of the noise", (name,), 0.25) for name in LEDGER),
        *(Case("+".join(pair), "two effects, each as large as the noise", pair) for pair in PAIRS),
        Case("nothing", "nothing missing, white noise"),
        *(Case(f"nothing-{kind}", f"nothing missing, {kind} noise", noise=kind) for kind in KINDS),
        *(Case(f"{name}-quantised", "one effect, quantised angles", (name,), noise="quantised") for name in LEDGER),
        *(Case(name, "outside the ledger, as large as the noise", (name,)) for name in OUTSIDE),
    )
}


def run(name: str, seed: int) -> Line:
    """Draw a session, close the loop on it and compare the verdict with the truth; the line records any failure."""
    case = CASES[name]
    line: Line = {"case": name, "seed": seed}
    try:
        drawn: dict[str, Keys] = {}
        for effect in case.effects:
            drawn |= draw(effect, seed)
        effects = scaled(drawn, seed, case.ratio, sigma_deg=SIGMA_DEG)
        records = session(effects, seed=seed, sigma_deg=SIGMA_DEG, noise=case.noise)
        values = true_values(spec_of(effects, seed=seed), effects)
        start = time.perf_counter()
        verdict = close_records(records, held_out=HELD_OUT, seed=seed)
        line["seconds"] = time.perf_counter() - start
        line |= judge(verdict, case.effects, values, SIGMA_DEG)
        line |= {"effects": effects, "base_over_sigma": residual_deg(effects, seed) / SIGMA_DEG}
    except Exception as error:  # noqa: BLE001  # a failed session must not stop the others
        line["error"] = f"{type(error).__name__}: {error}"
    return line


def main(
    seeds: Annotated[int, typer.Option(help="Sessions per case.")] = 20,
    first: Annotated[int, typer.Option(help="Seed of the first session.")] = 0,
    cases: Annotated[str, typer.Option(help="Comma-separated names of cases; all by default.")] = "",
    processes: Annotated[int, typer.Option(min=1)] = 2,
    out: Annotated[Path, typer.Option(help="File of lines to which results are appended.")] = Path(
        "build/attribution.jsonl"
    ),
    summary: Annotated[Path | None, typer.Option(help="Only summarise this file.")] = None,
) -> None:
    """Run sessions and summarise them."""
    console = Console(width=None if Console().is_terminal else 200)
    if summary is None:
        names = cases.split(",") if cases else list(CASES)
        if unknown := [name for name in names if name not in CASES]:
            raise typer.BadParameter(f"unknown case {unknown[0]}; the cases are {', '.join(CASES)}")
        _run_all([(name, seed) for seed in range(first, first + seeds) for name in names], processes, out, console)
    order = list(CASES)
    lines = sorted(read_lines(summary or out), key=lambda line: (order.index(line["case"]), line["seed"]))
    show(lines, lambda line: CASES[line["case"]].group, console)


def _run_all(jobs: list[tuple[str, int]], processes: int, out: Path, console: Console) -> None:
    out.parent.mkdir(parents=True, exist_ok=True)
    kept = [line for line in read_lines(out) if "error" not in line]
    out.write_text("".join(json.dumps(line) + "\n" for line in kept), encoding="utf-8")
    done = {(line["case"], line["seed"]) for line in kept}
    left = [job for job in jobs if job not in done]
    for name in THREADS:  # read when a worker loads the libraries: one core per worker
        os.environ[name] = "1"
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with (
        ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool,
        Progress(*columns, console=console) as progress,
        out.open("a", encoding="utf-8") as stream,
    ):
        task = progress.add_task("sessions", total=len(left))
        for future in as_completed([pool.submit(run, *job) for job in left]):
            line = future.result()
            stream.write(json.dumps(line) + "\n")
            stream.flush()
            said = line.get("error") or " + ".join(line["found"]) or line["verdict"]
            progress.update(task, advance=1, description=f"{line['case']} {line['seed']}: {said}"[:70])


if __name__ == "__main__":
    typer.run(main)
