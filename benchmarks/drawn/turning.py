"""Things that turn all the way round, and hands on dials."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.drawn.canvas import BRIGHT, DULL, MARGIN, Canvas, pick, turned
from benchmarks.drawn.canvas import direction as u
from benchmarks.drawn.mechanism import Mechanism, Motion, Pose, Stage, motion, one


def _at(pivot: np.ndarray, radius: float, name: str) -> Callable[[Pose], np.ndarray]:
    return lambda pose: pivot + radius * u(pose[name])


def clock(stage: Stage) -> Mechanism:
    """Return a clock with one hand or two, which run, tick, or are moved to and fro."""
    rng, h = stage.rng, stage.height
    pivot, r = np.array(stage.middle), 0.4 * h
    steady, ticks, two = rng.random() < 0.6, rng.random() < 0.4, rng.random() < 0.4
    rate, period, other = -rng.uniform(15, 60), rng.uniform(0.25, 0.5), motion(stage, 60.0)
    colour, width = pick(rng, BRIGHT if rng.random() < 0.5 else DULL), rng.uniform(3, 10)

    def pose(t: float) -> Pose:
        hand = 90.0 - 6.0 * np.floor(t / period) if ticks else 90.0 + rate * t if steady else 60.0 + other(t)
        return {"hand": hand, "slow hand": 20.0 + hand / 12.0} if two else {"hand": hand}

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        _dial(canvas, pivot, r, np.arange(0, 360, 30))
        if two:
            canvas.bar(pivot, pivot + 0.5 * r * u(pose["slow hand"]), 1.6 * width, (35, 30, 30))
        canvas.bar(pivot - 0.15 * r * u(pose["hand"]), pivot + 0.85 * r * u(pose["hand"]), width, colour, 0.5 * width)
        canvas.disc(pivot, width, (30, 30, 30))

    return Mechanism(pivot, pose, paint, _at(pivot, 0.8 * r, "hand"))


def _dial(canvas: Canvas, pivot: np.ndarray, r: float, ticks: np.ndarray) -> None:
    canvas.disc(pivot, 1.12 * r, (60, 60, 60))
    canvas.disc(pivot, 1.05 * r, (230, 235, 235))
    for k, angle in enumerate(ticks):
        canvas.bar(pivot + 0.88 * r * u(angle), pivot + 0.98 * r * u(angle), 4.0 if k % 3 else 8.0, (40, 40, 40))


def gauge(stage: Stage) -> Mechanism:
    """Return the needle of a gauge with a scale, a coloured sector and a counterweight."""
    rng, h = stage.rng, stage.height
    pivot, r = stage.near(0.5, 0.5), h * rng.uniform(0.33, 0.42)
    needle, width = pick(rng, [(20, 20, 20), (30, 30, 190), pick(rng, BRIGHT)]), rng.uniform(3, 8)
    read, middle = motion(stage, rng.uniform(20, 100), ("steps", "mix", "damped", "sine")), rng.uniform(60, 120)
    sector = pick(rng, [None, (60, 60, 210), (80, 180, 90)])

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        _dial(canvas, pivot, r, np.arange(-45, 226, 22.5))
        if sector is not None:
            arc = np.linspace(-45, 0, 12)
            outer, inner = [pivot + 0.84 * r * u(a) for a in arc], [pivot + 0.76 * r * u(a) for a in arc[::-1]]
            canvas.polygon(outer + inner, sector)
        angle = pose["needle"]
        canvas.bar(pivot, pivot + 0.8 * r * u(angle), width, needle, 1.5)
        canvas.bar(pivot, pivot - 0.2 * r * u(angle), width, needle, 1.6 * width)
        canvas.disc(pivot, 0.07 * r, (70, 70, 70))

    return Mechanism(pivot, one("needle", lambda t: middle + read(t)), paint, _at(pivot, 0.7 * r, "needle"))


def weathercock(stage: Stage) -> Mechanism:
    """Return a weathercock from below: an arrow with a cock, before the sky, that the wind turns to and fro."""
    rng, h = stage.rng, stage.height
    pivot, r = stage.near(0.5, 0.5), h * rng.uniform(0.3, 0.4)
    wind, middle = motion(stage, rng.uniform(25, 70), ("mix", "sine", "steps")), rng.uniform(0, 360)
    iron = pick(rng, [(40, 40, 40), (30, 60, 90), (60, 140, 180)])
    cross = rng.random() < 0.6
    cock = [(-0.8, 0), (-0.9, 0.35), (-0.55, 0.2), (-0.2, 0.12), (0.05, 0.35), (0.2, 0.3), (0.15, 0.05), (0, 0)]

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["cock"]
        if cross:
            for k in range(4):
                canvas.bar(pivot, pivot + 0.6 * r * u(45 + 90 * k), 5.0, (90, 90, 95))
        canvas.bar(pivot - r * u(angle), pivot + 0.9 * r * u(angle), 6.0, iron)
        canvas.polygon(turned(r * np.array([(0.8, 0.12), (1.05, 0), (0.8, -0.12)]), angle) + pivot, iron)
        canvas.polygon(turned(r * np.array(cock), angle) + pivot, iron)
        canvas.disc(pivot, 0.05 * r, (80, 80, 85))

    return Mechanism(pivot, one("cock", lambda t: middle + wind(t)), paint, _at(pivot, -0.8 * r, "cock"))


def _spinning(stage: Stage, slowest: float, fastest: float) -> Motion:
    """Return a steady rotation with a slight wobble, at most 14° a frame."""
    rng = stage.rng
    rate = rng.choice([-1, 1]) * min(rng.uniform(slowest, fastest), 14.0 * stage.fps)
    wobble = motion(stage, 10.0, ("sine",))
    return lambda t: 30.0 + rate * t + wobble(t)


def wheel(stage: Stage) -> Mechanism:
    """Return a disc, with holes or without, that has a mark."""
    return _wheel(stage, teeth=0, marked=True)


def gear(stage: Stage) -> Mechanism:
    """Return a toothed wheel, with a mark or without."""
    return _wheel(stage, teeth=int(stage.rng.integers(10, 25)), marked=bool(stage.rng.random() < 0.6))


def _wheel(stage: Stage, *, teeth: int, marked: bool) -> Mechanism:
    rng = stage.rng
    r, pivot, spin = stage.height * rng.uniform(0.28, 0.38), stage.near(0.5, 0.5), _spinning(stage, 60, 400)
    body, holes = pick(rng, DULL), int(rng.integers(3, 7)) if rng.random() < 0.6 else 0
    mark = pick(rng, BRIGHT if not teeth or rng.random() < 0.7 else DULL)
    dark = tuple(int(0.55 * v + 20) for v in body)
    tooth = ((-0.28, 0.9), (-0.16, 1.0), (0.16, 1.0), (0.28, 0.9))

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["wheel"]
        if teeth:
            pitch = 360.0 / teeth
            canvas.polygon([pivot + r * f * u(angle + (k + x) * pitch) for k in range(teeth) for x, f in tooth], body)
        else:
            canvas.disc(pivot, r, body)
        for k in range(holes):
            canvas.disc(pivot + 0.55 * r * u(angle + (k + 0.5) * 360.0 / holes), 0.17 * r, dark)
        canvas.disc(pivot, 0.1 * r, (50, 50, 50))
        if marked:
            canvas.disc(pivot + 0.78 * r * u(angle), 0.09 * r, mark)

    return Mechanism(pivot, one("wheel", spin), paint, _at(pivot, r, "wheel"))


def spoked_wheel(stage: Stage) -> Mechanism:
    """Return a bicycle's wheel: thin spokes all alike, and one valve."""
    rng = stage.rng
    r, pivot, spokes = stage.height * rng.uniform(0.33, 0.42), stage.near(0.5, 0.5), int(rng.integers(8, 20))
    rate = rng.choice([-1, 1]) * min(rng.uniform(20, 200), stage.fps * 360.0 / spokes / 5.0)
    slowing, valve = rng.uniform(0.0, 0.25), pick(rng, [(30, 30, 30), (230, 230, 230), pick(rng, BRIGHT)])
    sky = pick(rng, [None, (200, 200, 195)])

    def angle(t: float) -> float:
        return 20.0 + (rate * (1.0 - np.exp(-slowing * t)) / slowing if slowing > 0.02 else rate * t)

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        turn = pose["wheel"]
        canvas.disc(pivot, r, (40, 40, 45))
        canvas.disc(pivot, 0.9 * r, (190, 190, 190))
        canvas.disc(pivot, 0.84 * r, sky or (165, 175, 170))
        for k in range(spokes):
            canvas.bar(pivot, pivot + 0.86 * r * u(turn + 360.0 * k / spokes), 2.0, (110, 110, 115))
        canvas.disc(pivot, 0.08 * r, (90, 90, 95))
        half = 180.0 / spokes
        canvas.bar(pivot + 0.85 * r * u(turn + half), pivot + 0.7 * r * u(turn + half), 0.03 * r + 2.0, valve)

    return Mechanism(pivot, one("wheel", angle), paint, _at(pivot, r, "wheel"))


def propeller(stage: Stage) -> Mechanism:
    """Return a propeller of two to four blades, one of them marked or none."""
    rng = stage.rng
    r, pivot, blades = stage.height * rng.uniform(0.3, 0.4), stage.near(0.5, 0.5), int(rng.integers(2, 5))
    rate = rng.choice([-1, 1]) * min(rng.uniform(30, 200), stage.fps * 360.0 / blades / 12.0)
    return _bladed(stage, pivot, r, blades, lambda t: 40.0 + rate * t, marked=rng.random() < 0.5)


def fan(stage: Stage) -> Mechanism:
    """Return a fan in a cage that starts slowly; it turns by at most a sixth of the blades' pitch in a frame."""
    rng = stage.rng
    r, pivot, blades = stage.height * rng.uniform(0.3, 0.4), stage.near(0.5, 0.5), int(rng.integers(3, 6))
    seconds = stage.frames / stage.fps
    rate, tau = -min(rng.uniform(100, 700), stage.fps * 360.0 / blades / 6.0), seconds * rng.uniform(0.3, 0.8)

    def angle(t: float) -> float:
        return 15.0 + rate * (t - tau * (1.0 - np.exp(-t / tau)))

    return _bladed(stage, pivot, r, blades, angle, marked=rng.random() < 0.6, cage=True)


def _bladed(
    stage: Stage, pivot: np.ndarray, r: float, blades: int, angle: Motion, *, marked: bool, cage: bool = False
) -> Mechanism:
    rng = stage.rng
    colour, mark, w = pick(rng, [*DULL, *BRIGHT]), pick(rng, BRIGHT), rng.uniform(0.05, 0.1) * stage.height
    shape = np.array(
        [(0, -0.25), (0.3 * r / w, -0.6), (0.9 * r / w, -0.45), (r / w, 0), (0.9 * r / w, 0.3), (0.3 * r / w, 0.35)]
    )

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        turn = pose["blades"]
        if cage:
            canvas.bar(pivot, (pivot[0], stage.height + MARGIN), 0.1 * r, (70, 70, 70))
        for k in range(blades):
            canvas.polygon(turned(w * np.vstack([shape, (0, 0.25)]), turn + 360.0 * k / blades) + pivot, colour)
        if marked:
            canvas.disc(pivot + 0.85 * r * u(turn), 0.3 * w, mark)
        canvas.disc(pivot, 0.5 * w, (60, 60, 60))
        if cage:
            for k in range(24):
                canvas.bar(pivot + 0.15 * r * u(15 * k), pivot + 1.12 * r * u(15 * k), 1.2, (170, 170, 170))

    return Mechanism(pivot, one("blades", angle), paint, _at(pivot, 0.8 * r, "blades"))


def t_shape(stage: Stage) -> Mechanism:
    """Return a plate in the shape of a T, that turns round or to and fro."""
    rng = stage.rng
    pivot, r, width = stage.near(0.5, 0.5), stage.height * rng.uniform(0.3, 0.4), rng.uniform(14, 30)
    colour, dot = pick(rng, [*DULL, *BRIGHT]), pick(rng, [None, pick(rng, BRIGHT)])
    rate, swing, round_ = rng.choice([-1, 1]) * rng.uniform(30, 200), motion(stage, 50.0), rng.random() < 0.5
    rate = np.clip(rate, -14 * stage.fps, 14 * stage.fps)
    half = width / 2.0

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        turn = pose["plate"]
        for x0, x1, y in ((-0.15 * r, 0.8 * r, half), (0.8 * r, 0.8 * r + width, 0.4 * r)):
            canvas.polygon(turned([(x0, -y), (x1, -y), (x1, y), (x0, y)], turn) + pivot, colour)
        if dot is not None:
            canvas.disc(pivot, 0.3 * width, dot)

    def angle(t: float) -> float:
        return 40.0 + (rate * t if round_ else swing(t))

    return Mechanism(pivot, one("plate", angle), paint, _at(pivot, 0.8 * r, "plate"))


KINDS = {
    "clock": clock,
    "gauge": gauge,
    "weathercock": weathercock,
    "wheel": wheel,
    "gear": gear,
    "spokes": spoked_wheel,
    "propeller": propeller,
    "fan": fan,
    "tshape": t_shape,
}
