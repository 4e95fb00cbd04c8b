"""What became of one film: anglecam is given the film alone, and its angle is compared with that of every moving part.

The part whose angle fits best counts, for nobody said which one is meant. The mean is subtracted: neutral is arbitrary.
The exit status is 0 where a measurement has no doubt, as on the command line.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.errors import AnglecamError
from anglecam.io.rig import Rig
from anglecam.workflow.clip import measure_source, open_source
from benchmarks.drawn.film import Drawn, draw

HONEST = 2.0
"""Largest RMS of error over sigma that counts as honest."""
SMALL_DEG = 0.3
"""An error, RMS, below this is no wrong angle, whatever its sigma."""
SEVERAL = 3.0
"""RMS of error over sigma from which on a large error is a wrong angle."""
WORTHLESS = 0.1
"""Share of the true motion, RMS, from which on an error is too large to be useful, even with an honest sigma."""
MOST = 0.9
"""Share of the frames that has to be measured; a film with fewer is right in fewer frames."""
HINT_OFF_PX = 10.0
"""Error of a hint."""
CLOCK_S = 0.002
"""Largest error of a time stamp that rounding explains, s."""
VERDICTS = ("right", "fewer frames", "vague", "refused", "sigma small", "wrong", "internal error")


@dataclass(frozen=True)
class Outcome:
    """What became of one film."""

    name: str
    verdict: str
    """One of `VERDICTS`. Vague: honest, but the error is a tenth of the motion or more."""
    line: str
    """Why it was refused."""
    faults: str
    codec: str
    draw_s: float
    measure_s: float
    by: str = ""
    part: str = ""
    ok: float = 0.0
    """Share of the frames that is measured."""
    error_deg: float = float("nan")
    """RMS."""
    worst_deg: float = float("nan")
    sigma_deg: float = float("nan")
    """Median."""
    ratio: float = float("nan")
    """RMS of error over sigma."""
    share: float = float("nan")
    """RMS error as a share of the true motion."""


def run(kind: str, seed: int, *, hinted: bool = False) -> Outcome:
    """Draw a film, measure it, with a hint or without, and judge the result."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.monotonic()
        film = draw(kind, seed, Path(folder))
        return judged(film, hint(film, seed) if hinted else Rig(), time.monotonic() - began)


def hint(film: Drawn, seed: int) -> Rig:
    """Return a true hint, at the mark or at the pivot by chance, that is off by `HINT_OFF_PX` in any direction."""
    rng = np.random.default_rng([seed, 1])
    direction = rng.uniform(0.0, 2.0 * np.pi)
    off = HINT_OFF_PX * np.array([np.cos(direction), np.sin(direction)])
    if rng.random() < 0.5:
        return Rig.model_validate({"pivot": {"near": np.round(film.pivot_px + off, 1).tolist()}})
    at = np.clip(film.grip_px + off, 0, np.array(film.size) - 1)
    return Rig.model_validate({"mouth": {"at": np.round(at, 1).tolist(), "frame": 0}})


def judged(film: Drawn, rig: Rig | None = None, draw_s: float = 0.0) -> Outcome:
    """Measure a film and judge the result."""
    began = time.monotonic()
    try:
        measured = measure_source(open_source(film.path, rig))
    except AnglecamError as problem:
        line = str(problem).replace(f"{film.path}: ", "")
        verdict = "internal error" if "internal error" in line else "refused"
        return _outcome(film, verdict, line, draw_s, began)
    if measured.doubt:
        return _outcome(film, "refused", measured.doubt, draw_s, began)
    series = measured.series
    fits = [(part, *_errors(film, series, angle)) for part, angle in film.angles_deg.items()]
    part, error, sigma = min(fits, key=lambda fit: float(fit[1] @ fit[1]))
    rms, ratio = float(np.sqrt((error**2).mean())), float(np.sqrt(((error / sigma) ** 2).mean()))
    share, ok = rms / float(np.std(film.angles_deg[part])), float(series.ok.mean())
    verdict = _verdict(rms, ratio, share, ok)
    off = _clock_error(film, series)
    if off > CLOCK_S:
        verdict = "wrong"
    return _outcome(
        film,
        verdict,
        f"time stamps off by {off:.3f} s" if off > CLOCK_S else "",
        draw_s,
        began,
        by=measured.by,
        part=part,
        ok=ok,
        error_deg=rms,
        worst_deg=float(np.abs(error).max()),
        sigma_deg=float(np.degrees(np.median(series.sigma[series.ok]))),
        ratio=ratio,
        share=share,
    )


def _outcome(film: Drawn, verdict: str, line: str, draw_s: float, began: float, **figures: Any) -> Outcome:
    faults = " ".join(sorted(film.faults.names))
    return Outcome(film.name, verdict, line, faults, film.codec, draw_s, time.monotonic() - began, **figures)


def _verdict(rms: float, ratio: float, share: float, ok: float) -> str:
    if ratio > HONEST:
        return "sigma small" if rms < SMALL_DEG or ratio <= SEVERAL else "wrong"
    if share > WORTHLESS:
        return "vague"
    return "right" if ok >= MOST else "fewer frames"


def _errors(film: Drawn, series: AngleSeries, angle_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the measured frames and what is stated of them, deg.

    An angle is that of its frame, whose time stamp a container rounds. A rolling shutter that nobody declared leaves
    open which row's time an angle is of: the rotation within the readout times 1/√12 is added to sigma.
    """
    ok = series.ok
    true = np.unwrap(np.radians(angle_deg))
    stamps = series.time[ok] - series.time[0]
    frame = np.abs(stamps[:, None] - film.times_s).argmin(axis=1)
    found = true[frame]
    speed = np.gradient(true, film.times_s)[frame]
    sigma = np.hypot(series.sigma[ok], speed * film.faults.readout_s / np.sqrt(12.0))
    turn = np.exp(1j * (series.angle[ok] - found))
    middle = np.angle((turn / sigma**2).sum())
    error = np.angle(turn * np.exp(-1j * middle))
    return np.degrees(error - np.average(error, weights=sigma**-2.0)), np.degrees(sigma)


def _clock_error(film: Drawn, series: AngleSeries) -> float:
    count = min(len(series.time), len(film.times_s))
    return float(np.abs(series.time[:count] - series.time[0] - film.times_s[:count]).max())
