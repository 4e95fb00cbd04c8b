"""An arm of two links, a robot's last link, and an irregular plate."""

from __future__ import annotations

import numpy as np

from benchmarks.drawn.canvas import BRIGHT, DULL, Canvas, photograph, pick, turned
from benchmarks.drawn.canvas import direction as u
from benchmarks.drawn.mechanism import Mechanism, Pose, Stage, motion, one


def arm(stage: Stage) -> Mechanism:
    """Return an arm of two links on a foot; the dot is on either or on none."""
    rng, h = stage.rng, stage.height
    pivot, w = stage.near(0.5, 0.78), rng.uniform(14, 24)
    lengths = h * rng.uniform(0.3, 0.38), h * rng.uniform(0.22, 0.3)
    moves = motion(stage, rng.uniform(15, 35)), motion(stage, rng.uniform(20, 50))
    first, second = rng.uniform(60, 120), rng.uniform(-60, 60)
    colours, dot = (pick(rng, DULL), pick(rng, [*DULL, *BRIGHT])), pick(rng, BRIGHT)
    on = rng.integers(3)

    def pose(t: float) -> Pose:
        a = first + moves[0](t)
        b = a + second + moves[1](t)
        return {"link 1": a, "link 2": b, "link 2 to 1": b - a}

    def elbow(pose: Pose) -> np.ndarray:
        return pivot + lengths[0] * u(pose["link 1"])

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        joint = elbow(pose)
        end = joint + lengths[1] * u(pose["link 2"])
        canvas.polygon(pivot + np.array([(-40, 0), (40, 0), (50, 60), (-50, 60)]), (60, 60, 60))
        canvas.bar(pivot, joint, w, colours[0])
        canvas.disc(pivot, 0.6 * w, colours[0])
        canvas.bar(joint, end, 0.8 * w, colours[1])
        canvas.disc(joint, 0.55 * w, (40, 40, 40))
        if on == 0:
            canvas.disc(end, 0.45 * w, dot)
        if on == 1:
            canvas.disc(pivot + 0.7 * (joint - pivot), 0.35 * w, dot)

    return Mechanism(pivot, pose, paint, elbow)


def robot_link(stage: Stage) -> Mechanism:
    """Return a robot's last link, a textured plate with bolts and a gripper, on an arm that is still."""
    rng, h = stage.rng, stage.height
    foot, k = stage.near(0.3, 0.85), h / 480.0
    upper = rng.uniform(45, 80)
    pivot, length = foot + 0.42 * h * u(upper), h * rng.uniform(0.28, 0.38)
    turn, middle = motion(stage, rng.uniform(15, 50)), upper + rng.uniform(-100, -30)
    paint_, texture, printed = (
        pick(rng, [(30, 120, 230), (200, 200, 205), (60, 60, 65)]),
        photograph(rng),
        rng.random() < 0.7,
    )

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        canvas.polygon(foot + np.array([(-50, -20), (50, -20), (50, 90), (-50, 90)]) * k, (70, 70, 75))
        canvas.bar(foot, pivot, 50 * k, paint_, 38 * k)
        canvas.disc(foot, 34 * k, paint_)
        angle = pose["last link"]
        shape = turned(np.array([(-22 * k, -20 * k), (length, -13 * k), (length, 13 * k), (-22 * k, 20 * k)]), angle)
        if printed:
            canvas.plate(shape + pivot, pivot, angle, texture)
        else:
            canvas.polygon(shape + pivot, paint_)
        for side in (-1, 1):
            jaw = np.array([(0, 4), (34, 8), (34, 15), (0, 13)]) * (k, side * k) + (length, 0)
            canvas.polygon(turned(jaw, angle) + pivot, (50, 50, 50))
        for x, y in ((-10, -9), (-10, 9), (12, -9), (12, 9)):
            canvas.disc(turned([(x * k, y * k)], angle)[0] + pivot, 3 * k, (30, 30, 30))
        canvas.disc(pivot, 5 * k, (170, 170, 175))

    return Mechanism(
        pivot, one("last link", lambda t: middle + turn(t)), paint, lambda pose: pivot + length * u(pose["last link"])
    )


def wing(stage: Stage) -> Mechanism:
    """Return an irregular textured plate on a shaft."""
    rng, h = stage.rng, stage.height
    pivot, r = stage.near(0.5, 0.6), h * rng.uniform(0.3, 0.45)
    flap, middle = motion(stage, rng.uniform(10, 40)), rng.uniform(40, 140)
    phi = np.linspace(0, 2 * np.pi, 40)[:-1]
    wave = 1.0 + 0.18 * np.sin(2 * phi + rng.uniform(0, 6)) + 0.12 * np.sin(3 * phi + rng.uniform(0, 6))
    shape = np.column_stack([0.55 + 0.5 * wave * np.cos(phi), 0.33 * wave * np.sin(phi)]) * r
    texture, dot, shaft = photograph(rng), pick(rng, [None, pick(rng, BRIGHT)]), rng.random() < 0.5

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["plate"]
        canvas.plate(turned(shape, angle) + pivot, pivot, angle, texture)
        if dot is not None:
            canvas.disc(pivot + 0.9 * r * u(angle), 0.025 * h, dot)
        if shaft:
            canvas.disc(pivot, 0.03 * h, (235, 235, 235))

    return Mechanism(pivot, one("plate", lambda t: middle + flap(t)), paint, lambda pose: pivot + r * u(pose["plate"]))


KINDS = {"arm": arm, "robot": robot_link, "wing": wing}
