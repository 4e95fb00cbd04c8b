"""Scores the loop on measured data of published benchmarks, in the form in which each set is published.

    .venv/bin/python -m benchmarks.measured FOLDER [--only NAME,…]

FOLDER holds ``emps``, ``silverbox``, ``servo-logs`` and ``torque-pendulum``. Every error is that of a free run over a
record that was not fitted: only its initial state is, or for EMPS nothing at all. Beside the loop's model stands a fit
by hand: the equation of motion that an expert would write for this mechanism, by SciPy and an integrator of its own.

EMPS: Janot, Gautier, Brunot, Workshop on Nonlinear System Identification Benchmarks, 2019. Silverbox: Wigren,
Schoukens, Three free data sets for development and benchmarking in nonlinear system identification, 2013. Servo logs:
Duclusaud et al., Extended friction models for the physics simulation of servo actuators, arXiv 2410.08650. Pendulum:
Wiebe et al., Torque-limited simple pendulum, JOSS 2022.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from anglecam.io.session import read_session
from anglecam.loop.close import close_records
from anglecam.loop.verdict import Verdict
from anglecam.workflow.session import loop_input, measure_session
from benchmarks.by_hand import RIGHT_SIDES, Series, fit, free_run
from benchmarks.real_data import EVERY, carriage, read_emps, write_emps

Floats = NDArray[np.float64]

SILVERBOX_HZ = 1e7 / 2**14
VOLT_DEG = 100.0
"""A volt of the Silverbox is written as so many degrees."""
ARROW = slice(20_000, 28_000)
"""Samples of the arrow, noise whose amplitude grows: those before it exceeds the multisines."""
MULTISINES, PERIOD = 40_700, 8_192
"""First sample of the multisines, and the length of each with its pause."""
SETTLED = 1_000
"""Samples after which a multisine has settled."""
GAIN = 100
"""Proportional gain of the servo's position control, of the logs that are used."""


PUBLISHED_DRIVE = {
    "M, kg": 95.109,
    "Fv+, N·s/m": 203.5,
    "Fv-, N·s/m": 203.5,
    "Fc+, N": 20.394 - 3.165,
    "Fc-, N": 20.394 + 3.165,
}


@dataclass(frozen=True)
class Mechanism:
    """One set of measured data."""

    write: Callable[[Path, Path], list[str]]
    """Writes a session from the folder of the data; returns the names of the recordings that are held out."""
    hand: str | None
    """Name of the equation of motion in `benchmarks.by_hand`; ``None`` where `real_data.fit_emps` has it."""
    unit: str
    per_deg: float
    """Units in one degree of the session."""
    published: str


def write_silverbox(folder: Path, session: Path) -> list[str]:
    """Write one multisine to fit; another and the arrow's middle, which is no larger, to predict."""
    u, y = np.genfromtxt(folder / "SNLS80mV.csv", delimiter=",", skip_header=1, usecols=(0, 1)).T
    first = MULTISINES + SETTLED
    parts = {
        "multisine": slice(first, first + 4_000),
        "other_multisine": slice(first + 5 * PERIOD, first + 5 * PERIOD + 7_000),
        "arrow": ARROW,
    }
    for name, part in parts.items():
        at = np.arange(part.stop - part.start) / SILVERBOX_HZ
        _write(session, name, at, VOLT_DEG * y[part], at, VOLT_DEG * u[part])
    rig = {"source": "encoder", "command": {"hold": "linear"}, "held_out": ["other_multisine", "arrow"]}
    return _declare(session, rig)


def write_servo(folder: Path, session: Path) -> list[str]:
    """Write logs of an XL330 with a pendulum, all with one gain; the torque is on throughout."""
    names = []
    for path in sorted(folder.glob("*.json")):
        log = json.loads(path.read_text())
        entries = log["entries"]
        if log["kp"] != GAIN or not all(entry["torque_enable"] for entry in entries):
            continue
        columns = ("timestamp", "position", "goal_position")
        at, angle, goal = (np.array([entry[column] for entry in entries]) for column in columns)
        _write(session, log["trajectory"], at - at[0], np.degrees(angle), at - at[0], np.degrees(goal))
        names.append(log["trajectory"])
    return _declare(session, {"source": "encoder", "held_out": names[-1:]})


def write_torque_pendulum(folder: Path, session: Path) -> list[str]:
    """Write a record made to identify the pendulum, and a swing-up to predict."""
    for path in sorted(folder.glob("*.csv")):
        at, angle, _, torque = np.genfromtxt(path, delimiter=",", skip_header=1).T
        name = path.stem.removesuffix("_data_measured")
        _write(session, name, at, np.degrees(angle), at, np.degrees(torque))
    return _declare(session, {"source": "encoder", "neutral": 0.0, "held_out": ["energy_shaping"]})


def write_motor_drive(folder: Path, session: Path) -> list[str]:
    write_emps(folder, session)
    return ["DATA_EMPS_PULSES"]


MECHANISMS = {
    "emps": Mechanism(write_motor_drive, None, "mm", 0.0, "9.2 with the published parameters; neural 74 to 220"),
    "silverbox": Mechanism(write_silverbox, "cubic", "mV", 1e3 / VOLT_DEG, "0.3 to 0.5, grey box; other parts"),
    "servo-logs": Mechanism(write_servo, "servo", "°", 1.0, "1.77 mean absolute, all gains"),
    "torque-pendulum": Mechanism(write_torque_pendulum, "pendulum", "°", 1.0, ""),
}


def errors(residuals: Sequence[Floats], per_unit: float) -> str:
    """Return RMS and mean absolute error of each recording."""
    return "; ".join(f"{per_unit * np.sqrt(np.mean(r**2)):.3g} ({per_unit * np.abs(r).mean():.3g})" for r in residuals)


def simulated_mm(found: dict[str, float], folder: Path) -> float:
    """Return the RMS position error of a free run of EMPS over the pulses, from the measured start at rest, mm."""
    at, position, force = read_emps(folder, "DATA_EMPS_PULSES")
    keys = ("M, kg", "Fv+, N·s/m", "Fv-, N·s/m", "Fc+, N", "Fc-, N")
    p = np.array([*(found[key] for key in keys), found.get("b·M, N/m", 0.0)])
    run = free_run(RIGHT_SIDES["drive"], p, Series(at, position, force), np.array([position[0], 0.0]))
    return float(1e3 * np.sqrt(np.mean((run - position)[::EVERY] ** 2)))


def row(name: str, folder: Path) -> str:
    """Close the loop on one set and fit it by hand; return a row of the table."""
    one = MECHANISMS[name]
    with tempfile.TemporaryDirectory() as place:
        session = Path(place)
        held_out = one.write(folder, session)
        records = list(loop_input(measure_session(read_session(session))).records)
    began = time.process_time()
    verdict = close_records(records, held_out=held_out)
    took = time.process_time() - began
    if one.hand is None:
        before, after = _drive(verdict, folder)
        by_hand = f"{simulated_mm(PUBLISHED_DRIVE, folder):.3g}"
    else:
        before, after = (
            errors(prediction.residuals, np.degrees(1.0) * one.per_deg)
            for prediction in (verdict.before_held_out, verdict.after_held_out)
        )
        by_hand = errors(fit(RIGHT_SIDES[one.hand], *_split(records, held_out)), np.degrees(1.0) * one.per_deg)
    effects = ", ".join(accepted.effect.id for accepted in verdict.accepted) or "–"
    free = ""
    if verdict.free_form is not None:
        free = " over ".join(["free form", " and ".join(verdict.free_form.over)])
    cells = (name, verdict.verdict, effects, free, before, after, by_hand, one.published, one.unit, f"{took:.0f}")
    return f"| {' | '.join(cells)} |"


def _drive(verdict: Verdict, folder: Path) -> tuple[str, str]:
    return tuple(f"{simulated_mm(carriage(one), folder):.3g}" for one in (verdict.before, verdict.after))  # type: ignore[return-value]


def _split(records, held_out):  # type: ignore[no-untyped-def]
    series = {one.name: Series(one.time, one.angle, one.command.at(one.time)) for one in records}
    return [series[n] for n in series if n not in held_out], [series[n] for n in held_out]


def _write(session: Path, name: str, time_s: Floats, angle_deg: Floats, command_s: Floats, command_deg: Floats) -> None:
    for kind, header, at, value in (
        ("angles", "time_s,angle_deg", time_s, angle_deg),
        ("command", "time_s,command_deg", command_s, command_deg),
    ):
        table = np.column_stack([at, value])
        np.savetxt(session / f"{name}.{kind}.csv", table, "%.9g", ",", header=header, comments="")


def _declare(session: Path, rig: dict[str, object]) -> list[str]:
    (session / "rig.yaml").write_text(json.dumps(rig))
    return list(rig["held_out"])  # type: ignore[call-overload]


def main(
    folder: Path,
    only: Annotated[str, typer.Option(help="Comma-separated names; all by default.")] = "",
) -> None:
    """Print a table with a row for each set; errors are RMS and, in brackets, mean absolute."""
    heads = (
        "data",
        "verdict",
        "effects",
        "besides",
        "linear model",
        "loop's model",
        "by hand",
        "published",
        "unit",
        "CPU s",
    )
    print(f"| {' | '.join(heads)} |\n| {' | '.join(['---'] * len(heads))} |")
    for name in only.split(",") if only else MECHANISMS:
        print(row(name, folder / name), flush=True)


if __name__ == "__main__":
    typer.run(main)
