"""What a phone, its holder and the room do to a film, each drawn from the seed."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.drawn.canvas import MARGIN, SKIN, Canvas, Picture, photograph, pick
from benchmarks.drawn.mechanism import Stage

SHARES = {
    "noise": 0.6,
    "photo": 0.25,
    "shake": 0.12,
    "pan": 0.06,
    "blur": 0.15,
    "light": 0.08,
    "steps": 0.12,
    "flicker": 0.12,
    "shutter": 0.15,
    "stamps": 0.15,
    "lowrate": 0.12,
    "shadow": 0.08,
    "person": 0.08,
    "hand": 0.15,
    "bw": 0.08,
    "faded": 0.08,
    "vignette": 0.1,
    "jagged": 0.08,
}
"""Each fault's share of the films. Photo: a photograph as background. Light: it varies slowly. Steps: of the automatic
exposure. Stamps: frames at uneven times, as the container says. Lowrate: strong compression. Jagged: edges without
smoothing. Hand: it starts the motion and leaves."""
MAINS_HZ = 100.0


@dataclass(frozen=True)
class Faults:
    """The faults of one film, and how large they are."""

    names: frozenset[str]
    noise: float
    """Standard deviation, grey levels."""
    exposure: float
    """Share of the time between frames; 0 without blur."""
    readout_s: float
    """Time from the first row to the last; 0 without a rolling shutter."""
    shake_px: float
    shake_hz: float
    phase: np.ndarray
    """(4,) of shake and light, rad."""
    pan_px: np.ndarray
    """(2,) over the whole film."""
    light: tuple[float, float]
    """Relative amplitude and frequency, Hz."""
    flicker: float
    gains: tuple[tuple[float, float], ...]
    """Times, s, and gains of the automatic exposure."""
    shadow: tuple[float, float]
    """Transmission, and width, px."""
    fade: float
    released_s: float
    """When the hand lets go."""
    passer_by: tuple[tuple[int, int, int], float, float, int]
    """Colour, half width in px, when (share of the film), and from which side."""


def draw_faults(stage: Stage) -> Faults:
    """Return a film's faults."""
    rng, seconds = stage.rng, stage.frames / stage.fps
    has = frozenset(name for name, share in SHARES.items() if rng.random() < share)
    changes = np.sort(rng.uniform(0.1, 0.95, int(rng.integers(1, 5)))) * seconds
    gains = [(0.0, 1.0), *((float(at), float(rng.uniform(0.75, 1.25))) for at in changes)]
    return Faults(
        names=has,
        noise=rng.uniform(0.5, 5.0) if "noise" in has else 0.0,
        exposure=rng.uniform(0.2, 0.8) if "blur" in has else 0.0,
        readout_s=min(rng.uniform(0.006, 0.02), 0.8 / stage.fps) if "shutter" in has else 0.0,
        shake_px=pick(rng, [rng.uniform(0.3, 1.0), rng.uniform(0.5, 4.0)]) if "shake" in has else 0.0,
        shake_hz=rng.uniform(2.0, 6.0),
        phase=rng.uniform(0.0, 2.0 * np.pi, 4),
        pan_px=rng.uniform(-1.0, 1.0, 2) * (40.0, 15.0) if "pan" in has else np.zeros(2),
        light=(rng.uniform(0.15, 0.4) if "light" in has else 0.0, rng.uniform(0.1, 1.5)),
        flicker=rng.uniform(0.05, 0.25) if "flicker" in has else 0.0,
        gains=tuple(gains) if "steps" in has else ((0.0, 1.0),),
        shadow=(rng.uniform(0.3, 0.9), rng.uniform(60.0, 200.0)),
        fade=rng.uniform(0.15, 0.4) if "faded" in has else 1.0,
        released_s=rng.uniform(0.1, 0.3) * seconds if "hand" in has else 0.0,
        passer_by=(
            pick(rng, [(60, 50, 40), (160, 120, 90), (50, 80, 150), (30, 30, 30)]),
            stage.height * rng.uniform(0.05, 0.14),
            rng.uniform(0.15, 0.5),
            int(rng.choice([-1, 1])),
        ),
    )


def own_time(t: float, released_s: float) -> float:
    """Return the mechanism's time: it stands until the hand lets go, and is at its full speed 0.3 s later."""
    if released_s == 0.0:
        return t
    late, gradual = t - released_s, 0.3
    return max(late, 0.0) ** 2 / (2.0 * gradual) if late < gradual else late - gradual / 2.0


def stamps(stage: Stage, faults: Faults) -> np.ndarray:
    """Return the frames' times, s: even ones, or a phone's, which vary by a tenth and lack some frames."""
    if "stamps" not in faults.names:
        return np.arange(stage.frames) / stage.fps
    gaps = 1.0 + 0.1 * stage.rng.uniform(-1.0, 1.0, stage.frames) + (stage.rng.random(stage.frames) < 0.04)
    return np.concatenate([[0.0], np.cumsum(gaps[1:])]) / stage.fps


def room(stage: Stage, faults: Faults) -> Picture:
    """Return what stands behind the mechanism, margin included: a wall with some furniture, or a photograph."""
    rng = stage.rng
    h, w = stage.height + 2 * MARGIN, stage.width + 2 * MARGIN
    if "photo" in faults.names:
        picture = photograph(rng)
        large = 1.01 * max(h / picture.shape[0], w / picture.shape[1])
        picture = cv2.resize(picture, None, fx=large, fy=large, interpolation=cv2.INTER_CUBIC)[:h, :w]
        share = rng.uniform(0.35, 0.8)
        picture = (share * picture + (1.0 - share) * rng.uniform(100, 220)).astype(np.uint8)
        return cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.8, 3.0)) if rng.random() < 0.6 else picture
    slope = rng.uniform(-15, 15, 2)
    shade = np.linspace(-1, 1, w)[None, :, None] * slope[0] + np.linspace(-1, 1, h)[:, None, None] * slope[1]
    picture = np.clip(rng.uniform(120, 235) + rng.uniform(-12, 12, 3) + shade, 0, 255).astype(np.uint8)
    for _ in range(int(rng.integers(0, 6))):
        x, y = rng.uniform((0, 0), (w, h)).astype(int)
        a, b, grey = (int(v) for v in rng.uniform((20, 20, 60), (160, 160, 220)))
        if rng.random() < 0.5:
            cv2.rectangle(picture, (x, y), (x + a, y + b), (grey, grey + 5, grey + 10), -1)
        else:
            cv2.line(picture, (x, y), (x + 3 * a, y + b), (grey, grey, grey), 3)
    return picture


def paint_people(canvas: Canvas, stage: Stage, faults: Faults, t: float, grip: np.ndarray) -> None:
    """Paint who passes before the mechanism, and the hand that lets it go."""
    if "person" in faults.names:
        colour, half, start, side = faults.passer_by
        share = np.clip((t * stage.fps / stage.frames - start) / 0.45, -0.2, 1.2)
        x = stage.width / 2.0 + side * ((stage.width + 300) * share - stage.width / 2.0 - 150)
        chest = np.array([x, 0.75 * stage.height])
        canvas.disc(chest - (0, 2.6 * half), 0.6 * half, SKIN)
        outline = [(-half, -2 * half), (half, -2 * half), (1.1 * half, stage.height), (-1.1 * half, stage.height)]
        canvas.polygon(chest + np.array(outline), colour)
    late = t - faults.released_s
    if "hand" in faults.names and late < 1.0:
        k, side = stage.height / 480.0, 1.0 if grip[0] > stage.width / 2.0 else -1.0
        away = max(late, 0.0) ** 2 * 900.0 * k
        hand = grip + (side * (away + 14 * k), 0.2 * away)
        canvas.bar(hand, hand + (side * stage.width, 0.4 * stage.width), 44 * k, SKIN, 70 * k)
        canvas.disc(hand, 26 * k, SKIN)
        for y in (-16, -4, 8):
            canvas.bar(hand + (0, y * k), hand + (-side * 26 * k, 0.7 * y * k), 11 * k, SKIN)
