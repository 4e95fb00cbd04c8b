"""Compares what `anglecam check` predicts of films and sessions with what is achieved.

    .venv/bin/python -m benchmarks.check_films [films] [factors] [sizes] [NAME ...]

*films*: drawn pendulums and plates (`benchmarks.hostile.draw`) with one trait changed at a time. The prediction from
the first 4 s is compared with sigma and error of the whole film of 6 s. *factors*: pairs of films that differ by one of
the changes that are advised; the predicted factor on sigma is compared with the ratio of the sigmas. *sizes*: simulated
sessions with an effect of 2 and of 0.3 times the predicted smallest size; how many the loop detects. NAME limits the
films to those with these names.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from anglecam.check.prediction import Prediction
from anglecam.check.smallest import RECORDINGS, Smallest, planned, smallest_sizes
from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.series import AngleSeries
from anglecam.effects import effect
from anglecam.errors import AnglecamError
from anglecam.loop.close import close_records
from anglecam.models.plant import Plant
from anglecam.workflow.check import check_clip
from anglecam.workflow.clip import measure_source, open_source
from benchmarks.hostile.draw import DARK, Film, ball, box, room, stick, texture, write

LENGTH_S = 6.0
SUBFRAMES = 5
"""Instants whose pictures are averaged into a blurred frame."""
WALL = np.array([176.0, 170.0, 160.0])
RED = np.array([190.0, 30.0, 35.0])
SURFACE = texture((90, 150), 50, 3.0, 40.0)


@dataclass(frozen=True)
class Trait:
    """How one film is drawn."""

    name: str
    noise: float = 2.0
    contrast: float = 1.0
    """Share of the way from the wall's colour to red."""
    radius: float = 10.0
    lever: float = 150.0
    rate: float = 30.0
    exposure_s: float = 0.0
    codec: str = "ffv1"
    crf: int = 18
    shaft: bool = True
    body: bool = False
    """Whether a textured plate hangs on the lever."""
    zoom: float = 1.0


FILMS = (
    Trait("as it is"),
    *(Trait(f"noise {n:g}", noise=n) for n in (1.0, 6.0)),
    Trait("contrast 0.4", contrast=0.4),
    *(Trait(f"radius {r:g} px", radius=r) for r in (6.0, 16.0)),
    Trait("lever 75 px", lever=75.0),
    *(Trait(f"{r:g} Hz", rate=r) for r in (15.0, 60.0)),
    *(Trait(f"exposure {1000 * e:g} ms", exposure_s=e) for e in (0.01, 0.025)),
    *(Trait(f"H.264 crf {c}", codec="libx264", crf=c) for c in (18, 28)),
    Trait("no mark on the shaft", shaft=False),
    Trait("plate", body=True),
    Trait("plate, noise 6", body=True, noise=6.0),
    Trait("plate, H.264 crf 23", body=True, codec="libx264", crf=23),
)
FACTORS = (
    ("light", Trait("noise 4", noise=4.0), {"noise": 4.0 / math.sqrt(2.0)}),
    ("light", Trait("plate, noise 4", noise=4.0, body=True), {"noise": 4.0 / math.sqrt(2.0)}),
    ("larger_mark", Trait("radius 7", radius=7.0, noise=4.0), {"radius": 14.0}),
    ("contrast", Trait("contrast 0.4", contrast=0.4, noise=4.0), {"contrast": None}),
    ("nearer", Trait("small", lever=75.0, radius=6.0, noise=4.0), {"zoom": None}),
    ("shaft_mark", Trait("no mark on the shaft", shaft=False), {"shaft": True}),
)


def swing(times: np.ndarray) -> np.ndarray:
    """Return the angle, degrees."""
    return 20.0 * np.exp(-0.08 * times) * np.cos(2 * np.pi * 0.75 * times + 0.4)


def draw(trait: Trait) -> Film:
    """Return the film of a trait."""
    times = np.arange(round(LENGTH_S * trait.rate)) / trait.rate
    options = {"crf": str(trait.crf)} if trait.codec == "libx264" else {}
    return Film(
        "film", _frames(trait, times), swing(times), times, noise=trait.noise, codec=trait.codec, options=options
    )


def _frames(trait: Trait, times: np.ndarray) -> Iterator[np.ndarray]:
    wall = room(seed=1)
    for t in times:
        share = (np.arange(SUBFRAMES) + 0.5) / SUBFRAMES - 0.5
        instants = t + trait.exposure_s * share if trait.exposure_s else np.array([t])
        yield np.mean([_picture(trait, wall, float(swing(np.array([i]))[0])) for i in instants], axis=0)


def _picture(trait: Trait, wall: np.ndarray, angle_deg: float) -> np.ndarray:
    picture, pivot = wall.copy(), np.array([200.0, 60.0])
    colour: Any = WALL + trait.contrast * (RED - WALL)
    lever, radius = trait.lever * trait.zoom, trait.radius * trait.zoom
    down = np.array([np.sin(np.radians(angle_deg)), np.cos(np.radians(angle_deg))])
    bob = pivot + lever * down
    if trait.body:
        middle = pivot + 0.5 * lever * down
        _plate(picture, middle, angle_deg)
    stick(picture, pivot, bob, 2.5, (80, 80, 85))
    if trait.shaft:
        ball(picture, pivot, 8 * trait.zoom, DARK)
    ball(picture, bob, radius, colour)
    return picture


def _plate(picture: np.ndarray, middle: np.ndarray, turn_deg: float) -> None:
    import cv2

    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, s], [-s, c]])
    size = np.array(SURFACE.shape[1::-1])
    matrix = np.column_stack([turn, middle - turn @ ((size - 1.0) / 2.0)])
    layer = cv2.warpAffine(SURFACE, matrix, picture.shape[1::-1], flags=cv2.INTER_CUBIC)
    box(picture, middle, (size - 6.0) / 2.0, layer, turn_deg)


@dataclass(frozen=True)
class Outcome:
    """One film: predicted, and achieved over the whole of it."""

    prediction: Prediction
    sigma: float
    """RMS sigma that `measure` states, rad."""
    error: float
    """RMS error, rad."""
    seconds: float
    """Of the check, in CPU time."""


def run(trait: Trait) -> Outcome:
    """Draw, check and measure one film."""
    film = draw(trait)
    with tempfile.TemporaryDirectory() as folder:
        clip = write(film, Path(folder), seed=3)
        begin = time.process_time()
        prediction = check_clip(clip)
        seconds = time.process_time() - begin
        series = measure_source(open_source(clip)).series
    assert film.angle_deg is not None
    return Outcome(prediction, rms(series.sigma[series.ok]), error_of(series, film.angle_deg), seconds)


def error_of(series: AngleSeries, truth_deg: np.ndarray) -> float:
    """Return the RMS error of the angle from its median, rad."""
    truth = np.radians(truth_deg)[series.ok]
    off = series.angle[series.ok] - truth
    return rms(off - np.median(off))


def rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def films(names: Sequence[str] = ()) -> None:
    """Print predicted and achieved sigma of every film, or of those named."""
    print("| film | sigma predicted, ° | achieved, ° | ratio | error, ° RMS | predicted ÷ error | exposure, ms | s |")
    print("| --- " * 8 + "|")
    ratios = []
    for trait in (t for t in FILMS if not names or t.name in names):
        try:
            one = run(trait)
        except AnglecamError as problem:
            print(f"| {trait.name} | {str(problem).split(': ', 1)[-1]} |", flush=True)
            continue
        predicted = one.prediction.whole.sigma
        ratios.append((predicted / one.sigma, predicted / one.error))
        blur = one.prediction.exposure_s
        found = "" if blur is None else f"{1000 * blur[0]:.1f} ± {1000 * blur[1]:.1f}"
        print(
            f"| {trait.name} | {math.degrees(predicted):.4f} | {math.degrees(one.sigma):.4f} |"
            f" {ratios[-1][0]:.2f} | {math.degrees(one.error):.4f} | {ratios[-1][1]:.2f} | {found} |"
            f" {one.seconds:.0f} |",
            flush=True,
        )
    logs = np.abs(np.log(ratios))
    print(f"\nfactor within which 90 % lie: sigma {np.exp(np.quantile(logs[:, 0], 0.9)):.2f},", end=" ")
    print(f"error {np.exp(np.quantile(logs[:, 1], 0.9)):.2f}")


def factors() -> None:
    """Print predicted and achieved factors on sigma."""
    print("| change | film | factor predicted | achieved | achieved on the error |")
    print("| --- " * 5 + "|")
    for change, trait, after in FACTORS:
        one = run(trait)
        predicted = next((a.sigma_factor for a in one.prediction.advice if a.change == change), math.nan)
        if change == "contrast":
            assert one.prediction.contrast_grey is not None
            after = {"contrast": trait.contrast * 200.0 / one.prediction.contrast_grey}
        if change == "nearer":
            text = next(a.text for a in one.prediction.advice if a.change == change)
            after = {"zoom": float(text.split()[0])}
        other = run(replace(trait, **after))
        print(
            f"| {change} | {trait.name} | {predicted:.2f} | {other.sigma / one.sigma:.2f} |"
            f" {other.error / one.error:.2f} |",
            flush=True,
        )


TRUE = np.array([26.0, 524.0, 508.0])
SIGMA, SCATTER = math.radians(0.03), math.radians(0.02)
TRIED = (
    "dead_time",
    "coulomb_friction",
    "quadratic_drag",
    "backlash",
    "stiffening_spring",
    "actuator_lag",
    "dead_zone",
)


def steps() -> Command:
    """Return a command of uneven steps, 8 s long."""
    levels = np.radians([0.0, 12.0, 0.0, -8.0, 5.0, -12.0, 0.0])
    return Command(np.array([0.0, 1.0, 2.13, 3.31, 4.22, 5.47, 6.61]), levels)


def plan() -> Record:
    """Return one recording as it would be made."""
    time_s = np.arange(0.0, 8.0, 1.0 / 30.0)
    blank = Record("plan", time_s, time_s, steps(), False, np.full(len(time_s), np.nan))
    return planned(blank, steps(), TRUE, np.zeros(2), 8.0)


def session_with(one: Smallest, multiple: float, seed: int) -> list[Record]:
    """Simulate a session in which one effect acts, ``multiple`` times as large as its smallest size."""
    rng, base = np.random.default_rng(seed), plan()
    first = one.effect.parameters[0]
    values = one.effect.null
    size = first.to_file / one.size if first.inverse else one.size / first.to_file
    values[0] = first.null + multiple * size
    acting = Plant(effects=(one.effect,))
    angle = acting.predict(np.append(TRUE, values), base.time, base.command, np.zeros(2))
    sigma = np.full(len(angle), SIGMA)
    return [
        replace(
            base,
            name=f"r{i}",
            angle=angle + SCATTER * rng.standard_normal(len(angle)),
            sigma=sigma,
            lever_scatter=SCATTER * rng.standard_normal(len(angle)),
        )
        for i in range(RECORDINGS)
    ]


def sizes(seeds: int = 5) -> None:
    """Print how often effects of 2 and 0.3 times the smallest size are detected."""
    found = {one.effect.id: one for one in smallest_sizes(plan(), TRUE, SCATTER, SCATTER)}
    print("| effect | smallest | detected at 2 | the true one in the alias set | at 0.3 |")
    print("| --- " * 5 + "|")
    totals = np.zeros(3, int)
    for name in TRIED:
        one = replace(found[name], effect=effect(name))
        counts = np.zeros(3, int)
        for seed in range(seeds):
            large, small = (close_records(session_with(one, k, seed)) for k in (2.0, 0.3))
            detected = large.verdict != "nothing_missing"
            named = any(name in accepted.alias_set for accepted in large.accepted)
            counts += [detected, named, small.verdict != "nothing_missing"]
        totals += counts
        unit = one.effect.parameters[0].unit
        print(f"| {name} | {one.size:.3g} {unit} | " + " | ".join(f"{c} of {seeds}" for c in counts) + " |", flush=True)
    whole = seeds * len(TRIED)
    print("| all | | " + " | ".join(f"{c} of {whole}" for c in totals) + " |")


def main() -> None:
    """Print the tables that are asked for."""
    print(f"anglecam {version('anglecam')}, {date.today():%d %B %Y}\n")
    asked = sys.argv[1:]
    tables = {"films": lambda: films([a for a in asked if a not in tables]), "factors": factors, "sizes": sizes}
    for name, table in tables.items():
        if not asked or name in asked:
            print(f"{name}\n")
            table()
            print()


if __name__ == "__main__":
    main()
