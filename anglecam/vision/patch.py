"""A small patch of the head as it looks between the pixels, learnt from all the frames that show it.

The patch is a cubic B-spline on a grid finer than the pixels. A turning head puts its edges at a different place
within the pixels in every frame, so that together the frames tell what no single one does: the profile of an edge as
this camera, lens and codec show it. Light that falls differently on a turned head is a gain that varies slowly over
the patch and smoothly with the angle::

    I(x) = T(s)·g(s, θ) + noise,    s = pivot + R(θ)·(x − pivot),    g = 1 + Σ_p θ^p·(g_p0 + g_p1·s_x + g_p2·s_y)

No compiled function here calls one of another file, so that a cached one is never out of date.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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
_RIDGE = 1e-6
"""Keeps the equations regular where nothing was seen at all."""


@dataclass(frozen=True)
class Views:
    """What is shown of tiles, pixel by pixel, in one view after another: a tile in one frame each."""

    offsets: Floats
    """(m, 2) places of the pixels from the tile's centre of rotation, px."""
    values: NDArray[np.float32]
    """(m, planes) what they show."""
    starts: Ints
    """(views + 1,) where each view's pixels begin."""

    def without(self, out: NDArray[np.bool_]) -> Views:
        """Return these with those views (views,) emptied."""
        if not out.any():
            return self
        length = np.diff(self.starts)
        kept = np.repeat(~out, length)
        starts = np.append(0, np.cumsum(np.where(out, 0, length)))
        return Views(self.offsets[kept], self.values[kept], starts)


@dataclass(frozen=True)
class Patches:
    """How tiles of one size look."""

    corners: Floats
    """(tiles, 2) upper left corners in the reference frame, px."""
    side: int
    """px."""
    coefficients: Floats
    """(tiles, planes, knots, knots), y first."""
    gains: Floats
    """(tiles, POWERS, 3): constant, x and y, for every power of the angle in rad."""

    def __len__(self) -> int:
        return len(self.corners)

    def __getitem__(self, part: slice) -> Patches:
        return Patches(self.corners[part], self.side, self.coefficients[part], self.gains[part])


def learn_patch(
    corner: Floats, side: int, views: Views, turns: Floats, pivot: Floats, gains: Floats | None = None
) -> Patches:
    """Fit one tile's look to what frames of known turn show of it.

    Parameters
    ----------
    corner : ndarray
        (2,) of the tile, px.
    side : int
        Of the tile, px.
    views : Views
        The tile in a number of frames.
    turns : ndarray
        (views,) turn of the head from the reference frame, counter-clockwise as seen, rad.
    pivot : ndarray
        (2,) the tile's centre of rotation in the reference frame, px.
    gains : ndarray, optional
        (POWERS, 3) to start from; without it there are none yet.

    Returns
    -------
    Patches
        A single one: coefficients for those gains, then gains for those coefficients.
    """
    n = round(side / STEP_PX) + 3
    start = np.zeros((POWERS, 3)) if gains is None else gains
    band, right = _normal_equations(views.offsets, views.values, views.starts, turns, pivot, corner, side, n, start)
    lower = _as_lower_band(band, n) + _SMOOTH * _roughness(n)
    lower[0] += _RIDGE
    factor = cholesky_banded(lower, lower=True, overwrite_ab=True)
    coefficients = cho_solve_banded((factor, True), right.T).T.reshape(-1, n, n)
    normal, gradient = _gain_equations(
        views.offsets, views.values, views.starts, turns, pivot, corner, side, coefficients
    )
    found = np.linalg.lstsq(normal, gradient, rcond=1e-9)[0].reshape(1, POWERS, 3)
    return Patches(corner[None], side, coefficients[None], found)


@dataclass(frozen=True)
class Fit:
    """What each view says about its turn: sums over its pixels."""

    normal: Floats
    """(views, 3, 3) of the derivatives by turn (rad) and by x and y of the head's place (px)."""
    gradient: Floats
    """(views, 3) of derivative times residual."""
    squares: Floats
    """(views,) of squared residuals."""
    count: Ints
    """(views,) pixels times colours."""
    light: Floats
    """(views, planes, 3) what gain and offset of brightness, and variance of blur along the path (px²), the view has
    beyond the look's."""

    def without(self, out: NDArray[np.bool_]) -> Fit:
        """Return this with those views taken as if they had no pixels."""
        kept = ~out
        return replace(
            self,
            normal=self.normal * kept[..., None, None],
            gradient=self.gradient * kept[..., None],
            squares=self.squares * kept,
            count=self.count * kept,
        )

    def weighted(self, variance: Floats) -> tuple[Floats, Floats]:
        """Return normal and gradient over the variances, along the first axis, of what is left over."""
        whole = (slice(None), *(None,) * (self.gradient.ndim - 1))
        return self.normal / variance[(*whole, None)], self.gradient / variance[whole]


def levelled(views: Views, light: Floats) -> Views:
    """Take each view's own brightness out of it, less what all views have in common.

    Parameters
    ----------
    views : Views
        Of one tile.
    light : ndarray
        (views, planes, 3) from a `Fit` to the tile's look; blur stays where it is.

    Returns
    -------
    Views
        As if all had been lit alike.
    """
    own = light - light.mean(axis=0)
    each = np.repeat(own, np.diff(views.starts), axis=0)
    return replace(views, values=((views.values - each[..., 1]) / (1.0 + each[..., 0])).astype(np.float32))


def compare(patches: Patches, views: Views, turns: Floats, pivots: Floats) -> Fit:
    """Hold looks against what frames show at assumed turns, for a step of Gauss and Newton.

    Each view's own brightness (a gain and an offset a colour) is fitted and taken out, and so is what motion during
    the exposure adds to the second derivative along the path: a sharp look against a blurred view is not merely
    noisy, it is biased.

    Parameters
    ----------
    patches : Patches
        One, seen in every view; or as many as there are views, each seen in its own.
    views : Views
        The pixels.
    turns : ndarray
        (views,) rad.
    pivots : ndarray
        (patches, 2) centres of rotation, px.

    Returns
    -------
    Fit
        A row a view.
    """
    return Fit(
        *_compare(
            views.offsets,
            views.values,
            views.starts,
            turns,
            pivots,
            patches.corners,
            patches.side,
            patches.coefficients,
            patches.gains,
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
def _bends(u, b):  # type: ignore[no-untyped-def]
    b[0] = 1 - u
    b[1] = 3 * u - 2
    b[2] = 1 - 3 * u
    b[3] = u


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
def _compare(offsets, values, starts, turns, pivots, corners, side, looks, all_gains):  # type: ignore[no-untyped-def]
    views, planes, n = len(turns), looks.shape[1], looks.shape[2]
    normals, gradients = np.zeros((views, 3, 3)), np.zeros((views, 3))
    squares, counts = np.zeros(views), np.zeros(views, dtype=np.int64)
    lights = np.zeros((views, planes, 3))
    wx, wy, dx, dy, bx, by = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4)
    slope, bright = np.zeros(3), np.ones(3)
    scale = (n - 3) / side
    for k in range(views):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        p = k if len(looks) > 1 else 0
        pivot, corner, coefficients, gains = pivots[p], corners[p], looks[p], all_gains[p]
        whole, pull = np.zeros((3, 3)), np.zeros(3)
        light, light_pull, across = np.zeros((planes, 3, 3)), np.zeros((planes, 3)), np.zeros((planes, 3, 3))
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
            _bends(ux - ix, bx)
            _bends(uy - iy, by)
            away_x, away_y = at_x - pivot[0], at_y - pivot[1]
            from_pivot = max(away_x * away_x + away_y * away_y, 1.0)
            for channel in range(planes):
                look, along_x, along_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                for j in range(4):
                    for i in range(4):
                        q = coefficients[channel, iy + j, ix + i]
                        look += wx[i] * wy[j] * q
                        along_x += dx[i] * wy[j] * q
                        along_y += wx[i] * dy[j] * q
                        xx += bx[i] * wy[j] * q
                        xy += dx[i] * dy[j] * q
                        yy += wx[i] * by[j] * q
                along_x *= g * scale
                along_y *= g * scale
                slope[0] = along_y * away_x - along_x * away_y
                slope[1] = along_x
                slope[2] = along_y
                bright[0] = g * look
                bent = away_y * away_y * xx - 2.0 * away_x * away_y * xy + away_x * away_x * yy
                bright[2] = g * scale * scale * bent / from_pivot
                rest = values[m, channel] - g * look
                squares[k] += rest * rest
                counts[k] += 1
                for a in range(3):
                    pull[a] += slope[a] * rest
                    for b in range(a, 3):
                        whole[a, b] += slope[a] * slope[b]
                for a in range(3):
                    light_pull[channel, a] += bright[a] * rest
                    for b in range(3):
                        light[channel, a, b] += bright[a] * bright[b]
                        across[channel, a, b] += bright[a] * slope[b]
        if counts[k] < 30:
            counts[k] = 0
            squares[k] = 0.0
            continue
        for a in range(3):
            for b in range(a):
                whole[a, b] = whole[b, a]
        # the view's brightness and blur are fitted along and eliminated
        for channel in range(planes):
            known = light[channel] + 1e-9 * np.eye(3)
            taken = np.linalg.solve(known, across[channel])
            told = np.linalg.solve(known, light_pull[channel])
            whole -= across[channel].T @ taken
            pull -= taken.T @ light_pull[channel]
            squares[k] -= light_pull[channel] @ told
            lights[k, channel] = told
        normals[k], gradients[k] = whole, pull
    return normals, gradients, squares, counts, lights
