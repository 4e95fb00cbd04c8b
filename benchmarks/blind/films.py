"""Measures how often the loop's verdict is right on films: renders, measures, closes and judges ``tests/blind``.

    .venv/bin/python -m benchmarks.blind.films --keep build/blind
    .venv/bin/python -m benchmarks.blind.films 0005 0013 --keep build/blind

Measured sessions are kept; a case that was measured already is closed again without filming it.

A case is right if verdict and effects are those of its ``expected.yaml`` and the parameters lie within the number of
standard uncertainties that this file allows.
"""

from __future__ import annotations

import json
import math
import pickle
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml
from rich.console import Console
from rich.table import Table

from anglecam.errors import InputError
from anglecam.io.session import read_session
from anglecam.loop.close import close_records
from anglecam.workflow.session import loop_input, measure_session
from benchmarks.blind.judged import Line, judge, show, true_values
from synth.session import render
from synth.spec import Spec, read_spec

CASES = Path(__file__).parents[2] / "tests" / "blind"
SPEC, EXPECTED, MEASURED = "spec.yaml", "expected.yaml", "measured.pickle"


@dataclass(frozen=True)
class Case:
    """A film's spec and the expected verdict."""

    name: str
    path: Path
    spec: Spec
    verdict: str
    effects: tuple[str, ...]
    parameters: tuple[dict[str, Any], ...]
    """``name``, ``value`` and ``within_sigma`` of the first parameter of each effect, in files' units."""

    @property
    def true(self) -> dict[str, dict[str, float]]:
        """Return the effects that act, as in the spec."""
        return self.spec.effects.model_dump(exclude_none=True)


def read_case(path: Path) -> Case:
    """Read the folder of one case."""
    expected = yaml.safe_load((path / EXPECTED).read_text(encoding="utf-8"))
    parameters = tuple(expected.get("parameters", ()))
    return Case(path.name, path, read_spec(path / SPEC), expected["verdict"], tuple(expected["effects"]), parameters)


def film(case: Case, kept: Path) -> None:
    """Render a case and measure it; keep the loop's input and nothing of the truth.

    Parameters
    ----------
    case : Case
        The case.
    kept : Path
        Folder for the measured session, in one file.

    Raises
    ------
    InputError
        If a recording cannot be measured.
    """
    with tempfile.TemporaryDirectory() as workplace:
        clips = Path(workplace) / "session"
        render(case.path / SPEC, clips, Path(workplace) / "truth")
        session = read_session(clips)
        measured = measure_session(session)
        if measured.problems:
            raise measured.problems[0]
    kept.mkdir(parents=True, exist_ok=True)
    (kept / MEASURED).write_bytes(pickle.dumps(measured))


def close(case: Case, kept: Path) -> Line:
    """Close the loop on a kept session and judge it.

    Returns
    -------
    dict
        The result of `benchmarks.blind.judged.judge`, with ``right`` and ``wrong``, the list of deviations.
    """
    measured = pickle.loads((kept / MEASURED).read_bytes())
    records = loop_input(measured).records
    start = time.perf_counter()
    verdict = close_records(records, held_out=case.spec.declare["held_out"])
    seconds = time.perf_counter() - start
    sigma_deg = math.degrees(verdict.noise.sigma)
    line = judge(verdict, case.true, true_values(case.spec, case.true), sigma_deg)
    wrong = _wrong(case, line)
    return {"case": case.name, "seed": case.spec.seed, "seconds": seconds, "right": not wrong, "wrong": wrong} | line


def _wrong(case: Case, line: Line) -> list[str]:
    """List the deviations of a result from its expectation."""
    if line["verdict"] != case.verdict or set(line["found"]) != set(case.effects):
        return [f"{' + '.join(case.effects) or case.verdict} expected"]
    off = {estimate["name"]: estimate for estimate in line["estimates"].values()}
    return [
        f"{p['name']} {off[p['name']]['value']:.4g} for {p['value']:.4g}, {off[p['name']]['off_sigmas']:+.1f} σ"
        for p in case.parameters
        if not abs(off[p["name"]]["off_sigmas"] or 0.0) <= p["within_sigma"]
    ]


def main(
    names: Annotated[list[str] | None, typer.Argument(help="Folders of --cases; all by default.")] = None,
    cases: Annotated[Path, typer.Option(help="Folder of the cases.")] = CASES,
    keep: Annotated[Path, typer.Option(help="Folder for measured sessions.")] = Path("build/blind"),
) -> None:
    """Film, measure, close and judge."""
    console = Console(width=None if Console().is_terminal else 200)
    paths = [cases / name for name in names] if names else sorted(path.parent for path in cases.glob(f"*/{SPEC}"))
    lines = []
    for path in paths:
        case, kept = read_case(path), keep / path.name
        console.print(f"{case.name}: {' + '.join(case.true) or 'nothing'}")
        try:
            if not (kept / MEASURED).exists():
                film(case, kept)
        except InputError as error:  # a failed film must not stop the others
            lines.append({"case": case.name, "seed": case.spec.seed, "error": str(error)})
            continue
        lines.append(close(case, kept))
        (kept / "judged.json").write_text(json.dumps(lines[-1], indent=1) + "\n", encoding="utf-8")
    show(lines, lambda line: "films", console)
    console.print(_judgements(lines))


def _judgements(lines: list[Line]) -> Table:
    table = Table("case", "what acts", "found", "right", "", title="How each was judged", title_justify="left")
    for line in lines:
        if "error" in line:
            continue
        found = " + ".join(line["found"]) or line["verdict"]
        table.add_row(
            line["case"], " + ".join(line["true"]) or "nothing", found, "yes" if line["right"] else "no",
            "; ".join(line["wrong"]),
        )  # fmt: skip
    return table


if __name__ == "__main__":
    typer.run(main)
