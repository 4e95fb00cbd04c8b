"""Verdicts on mechanisms that are simulated by other code: MuJoCo, and plain Euler steps of 50 microseconds.

    .venv/bin/python -m benchmarks.mechanisms [--first 0] [--seeds 3] [--only KIND,…] [--no-sigma]

A servo with position control, or a motor with a spring, plays random steps, chirps and staircases; plant, amplitude,
frame rate and the size of what is missing are drawn from the seed. Five series of 10 s with noise of 0.1°, of which the
last is held out. Where no effect of the ledger is right, a verdict is right if it says that something is left.
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anglecam.io.session import read_session
from anglecam.loop.close import close_records
from anglecam.loop.verdict import Verdict
from anglecam.workflow.session import loop_input, measure_session
from benchmarks.blind.simulated import KINDS, SECONDS, Drawn, Played

NOISE_DEG, RECORDINGS = 0.1, 5
LEFT = frozenset({"unexplained", "partly_explained"})


def commands(rng: np.random.Generator, amplitude_deg: float) -> list[Played]:
    """Draw the commands of a session, in turn random steps, a chirp in steps of 20 ms and a staircase."""
    drawn = []
    for i in range(RECORDINGS):
        if i % 3 == 0:
            at = 0.7 + np.cumsum(np.append(0.0, rng.uniform(0.3, 1.2, 40)))
            at = np.append(0.0, at[at < SECONDS - 0.5])
            drawn.append((at, np.append(0.0, rng.uniform(-amplitude_deg, amplitude_deg, len(at) - 1))))
        elif i % 3 == 1:
            at, last = np.arange(0.0, SECONDS, 0.02), rng.uniform(1.5, 3.0)
            phase = 2.0 * np.pi * (0.3 * at + 0.5 * (last - 0.3) * at**2 / SECONDS)
            drawn.append((at, 0.7 * amplitude_deg * np.sin(phase) * (at > 0.5)))
        else:
            level = amplitude_deg * np.array([0, 1, 2, 3, 2, 1, 0, -1, -2, -3, -2, -1, 0]) / 3.0
            drawn.append((np.append(0.0, 0.5 + 0.7 * np.arange(1, len(level))), level))
    return drawn


def write(kind: str, seed: int, session: Path, *, with_sigma: bool) -> None:
    """Simulate a session and write its series and commands."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    amplitude, fps = rng.uniform(10.0, 18.0), rng.choice([30, 50, 60])
    natural, damping = rng.uniform(12.0, 25.0), rng.uniform(0.4, 0.9)
    played = commands(rng, amplitude)
    run = KINDS[kind][0](
        Drawn(rng, np.radians(amplitude), 2.0 * damping * natural, natural**2, rng.uniform(0.85, 1.05))
    )
    for i, command in enumerate(played):
        at, angle = run(command)
        seen = np.arange(0.02, SECONDS - 0.02, 1.0 / fps)
        shown = np.degrees(np.interp(seen, at, angle)) + rng.normal(0.0, NOISE_DEG, len(seen))
        columns, names = [seen, shown], "time_s,angle_deg"
        if with_sigma:
            columns, names = [*columns, np.full(len(seen), NOISE_DEG)], f"{names},sigma_deg"
        for file, head, table in (("angles", names, columns), ("command", "time_s,command_deg", command)):
            np.savetxt(session / f"{i}.{file}.csv", np.column_stack(table), "%.6f", ",", header=head, comments="")
    (session / "rig.yaml").write_text(json.dumps({"source": "encoder", "held_out": [str(RECORDINGS - 1)]}))


def is_right(kind: str, verdict: Verdict) -> bool:
    """Return whether a verdict names what is missing, or says that something is left where no effect is right."""
    right = KINDS[kind][1]
    if not right:
        return verdict.verdict in LEFT
    return {accepted.effect.id for accepted in verdict.accepted} in right and verdict.verdict not in LEFT


def main(
    first: int = 0,
    seeds: int = 3,
    only: Annotated[str, typer.Option(help="Comma-separated kinds; all by default.")] = "",
    sigma: Annotated[bool, typer.Option(help="State the noise in the files.")] = True,
) -> None:
    """Print a row for each session."""
    print("| mechanism | seed | right | verdict | effects | held out ° RMS, before and after | CPU s |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for kind in [each for each in KINDS if not only or each in only.split(",")]:
        for seed in range(first, first + seeds):
            with tempfile.TemporaryDirectory() as place:
                write(kind, seed, Path(place), with_sigma=sigma)
                records = list(loop_input(measure_session(read_session(Path(place)))).records)
            began = time.process_time()
            verdict = close_records(records, held_out=[str(RECORDINGS - 1)])
            took = time.process_time() - began
            found = [accepted.effect.id for accepted in verdict.accepted]
            fits = is_right(kind, verdict)
            before, after = (np.degrees(p.rmse) for p in (verdict.before_held_out, verdict.after_held_out))
            cells = (kind, seed, "yes" if fits else "no", verdict.verdict, ", ".join(found) or "–")
            print(f"| {' | '.join(map(str, cells))} | {before:.3f}, {after:.3f} | {took:.0f} |", flush=True)


if __name__ == "__main__":
    typer.run(main)
