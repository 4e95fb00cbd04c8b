"""Measures every film and session of the benchmarks, and stores what became of each or compares it with what is stored.

    .venv/bin/python -m benchmarks.outcomes [SET ...] --write [--real FOLDER]
    .venv/bin/python -m benchmarks.outcomes [SET ...] --compare [--real FOLDER]

The sets are real, drawn, hostile, metrology, sessions and path-traced; by default all. Real films and logs are no part
of the project: FOLDER (or the environment variable ANGLECAM_REAL) holds them, and they are left out without it.
Path-traced films are rendered once, into build/outcomes/path-traced (see `benchmarks.foreign.render`).

Each film is measured in a process of its own, one at a time, and its row is written at once. ``--write`` goes on where
it stopped: rows that are stored stay, except with ``--again``. ``--compare`` measures the stored films, keeps its rows
in build/outcomes, and goes on likewise as long as the code stays the same. It prints what changed by more than a
factor, worse first; the exit status is 1 where something is worse.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from benchmarks.outcomes import films, sessions
from benchmarks.outcomes.alone import Set, row_of
from benchmarks.outcomes.case import Places, Row
from benchmarks.outcomes.compare import Factors, changes, summary, table
from benchmarks.outcomes.store import ROOT, file_of, origin, read_rows, write_rows

SETS = {
    "real": Set(films.real_names, films.real),
    "drawn": Set(films.drawn_names, films.drawn),
    "hostile": Set(films.hostile_names, films.hostile),
    "metrology": Set(films.metrology_names, films.metrology_film),
    "sessions": Set(sessions.names, sessions.session),
    "path-traced": Set(films.path_traced_names, films.path_traced),
}
CACHE = ROOT / "build" / "outcomes"


def fill(name: str, todo: list[str], path: Path, places: Places, rows: dict[str, Row]) -> dict[str, Row]:
    """Measure films and write each row at once, in the order of the set; return all rows."""
    order, from_here = SETS[name].names(places), origin()
    for one in todo:
        rows = {**rows, one: {**row_of(SETS[name], one, places), **from_here}}
        rows = {key: rows[key] for key in (*order, *rows) if key in rows}
        write_rows(path, rows)
        said = ", ".join(f"{key} {rows[one][key]}" for key in ("status", "verdict", "cpu_s") if key in rows[one])
        print(f"{name}, {len(rows)} rows: {one}: {said}", file=sys.stderr, flush=True)
    return rows


def compare(name: str, wanted: list[str], places: Places, factors: Factors, again: bool) -> bool:
    """Measure films whose rows are stored, and print what changed; return whether something is worse."""
    stored, path, now = read_rows(file_of(name)), CACHE / f"{name}.json", origin()["commit"]
    kept = {} if again else {one: row for one, row in read_rows(path).items() if row["commit"] == now}
    wanted = [one for one in wanted if one in stored]
    rows = fill(name, [one for one in wanted if one not in kept], path, places, kept)
    measured = {one: rows[one] for one in wanted}
    found = changes(stored, measured, factors)
    print(f"{summary(name, stored, measured, found)}\n")
    if found:
        print(f"{table(found)}\n", flush=True)
    return any(change.worse for change in found)


def main() -> int:
    """Run the command; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", metavar="SET", default=list(SETS), help=f"of {', '.join(SETS)}")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", action="store_true", help="store the rows")
    what.add_argument("--compare", action="store_true", help="print what changed from the stored rows, worse first")
    parser.add_argument("--again", action="store_true", help="also measure what has a row already")
    parser.add_argument("--only", nargs="*", default=[], help="films whose name contains one of these words")
    parser.add_argument("--real", type=Path, default=os.environ.get("ANGLECAM_REAL"), help="folder of real films")
    parser.add_argument("--factor", type=float, default=1.1, help="of a figure that is reported; %(default)s")
    parser.add_argument("--cpu-factor", type=float, default=1.5, help="of CPU time; %(default)s")
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.sets if name not in SETS]:
        parser.error(f"{unknown[0]}: no such set; there are {', '.join(SETS)}")
    places = Places(CACHE, None if arguments.real is None else Path(arguments.real))
    factors, worse = Factors(arguments.factor, arguments.cpu_factor), False
    for name in arguments.sets:
        names = SETS[name].names(places)
        wanted = [one for one in names if not arguments.only or any(word in one for word in arguments.only)]
        if arguments.compare:
            worse |= compare(name, wanted, places, factors, arguments.again)
            continue
        rows = read_rows(file_of(name))
        fill(name, [one for one in wanted if arguments.again or one not in rows], file_of(name), places, rows)
    return int(worse)


if __name__ == "__main__":
    sys.exit(main())
