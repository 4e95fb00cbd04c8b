"""Things that hang and swing: balls on threads and rods, a metronome, a swing with a person, a knee."""

from __future__ import annotations

import cv2
import numpy as np

from benchmarks.drawn.canvas import BRIGHT, DULL, MARGIN, SKIN, Canvas, Picture, direction, pick, turned
from benchmarks.drawn.mechanism import Mechanism, Pose, Stage, motion, one


def bob(stage: Stage) -> Mechanism:
    """Return a ball on a thread, its pivot in the picture."""
    return _pendulum(
        stage, stage.height * stage.rng.uniform(0.5, 0.75), stage.near(0.5, 0.11), stage.rng.uniform(10, 35)
    )


def bob_pivot_outside(stage: Stage) -> Mechanism:
    """Return a ball on a thread, its pivot above the picture."""
    length = stage.height * stage.rng.uniform(1.0, 1.5)
    pivot = stage.near(0.5, 0.82) - (0.0, length)
    return _pendulum(stage, length, pivot, stage.rng.uniform(6, 14), mount=False)


def rod_and_bob(stage: Stage) -> Mechanism:
    """Return a ball on a rod."""
    length, pivot = stage.height * stage.rng.uniform(0.5, 0.75), stage.near(0.5, 0.11)
    return _pendulum(stage, length, pivot, stage.rng.uniform(10, 35), thick=(6, 14))


def before_plaid(stage: Stage) -> Mechanism:
    """Return a ball on a rod before a curtain of plaid."""
    length, pivot = stage.height * stage.rng.uniform(0.5, 0.75), stage.near(0.5, 0.11)
    scenery = _plaid(stage)
    return _pendulum(stage, length, pivot, stage.rng.uniform(10, 35), thick=(3, 10), scenery=scenery)


def _plaid(stage: Stage) -> Picture:
    rng = stage.rng
    shape = stage.height + 2 * MARGIN, stage.width + 2 * MARGIN
    cloth = np.full((*shape, 3), pick(rng, BRIGHT if rng.random() < 0.5 else DULL), float)
    y, x = np.mgrid[: shape[0], : shape[1]]
    for _ in range(int(rng.integers(2, 5))):
        thread, period, width = np.array(pick(rng, [*BRIGHT, *DULL])), rng.uniform(30, 110), rng.uniform(0.08, 0.35)
        offset = rng.uniform(0, 110, 2)
        fold = 6.0 * np.sin(y / 70.0)  # a curtain does not hang straight
        for place in (x + fold + offset[0], y + offset[1]):
            cloth[(place % period) < width * period] = 0.5 * cloth[(place % period) < width * period] + 0.5 * thread
    return cv2.GaussianBlur(np.clip(cloth, 0, 255).astype(np.uint8), (0, 0), rng.uniform(0.8, 2.0))


def _pendulum(
    stage: Stage,
    length: float,
    pivot: np.ndarray,
    amplitude: float,
    *,
    mount: bool = True,
    thick: tuple[float, float] = (1.5, 3.0),
    scenery: Picture | None = None,
) -> Mechanism:
    rng = stage.rng
    swing, offset = motion(stage, amplitude, ("sine", "damped")), rng.uniform(-4, 4)
    ball = pick(rng, BRIGHT if rng.random() < 0.6 else DULL)
    radius, thread, width = stage.height * rng.uniform(0.035, 0.08), pick(rng, DULL), rng.uniform(*thick)
    mounted, shiny = mount and rng.random() < 0.6, rng.random() < 0.4

    def end(pose: Pose) -> np.ndarray:
        return pivot + length * direction(pose["pendulum"])

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        place = end(pose)
        if mounted:
            canvas.polygon(pivot + np.array([(-60, -12), (60, -12), (60, 0), (-60, 0)]), (75, 70, 70))
        canvas.bar(pivot, place, width, thread)
        canvas.disc(place, radius, ball)
        if shiny:
            canvas.disc(place + np.array([-0.3, -0.35]) * radius, 0.22 * radius, (245, 245, 245))

    return Mechanism(pivot, one("pendulum", lambda t: -90.0 + offset + swing(t)), paint, end, scenery)


def metronome(stage: Stage) -> Mechanism:
    """Return a metronome whose weight has the colour of nothing else, or not."""
    rng, w, h = stage.rng, stage.width, stage.height
    pivot, length = np.array([w / 2, 0.85 * h]), h * rng.uniform(0.6, 0.7)
    rate, amplitude = 2.0 * np.pi * min(rng.uniform(0.6, 1.2), stage.fps / 14), rng.uniform(18, 30)
    weight, at, size = pick(rng, BRIGHT if rng.random() < 0.6 else DULL), rng.uniform(0.5, 0.8), 0.04 * h
    wood, dark = pick(rng, [(110, 75, 50), (50, 75, 110), (60, 60, 65)]), rng.uniform(0.6, 0.9)
    foot = tuple(int(v * dark) for v in wood)
    ticks = rng.random() < 0.5

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["metronome"]
        case = [(w * 0.36, h), (w * 0.45, h * 0.15), (w * 0.55, h * 0.15), (w * 0.64, h)]
        canvas.polygon(case, wood)
        if ticks:
            for k in range(8):
                y = h * (0.25 + 0.06 * k)
                canvas.bar((w * 0.48, y), (w * 0.52, y), 2.0, (220, 225, 225))
        canvas.bar(pivot, pivot + length * direction(angle), 5.0, (195, 190, 190))
        shape = np.array([(0.7, 1.0), (0.7, -1.0), (-0.7, -0.7), (-0.7, 0.7)]) * size + (at * length, 0.0)
        canvas.polygon(turned(shape, angle) + pivot, weight)
        canvas.polygon([(w * 0.36, h * 0.8), (w * 0.64, h * 0.8), (w * 0.66, h + MARGIN), (w * 0.34, h + MARGIN)], foot)

    def grip(pose: Pose) -> np.ndarray:
        return pivot + length * direction(pose["metronome"])

    return Mechanism(pivot, one("metronome", lambda t: 90.0 + amplitude * np.sin(rate * t)), paint, grip)


def person_on_swing(stage: Stage) -> Mechanism:
    """Return a person on a swing between two posts, who leans back and forth with it."""
    rng, w, h = stage.rng, stage.width, stage.height
    length, pivot = h * rng.uniform(0.55, 0.65), stage.near(0.5, 0.08, 8)
    swing, k = motion(stage, rng.uniform(15, 40), ("sine", "damped")), h / 480.0
    shirt, trousers, hair = pick(rng, BRIGHT), pick(rng, DULL), pick(rng, [(25, 30, 40), (60, 110, 160), (20, 20, 20)])

    def seat(pose: Pose) -> np.ndarray:
        return pivot + length * direction(pose["swing"])

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["swing"]
        for side in (-1, 1):
            canvas.bar(pivot, (w / 2 + side * 0.36 * w, h + MARGIN), 10 * k, (70, 75, 80))
        # x from the pivot towards the seat, y forwards

        def body(x: float, y: float) -> np.ndarray:
            return turned([(x, y)], angle)[0] + seat(pose)

        canvas.bar(pivot, seat(pose), 3 * k, (60, 60, 60))
        canvas.bar(body(0, -35 * k), body(0, 35 * k), 8 * k, (40, 60, 90))
        canvas.bar(body(-8 * k, -10 * k), body(-8 * k, 45 * k), 20 * k, trousers)
        canvas.bar(body(-8 * k, 45 * k), body(50 * k, 55 * k), 16 * k, trousers)
        canvas.bar(body(-5 * k, -10 * k), body(-80 * k, -18 * k), 34 * k, shirt)
        canvas.bar(body(-70 * k, -14 * k), body(-75 * k, 4 * k), 10 * k, SKIN)
        canvas.disc(body(-104 * k, -18 * k), 19 * k, SKIN)
        canvas.disc(body(-110 * k, -24 * k), 16 * k, hair)

    return Mechanism(pivot, one("swing", lambda t: -90.0 + swing(t)), paint, seat)


def bending_limb(stage: Stage) -> Mechanism:
    """Return the knee or elbow of a drawn figure: the upper limb is still, the lower one bends about the joint."""
    rng, h = stage.rng, stage.height
    hip, upper = stage.near(0.45, 0.2), -90.0 + rng.uniform(-15, 55)
    thigh, shank = h * rng.uniform(0.27, 0.33), h * rng.uniform(0.27, 0.34)
    knee, k = hip + thigh * direction(upper), h / 480.0
    bend, offset = motion(stage, rng.uniform(15, 40), ("sine", "mix", "triangle")), rng.uniform(-60, -20)
    cloth, lower = pick(rng, [*DULL, *BRIGHT]), pick(rng, [SKIN, pick(rng, DULL), pick(rng, BRIGHT)])
    shoe, marker = pick(rng, [*BRIGHT, (30, 30, 30)]), pick(rng, [None, None, (240, 240, 240), pick(rng, BRIGHT)])

    def ankle(pose: Pose) -> np.ndarray:
        return knee + shank * direction(pose["lower limb"])

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle, end = pose["lower limb"], ankle(pose)
        canvas.polygon(hip + np.array([(-40, -2 * h), (55, -2 * h), (50, 25), (-45, 25)]) * k, cloth)
        canvas.bar(knee, end, 40 * k, lower, 26 * k)
        canvas.polygon(turned(np.array([(-14, -14), (18, -14), (18, 52), (2, 52)]) * k, angle) + end, shoe)
        canvas.bar(hip, knee, 62 * k, cloth, 44 * k)
        canvas.disc(knee, 22 * k, cloth)
        if marker is not None:  # as for the analysis of a gait
            for share in (0.0, 0.9):
                canvas.disc(knee + share * (end - knee), 8 * k, marker)

    return Mechanism(knee, one("lower limb", lambda t: upper + offset + bend(t)), paint, ankle)


KINDS = {
    "bob": bob,
    "bob-out": bob_pivot_outside,
    "rod-bob": rod_and_bob,
    "plaid": before_plaid,
    "metronome": metronome,
    "swing": person_on_swing,
    "limb": bending_limb,
}
