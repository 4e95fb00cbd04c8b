"""Measures films of simple mechanisms, with a phone's faults and without a hint, and whether each angle is right.

    .venv/bin/python -m benchmarks.drawn_films --first 0 --seeds 40 [--kind X] [--hinted] [--json FILE]

`benchmarks.drawn` draws them with OpenCV; kind and seed alone decide a film. Without ``--kind`` the kinds take turns, a
seed each. Every film has a row, and the last table counts: right; right in fewer than nine tenths of the frames;
vague, which is honest, but of no use; refused; sigma too small (RMS of error over sigma above 2); wrong, which is an
error of several sigma that matters; and internal errors, of which there may be none.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from dataclasses import asdict
from datetime import date
from importlib.metadata import version
from pathlib import Path

from benchmarks.drawn.kinds import KINDS
from benchmarks.drawn.trial import VERDICTS, Outcome, run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--seeds", type=int, default=len(KINDS), help="how many")
    parser.add_argument("--kind", choices=KINDS, help="of all films; by default the kinds take turns")
    parser.add_argument("--hinted", action="store_true", help="with one true hint each, off by 10 px")
    parser.add_argument("--json", type=Path, help="also write the outcomes to this file, a line each")
    arguments = parser.parse_args()
    print(f"anglecam {version('anglecam')}, {date.today():%d %B %Y}\n")
    print("| film | verdict | ok | error ° RMS | worst ° | sigma ° | error/sigma | by | faults | s | |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    outcomes = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        outcomes.append(run(arguments.kind or list(KINDS)[seed % len(KINDS)], seed, hinted=arguments.hinted))
        print(_row(outcomes[-1]), flush=True)
        if arguments.json:
            with arguments.json.open("a") as file:
                file.write(json.dumps(asdict(outcomes[-1])) + "\n")
    counts = Counter(outcome.verdict for outcome in outcomes)
    print(f"\n| films | {' | '.join(VERDICTS)} |")
    print(f"|{' --- |' * (len(VERDICTS) + 1)}")
    print(f"| {len(outcomes)} | {' | '.join(str(counts[verdict]) for verdict in VERDICTS)} |")


def _row(o: Outcome) -> str:
    figures = (
        f"{o.ok:.0%} | {o.error_deg:.3g} | {o.worst_deg:.2g} | {o.sigma_deg:.2g} | {o.ratio:.2g} | {o.by}"
        if o.ratio == o.ratio
        else " | | | | | "
    )
    return f"| {o.name} | {o.verdict} | {figures} | {o.faults} {o.codec} | {o.measure_s:.0f} | {o.line} |"


if __name__ == "__main__":
    main()
