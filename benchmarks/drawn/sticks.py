"""Sticks with a dot, and what happens to them: a post before them, another stick, a lamp that blinks, a texture."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.drawn.canvas import BRIGHT, DULL, MARGIN, Canvas, photograph, pick, turned
from benchmarks.drawn.canvas import direction as u
from benchmarks.drawn.mechanism import Mechanism, Pose, Stage, motion, one


def stick(stage: Stage) -> Mechanism:
    """Return a stick with a dot near its end."""
    return _stick(stage)


def behind_post(stage: Stage) -> Mechanism:
    """Return a stick that passes behind a post."""
    return _stick(stage, post=True)


def dots_beside_pivot(stage: Stage) -> Mechanism:
    """Return a stick with two equal dots, both near the pivot."""
    return _stick(stage, dots=(-0.07, 0.22))


def two_sticks(stage: Stage) -> Mechanism:
    """Return a stick with a dot, beside another that moves otherwise, or beside a dot at rest, of the same colour."""
    rng, w, h = stage.rng, stage.width, stage.height
    first = _stick(stage)
    place = first.pivot + (rng.choice([-1, 1]) * 0.33 * w, 0.0)
    place[1] = h * rng.uniform(0.3, 0.7)
    moves, swing, length = rng.random() < 0.5, motion(stage, rng.uniform(8, 20)), 0.2 * h
    dot, grey, width = pick(rng, BRIGHT), pick(rng, DULL), rng.uniform(6, 14)

    def pose(t: float) -> Pose:
        return first.pose(t) | ({"other stick": 90.0 + swing(t)} if moves else {})

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        end = place
        if moves:
            end = place + length * u(pose["other stick"])
            canvas.bar(place, end, width, grey)
        canvas.disc(end, 0.7 * width, dot)
        first.paint(canvas, pose, t)
        canvas.disc(first.grip(pose), 0.7 * width, dot)

    return Mechanism(first.pivot, pose, paint, first.grip)


def blinking(stage: Stage) -> Mechanism:
    """Return a stick whose dot is a lamp that blinks."""
    period, off = stage.rng.uniform(0.2, 0.6), stage.rng.uniform(0.1, 0.3)
    return _stick(stage, lit=lambda t: (t % period) > off * period)


def textured(stage: Stage) -> Mechanism:
    """Return a stick with a photograph on it."""
    return _stick(stage, on_it=True)


def _stick(
    stage: Stage,
    *,
    post: bool = False,
    dots: tuple[float, ...] = (),
    lit: Callable[[float], bool] = lambda t: True,
    on_it: bool = False,
) -> Mechanism:
    rng, h = stage.rng, stage.height
    length, pivot, width = h * rng.uniform(0.35, 0.45), stage.near(0.5, 0.5, 40.0), rng.uniform(10, 26)
    swing, middle = motion(stage, rng.uniform(15, 50)), rng.uniform(20, 160)
    body, colour, radius = pick(rng, DULL), pick(rng, BRIGHT), width * rng.uniform(0.35, 0.75)
    texture, hub = photograph(rng) if on_it else None, pick(rng, DULL) if rng.random() < 0.6 and not dots else None
    half, places = rng.uniform(10, 22), dots or (1.0 - width / length,)
    post_x = pivot[0] + 0.6 * length * np.cos(np.radians(middle))

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle, w = pose["stick"], width / 2.0
        shape = turned([(-0.12 * length, -w), (length, -w), (length, w), (-0.12 * length, w)], angle) + pivot
        if texture is None:
            canvas.polygon(shape, body)
        else:
            canvas.plate(shape, pivot, angle, texture)
        if lit(t):
            for share in places:
                canvas.disc(pivot + share * length * u(angle), radius, colour)
        if hub is not None:
            canvas.disc(pivot, 0.45 * width, hub)
        if post:
            top, bottom = -MARGIN, h + MARGIN
            corners = [(-half, top), (half, top), (half, bottom), (-half, bottom)]
            canvas.polygon(np.array(corners) + (post_x, 0), (70, 80, 95))

    def end(pose: Pose) -> np.ndarray:
        return pivot + (length - width) * u(pose["stick"])

    return Mechanism(pivot, one("stick", lambda t: middle + swing(t)), paint, end)


def ruler_on_servo(stage: Stage) -> Mechanism:
    """Return a ruler with its scale, taped to the horn of a servo that plays steps."""
    rng, k = stage.rng, stage.height / 480.0
    pivot, length = stage.near(0.5, 0.65), stage.height * rng.uniform(0.4, 0.52)
    play, middle = motion(stage, rng.uniform(15, 45), ("steps", "triangle", "sine")), rng.uniform(60, 120)
    ruler, ink = pick(
        rng, [((120, 200, 230), (30, 30, 30)), ((205, 210, 210), (60, 60, 60)), ((60, 130, 190), (20, 20, 20))]
    )
    width, start, step = rng.uniform(24, 34) * k, -0.06 * length, length / rng.integers(15, 30)
    servo, tape = pick(rng, [(120, 60, 30), (40, 40, 40)]), pick(rng, [(210, 215, 215), (70, 170, 190)])

    def paint(canvas: Canvas, pose: Pose, t: float) -> None:
        angle = pose["ruler"]
        canvas.polygon(pivot + np.array([(-70, -26), (26, -26), (26, 26), (-70, 26)]) * k, servo)
        canvas.polygon(pivot + np.array([(-86, -14), (42, -14), (42, 14), (-86, 14)]) * k, servo)
        w = width / 2.0
        canvas.polygon(turned([(start, -w), (length, -w), (length, w), (start, w)], angle) + pivot, ruler)
        for i in range(1, int(length / step)):
            deep = w - (0.5 if i % 5 == 0 else 0.3) * width
            canvas.bar(*(turned([(i * step, w), (i * step, deep)], angle) + pivot), 1.4 * k, ink)
        corners = turned([(0, -1.1 * w), (22 * k, -1.1 * w), (22 * k, 1.1 * w), (0, 1.1 * w)], angle)
        canvas.polygon(corners + pivot, tape)
        canvas.disc(pivot, 7 * k, (225, 225, 225))

    def end(pose: Pose) -> np.ndarray:
        return pivot + 0.9 * length * u(pose["ruler"])

    return Mechanism(pivot, one("ruler", lambda t: middle + play(t)), paint, end)


KINDS = {
    "stick": stick,
    "post": behind_post,
    "side": dots_beside_pivot,
    "two": two_sticks,
    "blink": blinking,
    "texstick": textured,
    "ruler": ruler_on_servo,
}
