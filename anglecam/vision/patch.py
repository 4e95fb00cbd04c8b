"""A small patch of the head as it looks between the pixels, learnt from all the frames that show it.

The patch is a cubic B-spline on a grid finer than the pixels. A turning head puts its edges at a different place
within the pixels in every frame, so that together the frames tell what no single one does: the profile of an edge as
this camera, lens and codec show it. Light that falls differently on a turned head is a gain that varies slowly over
the patch and smoothly with the angle::

    I(x) = T(s)·g(s, θ) + noise,    s = pivot + R(θ)·(x − pivot),    g = 1 + Σ_p θ^p·(g_p0 + g_p1·s_x + g_p2·s_y)

No compiled function here calls one of another file, so that a cached one is never out of date.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STEP_PX = 0.5
"""Between neighbouring knots: fine enough for an edge that only the pixels have blurred."""
POWERS = 3
"""Of the angle in the gain."""
_SMOOTH = 1e-2
"""Weight of the spline's second differences against one observation: it only decides where there is none."""


@dataclass(frozen=True)
class Tile:
    """A square of the head in the reference frame."""

    corner: Floats
    """(2,) its upper left corner, px."""
    side: int
    """px."""

    @property
    def knots(self) -> int:
        """Coefficients along a side."""
        return round(self.side / STEP_PX) + 3


@dataclass(frozen=True)
class Views:
    """What several frames show of one tile, pixel by pixel."""

    offsets: Floats
    """(m, 2) places of the pixels from the pivot, px."""
    values: NDArray[np.float32]
    """(m, planes) what they show."""
    starts: Ints
    """(frames + 1,) where each frame's pixels begin."""


@dataclass(frozen=True)
class Patch:
    """How a tile looks."""

    tile: Tile
    coefficients: Floats
    """(planes, knots, knots), y first."""
    gains: Floats
    """(POWERS, 3): constant, x and y, for every power of the angle in rad."""


def learn_patch(tile: Tile, views: Views, turns: Floats, pivot: Floats, start: Patch | None = None) -> Patch:
    """Fit a tile's look to what frames of known turn show of it.

    Parameters
    ----------
    tile : Tile
        Where on the head.
    views : Views
        The pixels.
    turns : ndarray
        (frames,) turn of the head from the reference frame, counter-clockwise as seen, rad.
    pivot : ndarray
        (2,) in the reference frame, px.
    start : Patch, optional
        To take the gains from; without it there are none yet.

    Returns
    -------
    Patch
        Coefficients for those gains, then gains for those coefficients.
    """
    n = tile.knots
    gains = np.zeros((POWERS, 3)) if start is None else start.gains
    band, right = _normal_equations(
        views.offsets, views.values, views.starts, turns, pivot, tile.corner, tile.side, n, gains
    )
    lower = _as_lower_band(band, n) + _SMOOTH * _roughness(n)
    factor = cholesky_banded(lower, lower=True, overwrite_ab=True)
    coefficients = cho_solve_banded((factor, True), right.T).T.reshape(-1, n, n)
    normal, gradient = _gain_equations(
        views.offsets, views.values, views.starts, turns, pivot, tile.corner, tile.side, coefficients
    )
    return Patch(tile, coefficients, np.linalg.lstsq(normal, gradient, rcond=1e-9)[0].reshape(POWERS, 3))


@dataclass(frozen=True)
class Fit:
    """What one tile says about one turn: sums over its pixels."""

    normal: Floats
    """(frames, 3, 3) of the derivatives by turn (rad) and by x and y of the head's place (px)."""
    gradient: Floats
    """(frames, 3) of derivative times residual."""
    squares: Floats
    """(frames,) of squared residuals."""
    count: Ints
    """(frames,) pixels times colours."""


def compare(patch: Patch, views: Views, turns: Floats, pivot: Floats) -> Fit:
    """Hold a tile's look against what frames show at assumed turns, for a step of Gauss and Newton.

    Each frame's own brightness of the tile (a gain and an offset a colour) is fitted and taken out.

    Parameters
    ----------
    patch : Patch
        The look.
    views : Views
        The pixels.
    turns : ndarray
        (frames,) rad.
    pivot : ndarray
        (2,) px.

    Returns
    -------
    Fit
        A row a frame.
    """
    tile = patch.tile
    return Fit(
        *_compare(
            views.offsets,
            views.values,
            views.starts,
            turns,
            pivot,
            tile.corner,
            tile.side,
            patch.coefficients,
            patch.gains,
        )
    )


def _as_lower_band(near: Floats, n: int) -> Floats:
    """Put the products of neighbours, 7 × 7 about each coefficient, into LAPACK's lower band, column by column."""
    lower = np.zeros((3 * n + 4, n * n))
    for down in range(4):
        for across in range(-3, 4):
            if (shift := down * n + across) >= 0:
                lower[shift, : n * n - shift] = near[: n * n - shift, (down + 3) * 7 + across + 3]
    return lower


@lru_cache
def _roughness(n: int) -> Floats:
    """Squared second differences of the coefficients, along both axes, as a lower band."""
    bend = np.diff(np.eye(n), 2, axis=0)
    once = bend.T @ bend
    whole = np.kron(np.eye(n), once) + np.kron(once, np.eye(n))
    lower = np.zeros((3 * n + 4, n * n))
    for shift in (0, 1, 2, n, 2 * n):
        lower[shift, : n * n - shift] = np.diagonal(whole, -shift)
    return lower


@njit(cache=True, inline="always")
def _weights(u, w):  # type: ignore[no-untyped-def]
    w[0] = (1 - u) ** 3 / 6
    w[1] = (3 * u**3 - 6 * u**2 + 4) / 6
    w[2] = (-3 * u**3 + 3 * u**2 + 3 * u + 1) / 6
    w[3] = u**3 / 6


@njit(cache=True, inline="always")
def _slopes(u, d):  # type: ignore[no-untyped-def]
    d[0] = -((1 - u) ** 2) / 2
    d[1] = (3 * u * u - 4 * u) / 2
    d[2] = (-3 * u * u + 2 * u + 1) / 2
    d[3] = u * u / 2


@njit(cache=True, inline="always")
def _gain(gains, turn, x, y):  # type: ignore[no-untyped-def]
    total, power = 1.0, 1.0
    for p in range(gains.shape[0]):
        power *= turn
        total += power * (gains[p, 0] + gains[p, 1] * x + gains[p, 2] * y)
    return total


@njit(cache=True)
def _normal_equations(offsets, values, starts, turns, pivot, corner, side, n, gains):  # type: ignore[no-untyped-def]
    band = np.zeros((n * n, 49))
    planes = values.shape[1]
    right = np.zeros((planes, n * n))
    wx, wy = np.zeros(4), np.zeros(4)
    scale = (n - 3) / side
    for k in range(len(turns)):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        for m in range(starts[k], starts[k + 1]):
            x = pivot[0] + c * offsets[m, 0] - s * offsets[m, 1] - corner[0]
            y = pivot[1] + s * offsets[m, 0] + c * offsets[m, 1] - corner[1]
            if x < 0 or y < 0 or x >= side or y >= side:
                continue
            g = _gain(gains, turns[k], 2 * x / side - 1, 2 * y / side - 1)
            ux, uy = x * scale, y * scale
            ix, iy = int(ux), int(uy)
            _weights(ux - ix, wx)
            _weights(uy - iy, wy)
            for j in range(4):
                for i in range(4):
                    w = g * wx[i] * wy[j]
                    p = (iy + j) * n + ix + i
                    for channel in range(planes):
                        right[channel, p] += w * values[m, channel]
                    for jj in range(4):
                        for ii in range(4):
                            band[p, (jj - j + 3) * 7 + ii - i + 3] += w * g * wx[ii] * wy[jj]
    return band, right


@njit(cache=True)
def _gain_equations(offsets, values, starts, turns, pivot, corner, side, coefficients):  # type: ignore[no-untyped-def]
    n = coefficients.shape[1]
    terms = 3 * 3
    normal, gradient, basis = np.zeros((terms, terms)), np.zeros(terms), np.zeros(terms)
    wx, wy = np.zeros(4), np.zeros(4)
    scale = (n - 3) / side
    for k in range(len(turns)):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        for m in range(starts[k], starts[k + 1]):
            x = pivot[0] + c * offsets[m, 0] - s * offsets[m, 1] - corner[0]
            y = pivot[1] + s * offsets[m, 0] + c * offsets[m, 1] - corner[1]
            if x < 0 or y < 0 or x >= side or y >= side:
                continue
            ux, uy = x * scale, y * scale
            ix, iy = int(ux), int(uy)
            _weights(ux - ix, wx)
            _weights(uy - iy, wy)
            power = 1.0
            for p in range(3):
                power *= turns[k]
                basis[3 * p] = power
                basis[3 * p + 1] = power * (2 * x / side - 1)
                basis[3 * p + 2] = power * (2 * y / side - 1)
            for channel in range(coefficients.shape[0]):
                look = 0.0
                for j in range(4):
                    for i in range(4):
                        look += wx[i] * wy[j] * coefficients[channel, iy + j, ix + i]
                rest = values[m, channel] - look
                for a in range(terms):
                    gradient[a] += basis[a] * look * rest
                    for b in range(terms):
                        normal[a, b] += basis[a] * basis[b] * look * look
    return normal, gradient


@njit(cache=True)
def _compare(offsets, values, starts, turns, pivot, corner, side, coefficients, gains):  # type: ignore[no-untyped-def]
    n = coefficients.shape[1]
    frames = len(turns)
    normals, gradients = np.zeros((frames, 3, 3)), np.zeros((frames, 3))
    squares, counts = np.zeros(frames), np.zeros(frames, dtype=np.int64)
    wx, wy, dx, dy = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4)
    scale = (n - 3) / side
    terms = 4 + coefficients.shape[0]
    slope = np.zeros(terms)
    for k in range(frames):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        whole, pull = np.zeros((terms, terms)), np.zeros(terms)
        for m in range(starts[k], starts[k + 1]):
            at_x = pivot[0] + c * offsets[m, 0] - s * offsets[m, 1]
            at_y = pivot[1] + s * offsets[m, 0] + c * offsets[m, 1]
            x, y = at_x - corner[0], at_y - corner[1]
            # half a pixel within, where the spline has been seen from all sides
            if x < 0.5 or y < 0.5 or x >= side - 0.5 or y >= side - 0.5:
                continue
            g = _gain(gains, turns[k], 2 * x / side - 1, 2 * y / side - 1)
            ux, uy = x * scale, y * scale
            ix, iy = int(ux), int(uy)
            _weights(ux - ix, wx)
            _weights(uy - iy, wy)
            _slopes(ux - ix, dx)
            _slopes(uy - iy, dy)
            for channel in range(coefficients.shape[0]):
                look, along_x, along_y = 0.0, 0.0, 0.0
                for j in range(4):
                    for i in range(4):
                        q = coefficients[channel, iy + j, ix + i]
                        look += wx[i] * wy[j] * q
                        along_x += dx[i] * wy[j] * q
                        along_y += wx[i] * dy[j] * q
                along_x *= g * scale
                along_y *= g * scale
                slope[0] = along_y * (at_x - pivot[0]) - along_x * (at_y - pivot[1])
                slope[1] = along_x
                slope[2] = along_y
                slope[3] = g * look
                slope[4:] = 0.0
                slope[4 + channel] = 1.0
                rest = values[m, channel] - g * look
                squares[k] += rest * rest
                counts[k] += 1
                for a in range(terms):
                    pull[a] += slope[a] * rest
                    for b in range(terms):
                        whole[a, b] += slope[a] * slope[b]
        if counts[k] < 30:
            counts[k] = 0
            squares[k] = 0.0
            continue
        # the frame's brightness is fitted along and eliminated
        light = whole[3:, 3:] + 1e-9 * np.eye(terms - 3)
        across = np.linalg.solve(light, whole[3:, :3])
        normals[k] = whole[:3, :3] - whole[:3, 3:] @ across
        gradients[k] = pull[:3] - across.T @ pull[3:]
        squares[k] -= pull[3:] @ np.linalg.solve(light, pull[3:])
    return normals, gradients, squares, counts
