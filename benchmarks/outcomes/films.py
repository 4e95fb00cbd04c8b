"""The sets of films: how each is drawn or found, measured, and compared with its truth."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from itertools import chain
from pathlib import Path

import numpy as np

from anglecam.errors import AnglecamError
from anglecam.io.rig import Rig
from anglecam.workflow.clip import measure_source, open_source
from benchmarks import foreign_films, metrology, real_films
from benchmarks.drawn.film import draw
from benchmarks.drawn.kinds import KINDS
from benchmarks.drawn.trial import judged
from benchmarks.hostile import nothing_turns, turning
from benchmarks.hostile.draw import Film, write
from benchmarks.hostile.trial import measured as measured_by_command
from benchmarks.outcomes.case import Meter, Places, Row, known, known_rms, sha256, status_of

SEEDS = range(700, 766)
"""Of the drawn films. Nothing was set with any of them in view, and nothing may be."""
HINTED = ", hinted"
"""Ends the name of a real film that is measured with its hint."""


def drawn_names(places: Places) -> list[str]:
    """Return the drawn films; the kinds take turns."""
    return [f"{list(KINDS)[seed % len(KINDS)]}-{seed}" for seed in SEEDS]


def drawn(name: str, places: Places, meter: Meter) -> Row:
    """Measure a drawn film; the error is that of the part whose angle fits best, without its mean."""
    kind, seed = name.rsplit("-", 1)
    with tempfile.TemporaryDirectory() as folder:
        film = draw(kind, int(seed), Path(folder))
        hashed = sha256(film.path)
        with meter():
            found = judged(film)
    refused = found.verdict in ("refused", "internal error")
    return {
        "status": found.verdict if refused else "ok",
        "message": found.line,
        "verdict": found.verdict,
        "ok_share": found.ok,
        "error_deg": known(found.error_deg),
        "sigma_deg": known(found.sigma_deg),
        "error_over_sigma": known(found.ratio),
        "worst_deg": known(found.worst_deg),
        "by": found.by,
        "film": hashed,
    }


def _hostile_films() -> Iterator[Film]:
    return chain(nothing_turns.films(), turning.films())


def hostile_names(places: Places) -> list[str]:
    """Return the films that mislead: those in which nothing turns first."""
    return [film.name for film in _hostile_films()]


def hostile(name: str, places: Places, meter: Meter) -> Row:
    """Measure a film that misleads, by the command line; where nothing turns only a refusal is right."""
    film = next(film for film in _hostile_films() if film.name == name)
    with tempfile.TemporaryDirectory() as folder:
        path = write(film, Path(folder))
        hashed = sha256(path)
        with meter():
            found = measured_by_command(film, path)
    right = found.silent if film.angle_deg is None else found.honest
    return {
        "status": status_of(found.line) if found.status else "ok",
        "message": found.line if found.status else "",
        "verdict": "right" if right else "wrong",
        "ok_share": found.ok / found.rows if found.rows else 0.0,
        "error_deg": known(found.error_deg),
        "sigma_deg": known(found.sigma_deg),
        "error_over_sigma": known(found.ratio),
        "beyond_4_sigma": found.far,
        "film": hashed,
    }


def metrology_names(places: Places) -> list[str]:
    """Return both recordings of each of metrology's films."""
    return [f"{case}, {recording}" for case in metrology.CASES for recording in metrology.COMMANDS]


def metrology_film(name: str, places: Places, meter: Meter) -> Row:
    """Measure a film of `synth`; the error is that of the angle itself, its zero included."""
    case, recording = name.rsplit(", ", 1)
    spec = _rendered(case, places)
    try:
        with meter():
            error, sigma, lost, broken = metrology.judge(spec, recording)
    except AnglecamError as problem:
        return _refused(problem, metrology.clip_of(spec, recording))
    return {
        "status": "ok",
        "message": "",
        "ok_share": len(error) / (len(error) + lost),
        "error_deg": known_rms(error),
        "sigma_deg": float(np.median(sigma)),
        "error_over_sigma": known_rms(error / sigma),
        "beyond_6_px": broken,
        "film": sha256(metrology.clip_of(spec, recording)),
    }


def _rendered(case: str, places: Places) -> Path:
    """Return the spec of a film that is rendered once: the folder's name is a hash of what is rendered."""
    of_case = hashlib.sha256(repr(metrology.CASES[case]).encode()).hexdigest()[:12]
    kept = places.cache / "metrology" / of_case
    if not kept.exists():
        part = kept.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        metrology.film(metrology.CASES[case], part)
        part.rename(kept)
    return kept / "spec.yaml"


def path_traced_names(places: Places) -> list[str]:
    """Return the path-traced films that were rendered into the cache; see `benchmarks.foreign.render`."""
    folder = _path_traced(places)
    return sorted(path.name for path in folder.glob("*") if path.suffix in (".avi", ".mp4")) if folder.exists() else []


def _path_traced(places: Places) -> Path:
    return places.cache / "path-traced"


def path_traced(name: str, places: Places, meter: Meter) -> Row:
    """Measure a film of an independent renderer; the error is without its mean."""
    clip = _path_traced(places) / name
    try:
        with meter():
            measured = measure_source(open_source(clip, Rig()))
    except AnglecamError as problem:
        return _refused(problem, clip)
    series = measured.series
    error = foreign_films.series_errors_deg(series, foreign_films.truth_deg_of(clip))[series.ok]
    sigma = np.degrees(series.sigma[series.ok])
    return {
        "status": "refused" if measured.doubt else "ok",
        "message": measured.doubt or "",
        "ok_share": float(series.ok.mean()),
        "error_deg": known_rms(error),
        "sigma_deg": known(float(np.median(sigma))),
        "error_over_sigma": known_rms(error / sigma),
        "by": measured.by,
        "film": sha256(clip),
    }


def real_names(places: Places) -> list[str]:
    """Return the real films, each without a hint and, where one is known, with it; none without their folder."""
    if places.real is None:
        return []
    there = {name: film for name, film in real_films.FILMS.items() if (places.real / film.path).exists()}
    return list(there) + [f"{name}{HINTED}" for name, film in there.items() if film.hint]


def real(name: str, places: Places, meter: Meter) -> Row:
    """Measure a real film; the error is the difference from a plain tracker, or from what is known, after scaling."""
    film = real_films.FILMS[name.removesuffix(HINTED)]
    assert places.real is not None
    clip = places.real / film.path
    rig = Rig.model_validate(film.hint if name.endswith(HINTED) else {})
    try:
        with meter():
            measured = measure_source(open_source(clip, rig))
    except AnglecamError as problem:
        return _refused(problem, clip)
    found = real_films.compared(measured.series, film.track(clip))
    more = {key: known(value) for key, value in asdict(found).items() if key in ("difference_deg", "scale", "period_s")}
    return {
        "status": "refused" if measured.doubt else "ok",
        "message": measured.doubt or "",
        "ok_share": found.ok / found.rows,
        "error_deg": known(found.scaled_deg),
        "sigma_deg": known(found.sigma_deg),
        "error_over_sigma": known(found.over_sigma),
        **more,
        "by": measured.by,
        "film": sha256(clip),
    }


def _refused(problem: AnglecamError, clip: Path) -> Row:
    message = str(problem).replace(f"{clip}: ", "").replace(str(clip), clip.name)
    return {"status": status_of(message), "message": message, "ok_share": 0.0, "film": sha256(clip)}
