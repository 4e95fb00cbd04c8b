"""Measures the share of the error that the best single effect leaves: a wrong one, and one of two causes.

    PYTHONPATH=.:tests .venv/bin/python -m benchmarks.blind.standing --seeds 3 --first 10 --out build/standing.jsonl

Where structure remains, `anglecam.loop.standing` lets an effect stand if it leaves no more than a share of the held-out
error beyond the noise. In the first group the cause is outside the ledger. In the second an effect of the ledger acts
beside such a cause, whose error is a third as large; a session counts if that effect is the best one.
"""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anglecam.data.record import Record
from anglecam.loop.close import begin
from anglecam.loop.cross_validation import split_records
from anglecam.loop.policy import DEFAULT
from anglecam.loop.standing import error_beyond_noise
from anglecam.loop.stepwise import assess, rank_candidates
from benchmarks.blind.attribution import THREADS
from benchmarks.blind.drawn import OUTSIDE, draw
from benchmarks.blind.judged import Line, read_lines
from benchmarks.blind.sessions import HELD_OUT, scaled, session
from support.outside import CAUSES, outside_session

SIGMA_DEG = 0.05
TIMES_NOISE = 5.0
"""Base model's residual over the noise, of a cause of `synth`; those of the tests have the size that they draw."""
BESIDE = (
    "coulomb_friction", "dead_time", "backlash", "stiffening_spring", "rate_limit", "load_dependent_friction",
)  # fmt: skip
"""Effects that act beside another cause."""
MINOR = ("hysteresis_spring", "detent", "shifted_load")
"""Causes beside which they act, by the seed."""


def run(group: str, name: str, seed: int) -> Line:
    """Rank the candidates of a session and note what the best one leaves; the line records any failure."""
    line: Line = {"group": group, "case": name, "seed": seed}
    try:
        records = [
            replace(one, sigma=np.full(len(one.time), np.radians(SIGMA_DEG))) for one in _records(group, name, seed)
        ]
        fitted, predicted = split_records(records, HELD_OUT)
        task, base = begin(fitted, predicted, (), np.random.default_rng(seed), lambda stage: None, DEFAULT)
        first = assess(task, base)
        best = rank_candidates(task, first)[0]
        assert best.held_out is not None
        noise = task.noise_within(base)
        share = error_beyond_noise(best.held_out, noise) / error_beyond_noise(first.held_out, noise)
        line |= {"best": best.effect.id, "share": share}
    except Exception as error:  # noqa: BLE001  # a failed session must not stop the others
        line["error"] = f"{type(error).__name__}: {error}"
    return line


def _records(group: str, name: str, seed: int) -> Sequence[Record]:
    if name in CAUSES:
        return outside_session(name, seed, sigma_deg=SIGMA_DEG)
    effects = scaled(draw(name, seed), seed, TIMES_NOISE, sigma_deg=SIGMA_DEG)
    if group == "beside":
        minor = draw(MINOR[seed % len(MINOR)], seed)
        effects |= scaled(minor, seed, TIMES_NOISE / 3.0, sigma_deg=SIGMA_DEG)
    return session(effects, seed=seed, sigma_deg=SIGMA_DEG)


def main(
    seeds: Annotated[int, typer.Option(help="Sessions per case.")] = 3,
    first: Annotated[int, typer.Option(help="First seed.")] = 0,
    processes: Annotated[int, typer.Option(min=1)] = 2,
    out: Annotated[Path, typer.Option(help="File of results.")] = Path("build/standing.jsonl"),
) -> None:
    """Run the sessions and print the shares in their order."""
    cases = [("outside", name) for name in (*CAUSES, *OUTSIDE)] + [("beside", name) for name in BESIDE]
    out.parent.mkdir(parents=True, exist_ok=True)
    done = {(line["group"], line["case"], line["seed"]) for line in (read_lines(out) if out.exists() else [])}
    jobs = [(*case, seed) for seed in range(first, first + seeds) for case in cases]
    for name in THREADS:
        os.environ[name] = "1"
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as pool, out.open("a", encoding="utf-8") as stream:
        for future in as_completed([pool.submit(run, *job) for job in jobs if job not in done]):
            stream.write(json.dumps(future.result()) + "\n")
            stream.flush()
    show([line for line in read_lines(out) if first <= line["seed"] < first + seeds])


def show(lines: list[Line]) -> None:
    """Print what wrong effects leave, from the least on, and what right ones leave, from the most on."""
    for group in ("outside", "beside"):
        of_group = [line for line in lines if line["group"] == group and "error" not in line]
        judged = [line for line in of_group if group == "outside" or line["best"] == line["case"]]
        judged.sort(key=lambda line: line["share"], reverse=group == "beside")
        print(f"{group}: {len(judged)} of {len(of_group)} sessions")
        for line in judged[:12]:
            print(f"  {line['share']:.3f} {line['case']} {line['seed']}: {line['best']}")


if __name__ == "__main__":
    typer.run(main)
