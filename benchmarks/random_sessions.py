"""Close or identify random sessions of angle series: each must end in a result or in one line that names the cause.

    PYTHONPATH=. .venv/bin/python -m benchmarks.random_sessions [2000] [--command close] [--seed 1] [--first 0]

A session has one to eight recordings of a plant that swings, creeps, drifts or runs away, or of no plant at all. Their
rows may be few, irregular, missing, doubled, quantised, without noise, or a million times too large or too small, and
their commands constant, out of range or absent. A number's session depends on seed and number alone. The command line's
function runs in a separate process with limits on time and memory. Its findings are any exception that is not one line,
a warning, a part that is missing beside the verdict, and too much time or memory.
"""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.linalg import expm

from benchmarks.fuzz.trial import DIED, FINDING, REFUSED, RESULT, Reader, Trial, arguments

SECONDS, MOST_BYTES = 120.0, 2048 * 2**20
COMMANDS = ("close", "ekf", "oe2", "oe3")
VERDICTS = ("attributed", "nothing_missing", "partly_explained", "unexplained")
LARGEST_DEG = 1e11
"""Of an angle that is written; a plant that runs away further stays there."""

Floats = np.ndarray
Rng = np.random.Generator

PLANTS: dict[str, Callable[[Rng], tuple[float, float]]] = {
    "damped": lambda rng: _poles(rng, rng.uniform(0.05, 0.9)),
    "overdamped": lambda rng: _poles(rng, rng.uniform(1.0, 5.0)),
    "hardly damped": lambda rng: _poles(rng, 10.0 ** rng.uniform(-5, -2)),
    "drifting": lambda rng: (10.0 ** rng.uniform(-2, 2), 0.0),
    "falling over": lambda rng: (rng.uniform(0, 5), -(10.0 ** rng.uniform(-1, 2))),
    "growing": lambda rng: _poles(rng, -rng.uniform(0.01, 0.5)),
    "stiff": lambda rng: (10.0 ** rng.uniform(2, 4), 10.0 ** rng.uniform(4, 6)),
}
"""a (1/s) and b (1/s²) by the name of the plant."""
OTHERS: dict[str, Callable[[Rng, int], Floats]] = {
    "constant": lambda rng, n: np.full(n, rng.choice([0.0, 1.0, -7.25])),
    "noise alone": lambda rng, n: rng.normal(size=n),
    "random walk": lambda rng, n: np.cumsum(rng.normal(size=n)),
    "straight line": lambda rng, n: np.linspace(0.0, rng.normal(), n),
    "one jump": lambda rng, n: (np.arange(n) >= rng.integers(0, n + 1)).astype(float),
    "one outlier": lambda rng, n: (np.arange(n) == rng.integers(0, n + 1)).astype(float),
    "two values": lambda rng, n: rng.integers(0, 2, n).astype(float),
}
"""Angles that no plant made, by name."""


def _poles(rng: Rng, ratio: float) -> tuple[float, float]:
    natural = 10.0 ** rng.uniform(-0.5, 2.0)
    return 2.0 * ratio * natural, natural**2


def write_random_session(folder: Path, seed: int, number: int) -> str:
    """Write one session and return the name of its plant, or of what takes the plant's place."""
    rng = np.random.default_rng([seed, number])
    kind = str(rng.choice([*PLANTS, *OTHERS]))
    plant = PLANTS[kind](rng) if kind in PLANTS else None
    count = int(rng.choice([1, 2, 3, 8], p=[0.6, 0.25, 0.13, 0.02]))
    names = [f"r{i}" for i in range(count)]
    scale = 10.0 ** (rng.uniform(-6, 5) if rng.random() < 0.3 else rng.uniform(0, 1.5))
    style = {
        "noise": rng.choice([0.0, 10.0 ** rng.uniform(-5, -0.5)]),
        "step": rng.choice([0.0, 0.0, 0.0, 10.0 ** rng.uniform(-4, 0)]),
        "sigma": rng.choice(["none", "none", "true", "zero", "tiny", "huge", "partly", "varied"]),
        "driven": rng.choice([0.0, 0.5, 1.0, 1.0]),
    }
    folder.mkdir(parents=True)
    for name in names:
        _write_recording(rng, folder, name, kind, plant, scale, style)
    rig = _rig(rng, names)
    if rig or rng.random() < 0.5:
        (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    return kind


def _write_recording(
    rng: Rng,
    folder: Path,
    name: str,
    kind: str,
    plant: tuple[float, float] | None,
    scale: float,
    style: dict[str, Any],
) -> None:
    t = _times(rng)
    n = len(t)
    command = _command(rng, t) if rng.random() < style["driven"] else None
    angle = OTHERS[kind](rng, n) if plant is None else _simulated(rng, *plant, t, command)
    noise = style["noise"] * rng.normal(size=n)
    angle = np.clip(scale * (angle + noise) + rng.choice([0.0, 0.0, 30.0, 500.0]), -LARGEST_DEG, LARGEST_DEG)
    step = scale * style["step"]
    angle = np.round(angle / step) * step if step else angle
    missing = rng.random(n) < rng.choice([0.0, 0.05, 0.3, 0.9], p=[0.7, 0.13, 0.13, 0.04])
    sigma = {
        "true": np.full(n, scale * style["noise"]),
        "zero": np.zeros(n),
        "tiny": np.full(n, 1e-9),
        "huge": np.full(n, 1e6),
        "partly": np.where(rng.random(n) < 0.5, 0.1, np.nan),
        "varied": 10.0 ** rng.uniform(-6, 3, n),
    }.get(style["sigma"])
    empty = rng.choice(["", "nan"])
    rows = ["time_s,angle_deg" + ("" if sigma is None else ",sigma_deg")]
    for i in range(n):
        cells = [f"{t[i]:.9g}", empty if missing[i] else f"{angle[i]:.9g}"]
        if sigma is not None:
            cells.append("" if np.isnan(sigma[i]) else f"{sigma[i]:.6g}")
        rows.append(",".join(cells))
    (folder / f"{name}.angles.csv").write_text("\n".join(rows) + "\n")
    if command is not None:
        rows = [f"{when:.9g},{value * min(scale, 1e9):.9g}" for when, value in zip(*command, strict=True)]
        (folder / f"{name}.command.csv").write_text("\n".join(["time_s,command_deg", *rows]) + "\n")


def _times(rng: Rng) -> Floats:
    """Return increasing instants, s; rarely some that are equal, or in milliseconds."""
    shortest, longest = ((0, 20), (20, 60), (60, 200), (200, 2000))[rng.choice(4, p=[0.15, 0.65, 0.19, 0.01])]
    n = int(rng.integers(shortest, longest)) + 1
    steps = np.full(n, 1.0) if rng.random() < 0.5 else rng.exponential(size=n) + 1e-3
    steps[rng.random(n) < rng.choice([0.0, 0.0, 0.02])] = 10.0 ** rng.uniform(0, 3)
    steps[rng.random(n) < rng.choice([0.0, 0.01], p=[0.95, 0.05])] = 0.0
    rate = 10.0 ** rng.uniform(np.log10(5), np.log10(500))
    unit = 1000.0 if rng.random() < 0.02 else 1.0
    return np.cumsum(steps) / rate * unit + rng.choice([0.0, 0.0, 0.0, -5.0, 1e4, 1.7e9])


def _command(rng: Rng, t: Floats) -> tuple[Floats, Floats]:
    """Return instants, s, and values of a command, in units of the session's scale."""
    start, span = t[0], max(t[-1] - t[0], 1e-3)
    m = int(rng.choice([1, 2, 3, 10, 50]))
    at = start + span * np.sort(rng.uniform(-0.1, 1.1, m))
    value = rng.normal(size=m)
    kind = rng.choice(
        ["steps", "steps", "steps", "constant", "zero", "later", "earlier", "samples", "huge", "tiny", "once"]
    )
    if kind == "samples":
        at, value = t.copy(), np.sin(2.0 * np.pi * rng.uniform(0.5, 5) * (t - start) / span)
    at += {"later": 2.0 * span, "earlier": -2.0 * span}.get(kind, 0.0)
    value = {
        "constant": np.full(m, 0.7),
        "zero": np.zeros(m),
        "huge": 1e6 * value,
        "tiny": 1e-9 * value,
        "once": np.where(at > start + 0.5 * span, 1.0, 0.0),
    }.get(kind, value)
    return at, value


def _simulated(rng: Rng, a: float, b: float, t: Floats, command: tuple[Floats, Floats] | None) -> Floats:
    """Return the angle of θ̈ = c·u − a·θ̇ − b·θ, from rest or from a swing; the command is held from row to row."""
    c = rng.choice([abs(b) + 1.0, b, 0.0, -b])
    state = np.array([*(rng.normal(size=2) * rng.choice([0.0, 1.0]) * [1.0, np.sqrt(abs(b)) + 1.0]), 1.0])
    if command is None:
        state[0] += 1.0
        held = np.zeros(len(t))
    else:
        held = command[1][np.maximum(np.searchsorted(command[0], t, side="right") - 1, 0)]
    angle = np.empty(len(t))
    with np.errstate(all="ignore"):
        for i, wait in enumerate(np.diff(t, prepend=t[:1])):
            matrix = np.array([[0.0, 1.0, 0.0], [-b, -a, c * held[i - 1]], [0.0, 0.0, 0.0]])
            moved = expm(np.clip(matrix * wait, -200.0, 200.0)) @ state
            state = np.append(np.clip(np.nan_to_num(moved[:2]), -1e15, 1e15), 1.0)
            angle[i] = state[0]
    return angle


def _rig(rng: Rng, names: list[str]) -> dict[str, Any]:
    """Return what the session's rig file declares; mostly little."""
    rig: dict[str, Any] = {}
    starts = [float(sign * 10.0**power) for sign in (-1, 1) for power in (-6, 0, 2, 6, 12)] + [0.0]
    if rng.random() < 0.3:
        rig["model"] = {key: float(rng.choice(starts)) for key in "abc" if rng.random() < 0.7}
    if rng.random() < 0.15:
        rig.setdefault("model", {})["gravity_deg"] = float(rng.choice([0.0, 90.0, 180.0, 30.0, 1e6]))
    if rng.random() < 0.4:
        rig["neutral"] = float(rng.choice([0.0, 5.0, -1e4]))
    if rng.random() < 0.2:
        rig["source"] = "encoder"
    if rng.random() < 0.3:
        rig["command"] = {"hold": "linear"}
    if rng.random() < 0.15:
        rig["held_out"] = rng.choice(names, size=int(rng.integers(1, len(names) + 1)), replace=False).tolist()
    if rng.random() < 0.1:
        rig["least_measured"] = float(rng.choice([0.0, 0.01, 1.0]))
    return rig


def readers() -> dict[str, Reader]:
    """Return, for each of `COMMANDS`, the function that runs it on a session's folder."""
    import anglecam.identification.ekf
    import anglecam.workflow.session_results  # noqa: F401

    return {command: lambda path, command=command: _run(path, command) for command in COMMANDS}


def _run(path: Path, command: str) -> None:
    """Run a command as the command line does, and raise what it says if it has no result."""
    from anglecam.cli.app import app

    verb = ["close"] if command == "close" else ["identify", "--estimator", command]
    with tempfile.TemporaryDirectory() as name:
        out, said = Path(name), io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            app([*verb, str(path), "--out", name], standalone_mode=False)
        if command == "close":
            result = json.loads((out / "loop.json").read_text())
            if result["missing"] or result["verdict"] not in VERDICTS or not (out / "report.html").exists():
                raise RuntimeError(f"part missing: {result['missing']}")
        elif not (out / "model.json").exists():
            raise RuntimeError(f"no model: {said.getvalue()}")


def _class(kind: str, said: str) -> str:
    """Return the column of an outcome."""
    last = said.strip().splitlines()[-1] if said.strip() else ""
    if kind in (RESULT, REFUSED):
        return {RESULT: "result", REFUSED: "one line"}[kind]
    if "took longer" in last or kind == DIED:
        return "no answer"
    return "warning" if "Warning" in last else "part missing" if "part missing" in last else "internal error"


def main() -> None:
    """Run the sessions; exit status 1 if there is a finding."""
    options = arguments(__doc__, COMMANDS, Path("build/random_sessions"))
    trial = Trial(readers, seconds=SECONDS, most_bytes=MOST_BYTES)
    counts: dict[str, Counter[str]] = {}
    longest, began = 0.0, time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        for number in range(options.first, options.first + options.cases):
            folder = Path(name) / f"{number:05d}"
            kind = write_random_session(folder, options.seed, number)
            start = time.monotonic()
            outcome = trial.run(options.command, folder)
            longest = max(longest, time.monotonic() - start)
            column = _class(outcome.kind, outcome.said)
            counts.setdefault(kind, Counter())[column] += 1
            if outcome.kind in (FINDING, DIED):
                kept = options.keep / f"{options.command}-{folder.name}"
                shutil.copytree(folder, kept, dirs_exist_ok=True)
                (kept / "why.txt").write_text(outcome.said)
                print(f"{kept}: {kind}: {column}: {outcome.said.strip().splitlines()[-1][:200]}", flush=True)
            shutil.rmtree(folder)
    trial.close()
    columns = ("result", "one line", "internal error", "warning", "part missing", "no answer")
    print(f"\n{date.today():%d %B %Y}, {time.monotonic() - began:.0f} s, the longest session {longest:.1f} s\n")
    print(f"| {options.command} | sessions | {' | '.join(columns)} |\n| {' | '.join(['---'] * (2 + len(columns)))} |")
    for kind, count in [*sorted(counts.items()), ("all", sum(counts.values(), Counter()))]:
        print(f"| {kind} | {count.total()} | " + " | ".join(str(count[column]) for column in columns) + " |")
    sys.exit(1 if any(count[column] for count in counts.values() for column in columns[2:]) else 0)


if __name__ == "__main__":
    main()
