"""Films in which nothing turns about a fixed pivot, or nothing is to be seen: none may get an angle."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import cv2
import numpy as np

from benchmarks.hostile.draw import (
    BLUE,
    DARK,
    GREEN,
    ORANGE,
    RED,
    SIZE,
    WHITE,
    Film,
    ball,
    box,
    moved,
    paint,
    plain,
    room,
    stick,
    texture,
)

N = 90
T = np.arange(N) / 30.0
WIDTH, HEIGHT = SIZE
MIDDLE = np.array([200.0, 150.0])

Painter = Callable[[np.ndarray, int], None]


def _over(background: np.ndarray, draw: Painter, n: int = N) -> Iterator[np.ndarray]:
    for i in range(n):
        picture = background.copy()
        draw(picture, i)
        yield picture


def _balls(path: np.ndarray, radius: float, colour: tuple[int, ...], background: np.ndarray) -> Iterator[np.ndarray]:
    return _over(background, lambda picture, i: ball(picture, path[i], radius, colour))


def _boxes(path: np.ndarray, half: tuple[float, float], colour: tuple[int, ...], seed: int) -> Iterator[np.ndarray]:
    return _over(room(seed=seed), lambda picture, i: box(picture, path[i], half, colour))


def _line(start: tuple[float, float], end: tuple[float, float], share: np.ndarray) -> np.ndarray:
    return np.array(start) + share[:, None] * np.subtract(end, start)


TO_AND_FRO = 0.5 - 0.5 * np.cos(2 * np.pi * T / 1.7)
ONCE = np.linspace(0.0, 1.0, N)
THERE_AND_REST = np.clip((T - 0.8) / 0.7, 0.0, 1.0)


def _constant(picture: np.ndarray) -> Iterator[np.ndarray]:
    return (picture.copy() for _ in range(N))


def _flicker() -> Iterator[np.ndarray]:
    scene = room(seed=3)
    ball(scene, (290, 190), 14, RED)
    return (scene * (1.0 + 0.12 * np.sin(2.3 * i)) for i in range(N))


def _black_flash() -> Iterator[np.ndarray]:
    scene, black = room(seed=4), np.zeros((HEIGHT, WIDTH, 3))
    return (scene.copy() if i % 9 < 3 else black.copy() for i in range(N))


def _walker(colour: tuple[int, ...], seed: int) -> Iterator[np.ndarray]:
    def draw(picture: np.ndarray, i: int) -> None:
        x, stride = 40 + 3.4 * i, 18 * np.sin(2 * np.pi * T[i] * 1.1)
        hip = np.array([x, 170 + abs(stride) * 0.2])
        for side in (-1, 1):
            stick(picture, hip, hip + [side * stride, 55], 6, DARK)
        box(picture, hip - [0, 32], (11 + 2 * np.sin(6 * T[i]), 32), colour)
        ball(picture, hip - [0, 76], 11, (205, 160, 130))

    return _over(room(seed=seed), draw)


def _falling() -> Iterator[np.ndarray]:
    path = np.column_stack([np.full(N, 180.0), 20 + 0.5 * 130.0 * np.minimum(T, 1.9) ** 2])
    return _balls(path, 12, RED, room(seed=7))


def _bouncing() -> Iterator[np.ndarray]:
    height = 150 * np.abs(np.cos(np.pi * T / 0.8)) * np.exp(-0.2 * T)
    return _balls(np.column_stack([60 + 80 * T, 260 - height]), 12, BLUE, room(seed=8))


def _thrown() -> Iterator[np.ndarray]:
    s = np.linspace(0, 1, N)
    return _balls(np.column_stack([30 + 340 * s, 250 - 4 * 190 * s * (1 - s)]), 11, RED, room(seed=9))


def _cut(second: np.ndarray, first: np.ndarray) -> Iterator[np.ndarray]:
    return (first.copy() if i < N // 2 else second.copy() for i in range(N))


def _cut_shifted() -> Iterator[np.ndarray]:
    wide = room((WIDTH + 80, HEIGHT + 80), seed=11)
    ball(wide, (230, 190), 12, RED)
    return _cut(moved(wide, (14, 6)), moved(wide))


def _zoom(most: float, seed: int) -> Iterator[np.ndarray]:
    wide = room((WIDTH + 80, HEIGHT + 80), seed=seed)
    ball(wide, (330, 120), 12, RED)
    return (moved(wide, zoom=1.0 + (most - 1.0) * TO_AND_FRO[i]) for i in range(N))


def _pan(wide: np.ndarray, far: float) -> Iterator[np.ndarray]:
    ball(wide, (300, 200), 12, RED)
    return (moved(wide, (far * TO_AND_FRO[i], 0.2 * far * TO_AND_FRO[i])) for i in range(N))


def _plain_wide() -> np.ndarray:
    return plain((WIDTH + 120, HEIGHT + 120))


def _growing() -> Iterator[np.ndarray]:
    return _over(room(seed=15), lambda picture, i: ball(picture, MIDDLE, 15 + 40 * TO_AND_FRO[i], RED))


def _conveyor(colour: tuple[int, ...], seed: int) -> Iterator[np.ndarray]:
    def draw(picture: np.ndarray, i: int) -> None:
        for k in range(-2, 7):
            ball(picture, (k * 80 + 3.7 * i % 80, 180), 13, colour)

    return _over(room(seed=seed), draw)


def _lamp() -> Iterator[np.ndarray]:
    def draw(picture: np.ndarray, i: int) -> None:
        ball(picture, (260, 110), 10, RED if i % 20 < 10 else (70, 20, 20))

    return _over(room(seed=17), draw)


def _traffic_light() -> Iterator[np.ndarray]:
    def draw(picture: np.ndarray, i: int) -> None:
        for k, colour in enumerate((RED, ORANGE, GREEN)):
            ball(picture, (220, 90 + 34 * k), 13, colour if (i // 15) % 3 == k else (50, 50, 50))

    return _over(room(seed=18), draw)


def _shadow() -> Iterator[np.ndarray]:
    x = np.arange(WIDTH)[None, :, None]
    scene = room(seed=19)
    return (scene * (1.0 - 0.5 / (1.0 + np.exp(-(x - 30 - 3.5 * i) / 6.0))) for i in range(N))


def _rain(size: float, speed: float, length: float, seed: int) -> Iterator[np.ndarray]:
    rng = np.random.default_rng(seed)
    drops = rng.uniform((0, 0), (WIDTH, HEIGHT + 40), (60, 2))

    def draw(picture: np.ndarray, i: int) -> None:
        part = np.zeros((HEIGHT, WIDTH), np.float32)
        for x, y in drops:
            at = (int(x), int((y + speed * i) % (HEIGHT + 40) - 20))
            cv2.line(part, at, (at[0], int(at[1] + length)), 1.0, max(1, int(size)), cv2.LINE_AA)
        paint(picture, 0.5 - 0.7 * part, WHITE)

    return _over(room(seed=seed), draw)


def _leaves() -> Iterator[np.ndarray]:
    rng = np.random.default_rng(22)
    leaf = texture(SIZE, 23, 3.0, 45.0) * (0.6, 1.1, 0.5)
    x, y = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    waves = [(rng.uniform(0.02, 0.06, 2), rng.uniform(0, 6.3), rng.uniform(4, 9)) for _ in range(6)]
    for i in range(N):
        dx, dy = np.zeros_like(x), np.zeros_like(y)
        for k, ((a, b), phase, rate) in enumerate(waves):
            wave = np.sin(a * x + b * y + phase + rate * T[i])
            dx, dy = (dx + 1.5 * wave, dy) if k % 2 else (dx, dy + 1.5 * wave)
        there = (x + dx).astype(np.float32), (y + dy).astype(np.float32)
        yield cv2.remap(leaf, *there, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def _text() -> Iterator[np.ndarray]:
    page = np.full((900, WIDTH, 3), 235, np.uint8)
    for row in range(30):
        words = f"line {row} of a page that scrolls upward slowly"
        cv2.putText(page, words, (12, 30 + 30 * row), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (30, 30, 30), 1, cv2.LINE_AA)
    return (page[4 * i : 4 * i + HEIGHT].astype(float) for i in range(N))


def _car() -> Iterator[np.ndarray]:
    def draw(picture: np.ndarray, i: int) -> None:
        x = -60 + 6.0 * i
        box(picture, (x, 190), (55, 18), RED)
        box(picture, (x - 5, 165), (30, 14), (120, 30, 35))
        for off in (-32, 32):
            ball(picture, (x + off, 208), 12, DARK)

    return _over(room(seed=26), draw)


def _shake(rms: float, seed: int, mark: bool) -> Iterator[np.ndarray]:
    rng = np.random.default_rng(seed)
    wide = room((WIDTH + 80, HEIGHT + 80), seed=seed)
    if mark:
        ball(wide, (300, 210), 12, RED)
    shifts = cv2.GaussianBlur(rng.standard_normal((N, 2)), (0, 0), sigmaX=0.01, sigmaY=1.5)
    shifts *= rms / shifts.std()
    return (moved(wide, shift) for shift in shifts)


def _fade() -> Iterator[np.ndarray]:
    scene = room(seed=29)
    ball(scene, (300, 130), 12, RED)
    return (scene * min(1.0, i / 30.0, (N - 1 - i) / 30.0) for i in range(N))


def _plate(path: np.ndarray, seed: int, background: np.ndarray) -> Iterator[np.ndarray]:
    """Translate a textured plate without turning it."""
    surface = texture((121, 121), seed, 3.0, 40.0)
    for x, y in path:
        picture = background.copy()
        layer = cv2.warpAffine(surface, np.float64([[1, 0, x - 60], [0, 1, y - 60]]), SIZE, flags=cv2.INTER_CUBIC)
        u, v = np.meshgrid(np.arange(WIDTH) - x, np.arange(HEIGHT) - y)
        paint(picture, np.maximum(np.abs(u), np.abs(v)) - 55.0, layer)
        yield picture


def _cart_pendulum(colour: tuple[int, ...], seed: int) -> Iterator[np.ndarray]:
    cart = 190 + 55 * np.sin(2 * np.pi * 0.5 * T)
    swing = np.radians(22) * np.sin(2 * np.pi * 1.15 * T + 0.7)

    def draw(picture: np.ndarray, i: int) -> None:
        joint = np.array([cart[i], 70.0])
        bob = joint + 130 * np.array([np.sin(swing[i]), np.cos(swing[i])])
        box(picture, joint - [0, 6], (26, 10), (90, 95, 110))
        stick(picture, joint, bob, 2, DARK)
        ball(picture, bob, 13, colour)

    return _over(room(seed=seed), draw)


def _breathing() -> Iterator[np.ndarray]:
    x, y = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    skin = texture(SIZE, 33, 5.0, 25.0) * (1.1, 0.9, 0.8)
    inside = np.exp(-(((x - 200) / 90) ** 2 + ((y - 150) / 60) ** 2))
    for i in range(N):
        swell = np.float32(0.06 * np.sin(2 * np.pi * 0.6 * T[i])) * inside
        there = (x - swell * (x - 200)).astype(np.float32), (y - swell * (y - 150)).astype(np.float32)
        yield cv2.remap(skin, *there, cv2.INTER_CUBIC)


def _random_walk(colour: tuple[int, ...], seed: int) -> Iterator[np.ndarray]:
    steps = np.random.default_rng(seed).normal(0, 4.0, (N, 2))
    return _balls(np.clip(MIDDLE + np.cumsum(steps, axis=0), 20, (380, 280)), 11, colour, room(seed=seed))


def _ellipse(colour: tuple[int, ...], ratio: float, seed: int) -> Iterator[np.ndarray]:
    turn = 2 * np.pi * T / 1.9
    path = MIDDLE + np.column_stack([110 * np.cos(turn), 110 * ratio * np.sin(turn)])
    return _balls(path, 11, colour, room(seed=seed))


def _lissajous(colour: tuple[int, ...]) -> Iterator[np.ndarray]:
    path = MIDDLE + np.column_stack([120 * np.sin(2 * np.pi * 0.7 * T), 80 * np.sin(2 * np.pi * 1.05 * T + 0.4)])
    return _balls(path, 11, colour, room(seed=37))


def _elastic(swing: np.ndarray) -> Iterator[np.ndarray]:
    length = 140 + 22 * np.sin(2 * np.pi * 1.7 * T + 1.0)

    def draw(picture: np.ndarray, i: int) -> None:
        bob = np.array([200, 40]) + length[i] * np.array([np.sin(swing[i]), np.cos(swing[i])])
        stick(picture, (200, 40), bob, 1.5, DARK)
        ball(picture, bob, 13, RED)

    return _over(room(seed=38), draw)


def _spiral() -> Iterator[np.ndarray]:
    radius, turn = 20 + 100 * T / T[-1], 2 * np.pi * T
    return _balls(MIDDLE + radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]), 11, RED, room(seed=39))


def _still_with_mark() -> np.ndarray:
    scene = room(seed=2)
    ball(scene, (120, 220), 9, DARK)
    ball(scene, (290, 140), 13, RED)
    return scene


def films() -> Iterator[Film]:
    """Yield the films, each drawn as it is read."""
    grey = np.full((HEIGHT, WIDTH, 3), 120.0)
    yield Film("noise", _constant(grey), noise=60.0)
    yield Film("grey", _constant(grey))
    yield Film("black", _constant(0.0 * grey), codec="h264")
    yield Film("black-flash", _black_flash())
    yield Film("still", _constant(room(seed=1)))
    yield Film("still-red-ball-and-round-marker", _constant(_still_with_mark()))
    yield Film("flicker", _flicker())
    yield Film("cart-red", _boxes(_line((90, 200), (310, 200), TO_AND_FRO), (22, 13), RED, 5))
    yield Film("cart-red-once", _boxes(_line((40, 220), (360, 200), ONCE), (22, 13), RED, 6), codec="h264")
    yield Film("cart-blue-diagonal", _boxes(_line((100, 220), (300, 90), TO_AND_FRO), (18, 12), BLUE, 7))
    yield Film("cart-red-short-stroke", _boxes(_line((190, 150), (215, 150), THERE_AND_REST), (16, 12), RED, 8))
    yield Film("cart-dark", _boxes(_line((80, 180), (330, 180), TO_AND_FRO), (24, 14), DARK, 9))
    yield Film("spring-red-vertical", _balls(_line((210, 90), (210, 220), TO_AND_FRO), 14, RED, room(seed=10)))
    yield Film("walker-red", _walker(RED, 11), codec="h264")
    yield Film("walker-green", _walker(GREEN, 12))
    yield Film("falling-red", _falling())
    yield Film("bouncing-blue", _bouncing())
    yield Film("thrown-red", _thrown())
    yield Film("cut", _cut(room(seed=41), _still_with_mark()))
    yield Film("cut-shifted", _cut_shifted())
    yield Film("zoom", _zoom(1.15, 13))
    yield Film("zoom-slight", _zoom(1.02, 14))
    yield Film("pan-textured", _pan(texture((WIDTH + 120, HEIGHT + 120), 15, 4.0, 25.0), 40.0))
    yield Film("pan-plain", _pan(_plain_wide(), 40.0))
    yield Film("growing-red", _growing())
    yield Film("conveyor-red", _conveyor(RED, 16))
    yield Film("conveyor-white", _conveyor(WHITE, 17))
    yield Film("lamp", _lamp())
    yield Film("traffic-light", _traffic_light())
    yield Film("shadow", _shadow())
    yield Film("rain", _rain(1, 14.0, 12, 20))
    yield Film("snow", _rain(4, 5.0, 1, 21))
    yield Film("leaves", _leaves())
    yield Film("scrolling-text", _text())
    yield Film("car-red", _car())
    yield Film("shake", _shake(3.0, 27, mark=False))
    yield Film("shake-red", _shake(3.0, 28, mark=True), codec="h264")
    yield Film("fade-red", _fade())
    yield Film("plate-translates", _plate(_line((120, 150), (280, 150), TO_AND_FRO), 30, plain()))
    yield Film("plate-translates-in-a-room", _plate(_line((130, 110), (270, 190), TO_AND_FRO), 31, room(seed=30)))
    yield Film("cart-pendulum-red", _cart_pendulum(RED, 31))
    yield Film("cart-pendulum-blue", _cart_pendulum(BLUE, 32))
    yield Film("breathing", _breathing())
    yield Film("random-walk-red", _random_walk(RED, 34))
    yield Film("random-walk-dark", _random_walk(DARK, 35))
    yield Film("ellipse-red", _ellipse(RED, 0.75, 36))
    yield Film("ellipse-blue", _ellipse(BLUE, 0.7, 37))
    yield Film("lissajous-red", _lissajous(RED))
    swing = np.radians(18) * np.sin(2 * np.pi * 0.8 * T)
    # its mark turns about no fixed point, but its thread does
    yield Film("elastic-pendulum-red", _elastic(swing), angle_deg=np.degrees(swing))
    yield Film("spiral-red", _spiral())
