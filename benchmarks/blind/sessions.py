"""Draws sessions as angle series, without pictures, from a seed.

`synth` moves the rig and projects mouth and pivot mark through its camera at the time their row is exposed. The angle
is that of the line between the two pixels, as an error-free measurement would return it, plus noise.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from anglecam.data.camera_evidence import View
from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.identification.output_error import fit_output_error
from anglecam.models.plant import Plant
from benchmarks.blind.drawn import magnified
from synth.clock import timetable
from synth.errors import SpecError
from synth.spec import Spec
from synth.take import CLOCK, Take, marks, perform, seed_of
from synth.take import View as Scenery
from synth.take import view as look

Floats = NDArray[np.float64]
Effects = Mapping[str, Mapping[str, float]]

RECORDINGS = ("random", "stairs", "triangle", "chirp", "release")
HELD_OUT = ("random",)
"""Recordings that are only predicted, as in the films' specs."""
TYPICAL = (26.0, 524.0, 508.0)
"""a, b and c of the paper's neck."""
SPREAD = 0.2
"""Largest relative deviation of a drawn plant from `TYPICAL`."""
DECLARED = 0.25
"""Share of sessions with a declared neutral although no constant torque requires it."""
NEAR_M, SMALLER, FARTHER = 0.6, 0.5, 2.0
"""With lens distortion or perspective the camera is this close, m; with lens distortion the rig is this many times as
large and as far from the middle."""
PHI = 0.6
"""AR(1) coefficient of correlated noise from frame to frame, typical of a codec's block pattern."""
TAILS = 4
"""Degrees of freedom of heavy-tailed noise."""
STEP_DEG = 0.088
"""Step of quantised angles, °: an encoder of 4,096 counts per turn."""
SETTLED = 4
"""Iterations for the row of the mouth and the time of that row; they converge to far below a microsecond."""
CLOSE = 0.02
"""Relative tolerance of a required ratio."""
MOST_TRIALS = 40

PLANT, MOVES, CAMERA, ZERO = range(4)
"""Purposes of random numbers other than noise, part of their seeds."""


def session(
    effects: Effects,
    *,
    seed: int,
    sigma_deg: float = 0.05,
    noise: str = "white",
    fps: float = 30,
    plant: tuple[float, float, float] | None = None,
    names: Collection[str] = RECORDINGS,
) -> list[Record]:
    """Make the five recordings of one session, or some of them.

    Parameters
    ----------
    effects : mapping
        As under ``effects`` in a film's spec, and ``swing`` of ``linkage_geometry``: the share of the usual motion.
        A linkage's effect is fixed by its links, so its size is varied through the range of motion.
    seed : int
        Seed of plant, commands, camera and noise, which do not depend on the effects.
    sigma_deg : float
        Standard deviation of the noise.
    noise : {"white", "coloured", "heavy-tailed", "quantised"}
        AR(1) noise has the coefficient `PHI`; heavy tails are those of Student's t with `TAILS` degrees of freedom.
        Quantised angles are rounded to `STEP_DEG`; an eighth of the noise acts before the rounding.
    fps : float
        Frames per second.
    plant : (a, b, c), optional
        1/s, 1/s², 1/s²; drawn by default.
    names : collection of str
        Those of `RECORDINGS` that are made, each as it is among all five.

    Returns
    -------
    list of Record
        In random order. Their zero is declared, or the mean of the rest before the first command change.

    Raises
    ------
    SpecError, ValidationError
        If an effect is so strong that the rig leaves its reach, or an effect is invalid.
    """
    known = "constant_torque" in effects or _rng(seed, ZERO).random() < DECLARED
    spec = spec_of(effects, seed=seed, fps=fps, plant=plant)
    return filmed(spec, known=known, sigma_deg=sigma_deg, noise=noise, names=names)


def filmed(
    spec: Spec, *, known: bool, sigma_deg: float, noise: str = "white", names: Collection[str] | None = None
) -> list[Record]:
    """Make the recordings of a spec of `synth`, all by default.

    ``known`` is whether their zero is declared; the rest is as in `session`.
    """
    seen = look(spec)
    rng = np.random.default_rng(spec.seed)
    names = {recording.name for recording in spec.recordings} if names is None else names
    takes = {take.recording.name: take for take in perform(spec, seen, names)}
    records = []
    for number, recording in enumerate(spec.recordings):
        if recording.name in takes:
            exact = _record(spec, seen, takes[recording.name], known)
            angle = _measured(exact.angle, math.radians(sigma_deg), noise, rng)
            records.append(_from_zero(replace(exact, angle=angle)))
        else:  # its noise is drawn all the same, before that of the next
            frames = timetable(spec.camera, spec.effects, recording.duration_s, seed_of(spec, number, CLOCK)).times
            _measured(np.zeros(len(frames)), 0.0, noise, rng)
    return records


@lru_cache(maxsize=256)
def _residual(effects: tuple[tuple[str, tuple[tuple[str, float], ...]], ...], seed: int, fps: float) -> float:
    try:
        records = session({name: dict(keys) for name, keys in effects}, seed=seed, sigma_deg=0.0, fps=fps)
    except (SpecError, ValidationError):
        return math.inf
    true = spec_of({}, seed=seed).plant
    return math.degrees(fit_output_error(Plant(), records, [np.array([true.a, true.b, true.c])]).rmse)


def residual_deg(effects: Effects, seed: int, fps: float = 30) -> float:
    """Return the base model's RMS residual of a session without noise, °; infinite if the session is impossible."""
    return _residual(tuple((name, tuple(keys.items())) for name, keys in effects.items()), seed, fps)


def scaled(
    direction: Effects, seed: int, ratio: float, *, sigma_deg: float = 0.05, fps: float = 30
) -> dict[str, dict[str, float]]:
    """Scale effects until for each alone the base model's residual is ``ratio``·σ over all recordings without noise.

    Parameters
    ----------
    direction : mapping
        Effects from `benchmarks.blind.drawn.draw`.
    seed : int
        Seed of the session.
    ratio : float
        Base residual over noise, to within `CLOSE`.
    sigma_deg, fps : float
        Noise, °, and frames per second of the session.

    Returns
    -------
    dict
        Effects for `session`.

    Raises
    ------
    ValueError
        If no size of the effect gives this residual.
    """
    return {
        name: _scaled_alone(name, dict(keys), seed, ratio * sigma_deg, fps)[name] for name, keys in direction.items()
    }


def _scaled_alone(name: str, keys: dict[str, float], seed: int, wanted_deg: float, fps: float) -> dict[str, Any]:
    """Find the factor by a bracketed secant in logarithms, in which the residual is nearly linear."""
    low, high, at, slope = -math.inf, math.inf, 0.0, 1.0
    before: tuple[float, float] | None = None
    for _ in range(MOST_TRIALS):
        tried = {name: magnified(name, keys, math.exp(at))}
        residual = residual_deg(tried, seed, fps)
        over = math.log(residual / wanted_deg) if 0.0 < residual < math.inf else math.copysign(math.inf, residual - 1)
        if abs(over) < CLOSE:
            return tried
        low, high = (at, high) if over < 0 else (low, at)
        if math.isfinite(over):
            if before is not None and at != before[0]:
                slope = float(np.clip((over - before[1]) / (at - before[0]), 0.5, 8.0))
            before = (at, over)
        step = float(np.clip(over / slope, -2.0, 2.0))
        at -= step
        if not low < at < high:
            at = (low + high) / 2
        if high - low < 1e-6:
            break
    raise ValueError(f"{name}: no size leaves {wanted_deg:.3g}° of session {seed}")


def spec_of(effects: Effects, *, seed: int, fps: float = 30, plant: tuple[float, float, float] | None = None) -> Spec:
    """Draw the spec that `synth` would film for a session."""
    a, b, c = plant or tuple(np.array(TYPICAL) * (1 + SPREAD * _rng(seed, PLANT).uniform(-1, 1, 3)))
    swing = effects.get("linkage_geometry", {}).get("swing", 1.0)
    bare = {name: {key: value for key, value in keys.items() if key != "swing"} for name, keys in effects.items()}
    rng = _rng(seed, CAMERA)
    left = bool(rng.random() < 0.5)
    lever, behind, below = rng.uniform(160, 210), rng.uniform(40, 100), rng.uniform(20, 80)
    if wide := "lens_distortion" in effects:
        lever, behind, below = SMALLER * lever, FARTHER * behind, FARTHER * below
    return Spec.model_validate(
        {
            "seed": seed,
            "plant": {"a": float(a), "b": float(b), "c": float(c)},
            "effects": bare,
            "rig": {
                "lever_px": lever,
                "pivot_px": (319.5 + behind if left else 319.5 - behind, 239.5 + below),
                "facing": "left" if left else "right",
            },
            "camera": {"fps": fps, **({"distance_m": NEAR_M} if wide or "perspective" in effects else {})},
            # levels are drawn as head angles, which must stay within the reach of the linkage
            "recordings": _recordings(_rng(seed, MOVES), swing * float(b / c)),
        }
    )


def _recordings(rng: np.random.Generator, gain: float) -> list[dict[str, Any]]:
    def level(low: float, high: float) -> float:
        return float(gain * rng.uniform(low, high))

    heights = rng.uniform(3, 14, 7) * np.where(np.arange(7) % 2, -1, 1) * rng.choice([-1, 1])
    commands: dict[str, dict[str, Any]] = {
        "random": {"amplitude_deg": level(10, 13), "longest_s": rng.uniform(0.7, 1.0)},
        "stairs": {"levels_deg": [*(gain * heights).tolist(), 0.0], "tread_s": rng.uniform(0.75, 0.9)},
        "triangle": {"amplitude_deg": level(10, 15) * rng.choice([-1, 1]), "period_s": rng.uniform(3.5, 6.0)},
        "chirp": {"amplitude_deg": level(6, 9), "from_hz": 0.3, "to_hz": rng.uniform(4.0, 5.5)},
        "release": {"amplitude_deg": level(12, 17) * rng.choice([-1, 1]), "hold_s": rng.uniform(2.0, 3.0)},
    }
    return [
        {"name": kind, "duration_s": round(rng.uniform(7, 8), 1), "command": {"kind": kind} | commands[kind]}
        for kind in rng.permutation(RECORDINGS).tolist()
    ]


def _record(spec: Spec, seen: Scenery, take: Take, known: bool) -> Record:
    """Return the exact line angles of a take; a declared zero is the line's angle in this camera at rest at 0."""
    taken = take.table.taken
    rows = np.full(len(taken), seen.pinhole.lens_px[1])
    row_time = spec.effects.rolling_shutter.row_time_s if spec.effects.rolling_shutter else 0.0
    for _ in range(SETTLED if row_time else 1):
        when = taken + row_time * (rows - seen.pinhole.lens_px[1])
        pixels = marks(seen, replace(take, table=replace(take.table, taken=when)))
        rows = pixels[:, 1]
    mouth, mark = pixels[:, :2], pixels[:, 4:]
    line = _line(mouth - mark, seen.pinhole.mirrored)
    zero = 0.0
    if known:
        ahead = seen.pinhole.project([*seen.mouth, 0.0])
        zero = float(_line(ahead - mark[0], seen.pinhole.mirrored))
    x, y = np.median(mark, axis=0) - seen.pinhole.lens_px
    lever = float(np.median(np.hypot(*(mouth - mark).T)))
    assert take.command is not None
    return Record(
        take.recording.name,
        take.table.times,
        line - zero,
        Command(take.command[:, 0], np.radians(take.command[:, 1])),
        known,
        np.full(len(line), np.nan),
        view=View(zero, lever, (float(x), float(y)), seen.pinhole.mirrored),
    )


def _from_zero(record: Record) -> Record:
    """Subtract the mean before the first command change from the angle, unless its zero is declared."""
    if record.zero_known or record.command is None:
        return record
    zero = float(record.angle[record.time < record.command.first_change()].mean())
    return replace(record, angle=record.angle - zero, view=replace(record.view, neutral=zero))


def _line(arm: Floats, mirrored: bool) -> Floats:
    """Return the angle of the line from mark to mouth, upward positive, rad; arm (…, 2) in px to the right and down."""
    return np.arctan2(-arm[..., 1], -arm[..., 0] if mirrored else arm[..., 0])


def _measured(angle: Floats, sigma: float, noise: str, rng: np.random.Generator) -> Floats:
    """Return angles with noise of standard deviation ``sigma``, rad, of a kind that `session` lists."""
    if noise == "heavy-tailed":
        return angle + sigma * math.sqrt((TAILS - 2) / TAILS) * rng.standard_t(TAILS, len(angle))
    white = rng.normal(size=len(angle))
    if noise == "quantised":
        step = math.radians(STEP_DEG)
        return np.asarray(step * np.round((angle + sigma / 8.0 * white) / step))
    if noise == "coloured":
        for i in range(1, len(white)):
            white[i] = PHI * white[i - 1] + math.sqrt(1 - PHI**2) * white[i]
    return angle + sigma * white


def _rng(seed: int, purpose: int) -> np.random.Generator:
    return np.random.default_rng([seed, purpose])
