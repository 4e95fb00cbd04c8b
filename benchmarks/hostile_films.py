"""Measures films that are meant to mislead, and whether a wrong angle is ever given with status ok.

    .venv/bin/python -m benchmarks.hostile_films [--only WORD ...] [--json FILE]

Two groups, drawn by `benchmarks.hostile` with plain NumPy. In the first nothing turns about a fixed pivot, or nothing
is to be seen: no film may get an angle. In the second something turns by a known angle and one trait misleads: what is
ok must be right within its sigma. anglecam is given the film alone.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict
from datetime import date
from importlib.metadata import version
from pathlib import Path

from benchmarks.hostile import nothing_turns, turning
from benchmarks.hostile.trial import Outcome, run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], help="films whose name contains one of these words")
    parser.add_argument("--json", type=Path, help="also write the outcomes to this file")
    arguments = parser.parse_args()
    print(f"anglecam {version('anglecam')}, {date.today():%d %B %Y}\n")
    outcomes: list[Outcome] = []
    for title, films in (("nothing turns", nothing_turns.films()), ("something turns", turning.films())):
        print(f"| {title} | exit | ok rows | error ° RMS | sigma ° | error/sigma | beyond 4 sigma | s | |")
        print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
        passed = total = 0
        for film in films:
            if arguments.only and not any(word in film.name for word in arguments.only):
                continue
            with tempfile.TemporaryDirectory() as folder:
                outcome = run(film, Path(folder))
            good = outcome.silent if film.angle_deg is None else outcome.honest
            passed, total = passed + good, total + 1
            outcomes.append(outcome)
            print(_row(outcome, good), flush=True)
        print(f"\n{passed} of {total} pass\n")
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1))


def _row(o: Outcome, good: bool) -> str:
    figures = f"{o.error_deg:.3g} | {o.sigma_deg:.2g} | {o.ratio:.2g} | {o.far:.1%}" if o.ratio == o.ratio else "| | |"
    verdict = "pass" if good else "FAIL"
    return f"| {o.name} | {o.status} | {o.ok}/{o.rows} | {figures} | {o.seconds:.0f} | {verdict}: {o.line} |"


if __name__ == "__main__":
    main()
