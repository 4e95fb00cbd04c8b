"""A small patch of the head as it looks between the pixels, learnt from all the frames that show it.

The patch is a cubic B-spline on a grid finer than the pixels. A turning head puts its edges at a different place
within the pixels in every frame, so that together the frames tell what no single one does: the profile of an edge as
this camera, lens and codec show it. Light that falls differently on a turned head is a gain that varies slowly over
the patch and smoothly with the angle::

    I(x) = T(s)·g(s, θ) + noise,    s = pivot + R(θ)·(x − pivot),    g = 1 + Σ_p θ^p·(g_p0 + g_p1·s_x + g_p2·s_y)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

from anglecam.data.typing import Floats, Integers
from anglecam.vision.registration.kernels import gain_equations, normal_equations, turn_equations

KNOT_SPACING_PX = 0.5
"""Between neighbouring knots: fine enough for an edge that only the pixels have blurred."""
GAIN_POWERS = 3
"""Of the angle in the gain."""
HIDDEN_MISFIT = 3.0
"""Times its usual mean square that a tile misfits in a frame where something hides it."""
_SMOOTH = 1e-2
"""Weight of the spline's second differences against one observation: it only decides where there is none."""
_RIDGE = 1e-6
"""Keeps the equations regular where nothing was seen at all."""


@dataclass(frozen=True)
class TileViews:
    """What is shown of tiles, pixel by pixel, in one view after another: a tile in one frame each."""

    offsets: Floats
    """(m, 2) places of the pixels from the tile's centre of rotation, px."""
    values: NDArray[np.float32]
    """(m, planes) what they show."""
    starts: Integers
    """(views + 1,) where each view's pixels begin."""

    def without(self, out: NDArray[np.bool_]) -> TileViews:
        """Return these with those views (views,) emptied."""
        if not out.any():
            return self
        length = np.diff(self.starts)
        kept = np.repeat(~out, length)
        starts = np.append(0, np.cumsum(np.where(out, 0, length)))
        return TileViews(self.offsets[kept], self.values[kept], starts)


@dataclass(frozen=True)
class TileAppearance:
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


def join_tiles(patches: Sequence[TileAppearance]) -> TileAppearance:
    """Put tiles of one size together."""
    return TileAppearance(
        np.concatenate([p.corners for p in patches]),
        patches[0].side,
        np.concatenate([p.coefficients for p in patches]),
        np.concatenate([p.gains for p in patches]),
    )


def learn_tile(
    corner: Floats, side: int, views: TileViews, turns: Floats, pivot: Floats, gains: Floats | None = None
) -> TileAppearance:
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
    n = round(side / KNOT_SPACING_PX) + 3
    start = np.zeros((GAIN_POWERS, 3)) if gains is None else gains
    band, right = normal_equations(views.offsets, views.values, views.starts, turns, pivot, corner, side, n, start)
    lower = _as_lower_band(band, n) + _SMOOTH * _roughness(n)
    lower[0] += _RIDGE
    factor = cholesky_banded(lower, lower=True, overwrite_ab=True)
    coefficients = cho_solve_banded((factor, True), right.T).T.reshape(-1, n, n)
    normal, gradient = gain_equations(
        views.offsets, views.values, views.starts, turns, pivot, corner, side, coefficients
    )
    found = np.linalg.lstsq(normal, gradient, rcond=1e-9)[0].reshape(1, GAIN_POWERS, 3)
    return TileAppearance(corner[None], side, coefficients[None], found)


@dataclass(frozen=True)
class TileFit:
    """What each view says about its turn: sums over its pixels."""

    normal: Floats
    """(views, 3, 3) of the derivatives by turn (rad) and by x and y of the head's place (px)."""
    gradient: Floats
    """(views, 3) of derivative times residual."""
    squares: Floats
    """(views,) of squared residuals."""
    count: Integers
    """(views,) pixels times colours."""
    light: Floats
    """(views, planes, 3) what gain and offset of brightness, and variance of blur along the path (px²), the view has
    beyond the look's."""

    def without(self, out: NDArray[np.bool_]) -> TileFit:
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


def equalise_brightness(views: TileViews, light: Floats) -> TileViews:
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


def compare_tiles(patches: TileAppearance, views: TileViews, turns: Floats, pivots: Floats) -> TileFit:
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
    return TileFit(
        *turn_equations(
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
    """Put the products of neighbours into LAPACK's lower band, column by column."""
    lower = np.zeros((3 * n + 4, n * n))
    for k in range(25):  # rows of seven neighbours, from the coefficient itself on
        down, across = (k + 3) // 7, (k + 3) % 7 - 3
        shift = down * n + across
        lower[shift, : n * n - shift] = near[: n * n - shift, k]
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
