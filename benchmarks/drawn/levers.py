"""Beams, levers, doors and wipers."""

from __future__ import annotations

import numpy as np

from benchmarks.drawn.canvas import BRIGHT, DULL, MARGIN, Canvas, pick, turned
from benchmarks.drawn.canvas import direction as u
from benchmarks.drawn.mechanism import Mechanism, Pose, Stage, motion, one


def _block(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float]]:
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def wiper(stage: Stage) -> Mechanism:
    """Return a wiper: a long blade on an arm."""
    return _wiper(stage, drops=0)


def windscreen(stage: Stage) -> Mechanism:
    """Return a wiper on a windscreen with drops; those in its way vanish and come again."""
    return _wiper(stage, drops=int(stage.rng.integers(30, 120)))


def _wiper(stage: Stage, *, drops: int) -> Mechanism:
    rng, h = stage.rng, stage.height
    pivot, length = stage.near(0.5, 0.95, 25.0), h * rng.uniform(0.6, 0.75)
    sweep = motion(stage, rng.uniform(35, 60), ("triangle", "sine"))
    rubber, begins, width = pick(rng, DULL), rng.uniform(0.35, 0.5), rng.uniform(5, 12)
    place = rng.uniform((0, 0), (stage.width, h), (drops, 2))
    radius, shade = rng.uniform(2, 7, drops) * h / 480.0, rng.integers(150, 250, drops)
    comes = rng.uniform(0.1, 1.5, drops)
    arm = np.arctan2(pivot[1] - place[:, 1], place[:, 0] - pivot[0])
    wiped = np.hypot(*(place - pivot).T) < length
    # a drop is wiped when the blade passes it, and is there again some time later
    grid = np.linspace(0.0, stage.frames / stage.fps, 4 * stage.frames)
    side = np.sign(np.degrees(arm)[:, None] - np.array([90.0 + sweep(t) for t in grid]))
    passes = [grid[1:][row[1:] != row[:-1]] for row in side] if drops else []

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        for i in range(drops):
            before = passes[i][passes[i] <= t]
            if wiped[i] and len(before) and t - before[-1] < comes[i]:
                continue
            grey = int(shade[i])
            canvas.disc(place[i], radius[i], (grey, grey, grey - 10))
            canvas.disc(place[i] + 0.3 * radius[i], 0.6 * radius[i], (grey - 70, grey - 70, grey - 75))
        d = u(pose["wiper"])
        canvas.bar(pivot, pivot + 0.75 * length * d, width, (45, 45, 45), 0.6 * width)
        canvas.bar(pivot + begins * length * d, pivot + length * d, 1.5 * width, rubber)
        canvas.disc(pivot, width, (45, 45, 45))

    return Mechanism(
        pivot, one("wiper", lambda t: 90.0 + sweep(t)), paint, lambda pose: pivot + length * u(pose["wiper"])
    )


def seesaw(stage: Stage) -> Mechanism:
    """Return a seesaw with loads or without."""
    rng, h = stage.rng, stage.height
    pivot, length = stage.near(0.5, 0.6), stage.width * rng.uniform(0.28, 0.4)
    rock, w = motion(stage, rng.uniform(8, 22)), rng.uniform(4, 8)
    wood, ball, box, loads = pick(rng, DULL), pick(rng, BRIGHT), pick(rng, BRIGHT), rng.random() < 0.7

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["seesaw"]
        canvas.polygon(pivot + h * np.array([(0, 0), (0.12, 0.3), (-0.12, 0.3)]), (90, 80, 80))
        canvas.polygon(turned(_block(-length, -w, length, w), angle) + pivot, wood)
        if loads:
            canvas.disc(turned([(0.85 * length, w + 0.05 * h)], angle)[0] + pivot, 0.05 * h, ball)
            canvas.polygon(turned(_block(-0.95 * length, w, -0.7 * length, w + 0.1 * h), angle) + pivot, box)

    return Mechanism(pivot, one("seesaw", rock), paint, lambda pose: pivot + 0.9 * length * u(pose["seesaw"]))


def balance(stage: Stage) -> Mechanism:
    """Return a balance: its beam turns, and two equal pans hang from the ends and stay upright."""
    rng, h = stage.rng, stage.height
    pivot, length = stage.near(0.5, 0.3, 10), min(0.36 * stage.width, h * rng.uniform(0.3, 0.42))
    tilt = motion(stage, rng.uniform(5, 15), ("damped", "sine", "mix"))
    brass, pan, pointer = (
        pick(rng, [(60, 150, 190), (60, 60, 65), (190, 195, 195)]),
        pick(rng, DULL),
        rng.random() < 0.6,
    )
    cord = h * rng.uniform(0.25, 0.35)

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["beam"]
        canvas.bar(pivot, (pivot[0], 0.9 * h), 0.03 * h, (70, 70, 75))
        canvas.polygon(_block(pivot[0] - 0.15 * h, 0.88 * h, pivot[0] + 0.15 * h, 0.92 * h), (70, 70, 75))
        for side in (-1, 1):
            end = pivot + side * length * u(angle)
            plate = end + (0, cord)
            canvas.bar(pivot, end, 0.035 * h, brass, 0.018 * h)
            for foot in (-0.1, 0.1):
                canvas.bar(end, plate + (foot * h, 0), 1.5, (90, 90, 90))
            canvas.polygon(plate + h * np.array([(-0.11, 0), (0.11, 0), (0.07, 0.03), (-0.07, 0.03)]), pan)
        if pointer:
            canvas.bar(pivot, pivot + 0.3 * h * u(angle - 90.0), 5.0, (40, 40, 200), 2.0)
        canvas.disc(pivot, 0.02 * h, (230, 230, 230))

    return Mechanism(pivot, one("beam", tilt), paint, lambda pose: pivot + length * u(pose["beam"]))


def two_handles(stage: Stage) -> Mechanism:
    """Return a lever with two equal handles, one on each side of its pivot."""
    rng, h = stage.rng, stage.height
    pivot, length = stage.near(0.5, 0.5), h * rng.uniform(0.3, 0.4)
    turn, middle = motion(stage, rng.uniform(15, 55)), rng.uniform(0, 180)
    steel, handle, w = pick(rng, DULL), pick(rng, [*BRIGHT, *DULL]), rng.uniform(8, 16)
    plate = rng.random() < 0.5

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["lever"]
        if plate:
            canvas.disc(pivot, 0.14 * h, (150, 150, 155))
        canvas.bar(pivot - length * u(angle), pivot + length * u(angle), w, steel)
        for side in (-1, 1):
            canvas.bar(pivot + side * 0.7 * length * u(angle), pivot + side * 1.05 * length * u(angle), 2.0 * w, handle)
        canvas.disc(pivot, 0.8 * w, (60, 60, 65))

    return Mechanism(
        pivot, one("lever", lambda t: middle + turn(t)), paint, lambda pose: pivot + length * u(pose["lever"])
    )


def door(stage: Stage) -> Mechanism:
    """Return a door seen from above, in a wall, with handles on both sides; it opens by up to 100° and closes."""
    rng, h = stage.rng, stage.height
    pivot, length, w = stage.near(0.32, 0.7), h * rng.uniform(0.45, 0.6), rng.uniform(10, 22)
    wide, period, seconds = rng.uniform(35, 100), rng.uniform(2.0, 5.0), stage.frames / stage.fps
    period = max(min(period, seconds), 14.0 / stage.fps)
    wood, wall = (
        pick(rng, [(90, 130, 170), (200, 205, 210), (60, 75, 110)]),
        pick(rng, [(170, 170, 170), (120, 130, 140)]),
    )
    knob = pick(rng, [(60, 60, 60), (200, 200, 205), (60, 170, 200)])

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        x, y = pivot
        for left, right in ((-MARGIN, x - 0.4 * w), (x + length + 4, stage.width + MARGIN)):
            canvas.polygon(_block(left, y - w, right, y + w), wall)
        angle = pose["door"]
        canvas.polygon(turned(_block(0, -w / 2, length, w / 2), angle) + pivot, wood)
        for side in (-1, 1):
            lever = _block(0.86 * length, side * w / 2, 0.89 * length, side * (w / 2 + 14))
            canvas.polygon(turned(lever, angle) + pivot, knob)
            grip = _block(0.76 * length, side * (w / 2 + 10), 0.89 * length, side * (w / 2 + 16))
            canvas.polygon(turned(grip, angle) + pivot, knob)

    return Mechanism(
        pivot,
        one("door", lambda t: wide * 0.5 * (1.0 - np.cos(2.0 * np.pi * t / period))),
        paint,
        lambda pose: pivot + 0.85 * length * u(pose["door"]),
    )


def oil_pump(stage: Stage) -> Mechanism:
    """Return an oil pump's walking beam with its head; a crank turns beside it and a rod joins them."""
    rng, h = stage.rng, stage.height
    pivot, k = stage.near(0.5, 0.35, 10), h / 480.0
    front, back, crank = 150 * k, 130 * k, rng.uniform(25, 45) * k
    rate, start = 2.0 * np.pi * min(rng.uniform(0.3, 0.8), stage.fps / 20.0), rng.uniform(0, 2 * np.pi)
    axle = pivot + (-back, 190 * k)
    steel, head = pick(rng, [(40, 150, 200), (50, 50, 150), (70, 70, 70), (60, 110, 60)]), pick(rng, DULL)
    rod = float(np.hypot(190 * k, 0.0))

    def pose(t: float) -> Pose:
        pin = axle + crank * u(np.degrees(start + rate * t))
        # the triangle of beam's end, pin and pivot
        line = pin - pivot
        apart = float(np.hypot(*line))
        inner = np.arccos(np.clip((back**2 + apart**2 - rod**2) / (2.0 * back * apart), -1.0, 1.0))
        beam = np.degrees(np.arctan2(-line[1], line[0]) - inner) % 360.0
        return {"beam": beam - 180.0, "crank": np.degrees(start + rate * t)}

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        for foot in (-60, 60):
            canvas.bar(pivot, pivot + np.array([foot, 230]) * k, 14 * k, (85, 85, 90))
        angle, tail = pose["beam"], pivot - back * u(pose["beam"])
        pin = axle + crank * u(pose["crank"])
        canvas.disc(axle, 12 * k, (60, 60, 60))
        canvas.bar(axle - 0.8 * crank * u(pose["crank"]), pin, 22 * k, (75, 75, 80), 14 * k)
        canvas.bar(tail, pin, 8 * k, (110, 110, 115))
        canvas.polygon(turned(_block(-back, -11 * k, front, 11 * k), angle) + pivot, steel)
        shape = np.array([(140, 40), (165, 30), (175, 0), (165, -35), (140, -55)]) * k
        canvas.polygon(turned(shape, angle) + pivot, head)
        canvas.bar(pivot + (172 * k, 0), pivot + (172 * k, 240 * k), 3 * k, (50, 50, 50))
        canvas.disc(pivot, 10 * k, (200, 200, 200))

    return Mechanism(pivot, pose, paint, lambda pose: pivot + front * u(pose["beam"]))


KINDS = {
    "wiper": wiper,
    "windscreen": windscreen,
    "seesaw": seesaw,
    "balance": balance,
    "handles": two_handles,
    "door": door,
    "pump": oil_pump,
}
