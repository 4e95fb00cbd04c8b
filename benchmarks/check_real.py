"""Compares sigma as `anglecam check` predicts it for real films with what `anglecam measure` states of the whole films.

    .venv/bin/python -m benchmarks.check_real FOLDER [NAME ...]

FOLDER and the films are those of ``benchmarks/real_films.py``; NAME limits them. A film is checked and measured without
a rig file and, where that is no success, with the one hint of that benchmark. The swing still to come is the standard
deviation of the angle in the rest of the film, divided by that in the part that `check` reads.
"""

from __future__ import annotations

import math
import sys
from datetime import date
from importlib.metadata import version
from pathlib import Path

import numpy as np

from anglecam.errors import AnglecamError
from anglecam.io.rig import Rig
from anglecam.workflow.check import check_clip
from anglecam.workflow.clip import measure_source, open_source
from benchmarks.real_films import FILMS, RealFilm


def row(folder: Path, film: RealFilm) -> str:
    """Return the cells of one film, of the first hint that leads to success."""
    problem = ""
    for hint in ({}, film.hint) if film.hint else ({},):
        path, rig = folder / film.path, Rig.model_validate(hint)
        try:
            found = check_clip(path, rig)
            measured = measure_source(open_source(path, rig))
        except AnglecamError as refused:
            problem = str(refused).replace(f"{path}: ", "")
            continue
        if measured.doubt:
            problem = measured.doubt
            continue
        series = measured.series
        achieved = math.degrees(math.sqrt(float(np.mean(series.sigma[series.ok] ** 2))))
        part, rest = (
            series.angle[rows][series.ok[rows]] for rows in (slice(found.frames_read), slice(found.frames_read, None))
        )
        swing = np.std(rest) / np.std(part) if len(rest) else math.nan
        predicted = math.degrees(found.whole.sigma)
        cells = (
            f"{found.frames_read} of {len(series.ok)} | {predicted:.3f} | {achieved:.3f} | {predicted / achieved:.2f}"
        )
        return f"{hint or 'none'} | {cells} | {swing:.2f}"
    return problem


def main() -> None:
    """Print the table."""
    folder, names = Path(sys.argv[1]), sys.argv[2:]
    print(f"anglecam {version('anglecam')}, {date.today():%d %B %Y}\n")
    print("| film | hint | frames read | sigma predicted, ° | achieved, ° | ratio | swing still to come |")
    print("| --- " * 7 + "|")
    for name, film in FILMS.items():
        if not names or name in names:
            print(f"| {name} | {row(folder, film)} |", flush=True)


if __name__ == "__main__":
    main()
