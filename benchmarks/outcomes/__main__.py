"""Measures every film and session of the benchmarks, and stores what became of each or compares it with what is stored.

    .venv/bin/python -m benchmarks.outcomes [SET ...] --write [--again] [--real FOLDER]
    .venv/bin/python -m benchmarks.outcomes [SET ...] --compare [--real FOLDER]

The sets are real, drawn, hostile, metrology, sessions and path-traced; by default all. Real films and logs are no part
of the project: FOLDER (or the environment variable ANGLECAM_REAL) holds them, and they are left out without it.
Path-traced films are rendered once, into build/outcomes/path-traced (see `benchmarks.foreign.render`).

Each film is measured in a process of its own, one at a time, and its row is written at once. ``--write`` goes on where
it stopped: rows that are stored stay, except with ``--again``. ``--compare`` keeps its rows in build/outcomes and goes
on likewise as long as the code stays the same; the exit status is 1 where something is worse.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from benchmarks.outcomes import films, sessions
from benchmarks.outcomes.alone import Set, row_of
from benchmarks.outcomes.case import Places, Row
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


def fill(name: str, path: Path, places: Places, done: dict[str, Row]) -> dict[str, Row]:
    """Measure what has no row yet, and write each row at once; return all rows."""
    rows, from_here = dict(done), origin()
    names = SETS[name].names(places)
    for k, one in enumerate(names):
        if one in rows:
            continue
        rows[one] = {**row_of(SETS[name], one, places), **from_here}
        write_rows(path, {key: rows[key] for key in (*names, *rows) if key in rows})
        said = {key: value for key, value in rows[one].items() if key in ("status", "verdict", "error_deg", "cpu_s")}
        print(f"{name} {k + 1}/{len(names)} {one}: {said}", file=sys.stderr, flush=True)
    return rows


def main() -> int:
    """Run the command; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", metavar="SET", help=f"of {', '.join(SETS)}")
    parser.add_argument("--write", action="store_true", help="store the rows")
    parser.add_argument("--again", action="store_true", help="measure what is stored again")
    parser.add_argument("--real", type=Path, default=os.environ.get("ANGLECAM_REAL"), help="folder of real films")
    arguments = parser.parse_args()
    places = Places(CACHE, None if arguments.real is None else Path(arguments.real))
    for name in arguments.sets or SETS:
        path = file_of(name)
        fill(name, path, places, {} if arguments.again else read_rows(path))
    return 0


if __name__ == "__main__":
    sys.exit(main())
