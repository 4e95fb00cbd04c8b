"""Measures the share of the error that is left by effects which only resemble the cause, and by one of several causes.

    PYTHONPATH=.:tests .venv/bin/python -m benchmarks.blind.standing --seeds 4 --first 10 --out build/standing.jsonl

Where structure remains, `anglecam.loop.standing` lets an effect stand if it leaves no more than a share of the held-out
error beyond the noise. Here that share is set to 1, so that every effect stands that helps at all, and what the model
leaves is noted. In the first group the cause is outside the ledger. In the second an effect of the ledger acts beside
such a cause, whose error is a third as large.
"""

from __future__ import annotations

import json
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anglecam.loop.close import close_records
from anglecam.loop.policy import DEFAULT
from anglecam.loop.standing import error_beyond_noise
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
MINOR = ("hysteresis_spring", "detent", "self_excitation")
"""Causes beside which they act, one after another."""
ALL_STAND = replace(DEFAULT, verdict=replace(DEFAULT.verdict, partly_explained_share=1.0))


def run(group: str, name: str, seed: int) -> Line:
    """Close the loop on a session and note what its effects leave; the line records any failure."""
    line: Line = {"group": group, "case": name, "seed": seed}
    try:
        if group == "beside":
            minor = MINOR[seed % len(MINOR)]
            effects = scaled(draw(name, seed), seed, TIMES_NOISE, sigma_deg=SIGMA_DEG)
            effects |= scaled(draw(minor, seed), seed, TIMES_NOISE / 3.0, sigma_deg=SIGMA_DEG)
            records, held_out = session(effects, seed=seed, sigma_deg=SIGMA_DEG), HELD_OUT
            line["beside"] = minor
        elif name in CAUSES:
            records, held_out = outside_session(name, seed, sigma_deg=SIGMA_DEG), ("random",)
        else:
            effects = scaled(draw(name, seed), seed, TIMES_NOISE, sigma_deg=SIGMA_DEG)
            records, held_out = session(effects, seed=seed, sigma_deg=SIGMA_DEG), HELD_OUT
        known = [replace(one, sigma=np.full(len(one.time), np.radians(SIGMA_DEG))) for one in records]
        verdict = close_records(known, held_out=held_out, seed=seed, policy=ALL_STAND)
        noise = verdict.noise
        before, after = (error_beyond_noise(one, noise) for one in (verdict.before_held_out, verdict.after_held_out))
        line |= {
            "verdict": verdict.verdict,
            "found": [sorted({one.effect.id, *one.alias_set}) for one in verdict.accepted],
            "share": after / before if verdict.accepted else 1.0,
        }
    except Exception as error:  # noqa: BLE001  # a failed session must not stop the others
        line["error"] = f"{type(error).__name__}: {error}"
    return line


def main(
    seeds: Annotated[int, typer.Option(help="Sessions per case.")] = 4,
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
    """Print the shares that wrong and right effects leave, in their order."""
    for group in ("outside", "beside"):
        named = sorted((line["share"], line["case"], line["seed"]) for line in lines if _is_judged(line, group))
        print(f"{group}: {len(named)} sessions")
        for share, case, seed in named[:20] if group == "outside" else named[::-1][:20]:
            print(f"  {share:.3f} {case} {seed}")


def _is_judged(line: Line, group: str) -> bool:
    """Return whether a session is of a group, and in the second the effect that acts is named alone."""
    if line["group"] != group or "error" in line:
        return False
    return group == "outside" or [line["case"] in names for names in line["found"]] == [True]


if __name__ == "__main__":
    typer.run(main)
