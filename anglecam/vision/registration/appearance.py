"""The appearance of a small tile of the body at sub-pixel resolution, learnt from all frames that show it.

The tile is a cubic B-spline on a grid finer than the pixels. The body rotates, so its edges lie at a different position
within the pixels in every frame. Together the frames determine what no single frame does: the profile of an edge as
this camera, lens and codec show it. Light that falls differently on a rotated body is a gain that varies slowly over
the tile and smoothly with the angle::

    I(x) = T(s)·g(s, θ) + noise,    s = pivot + R(θ)·(x − pivot),    g = 1 + Σ_p θ^p·(g_p0 + g_p1·s_x + g_p2·s_y)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from anglecam.data.typing import Floats, Integers
from anglecam.vision.registration.kernels import place_on_tile, place_on_tiles, relight, sort_by_cell
from anglecam.vision.registration.learn_kernel import gain_equations, spline_equations
from anglecam.vision.registration.turn_kernel import turn_equations

KNOT_SPACING_PX = 0.5
"""Distance between neighbouring knots, px: fine enough for an edge that only the pixels have blurred."""
GAIN_POWERS = 3
"""Powers of the angle in the gain."""
HIDDEN_MISFIT = 3.0
"""Mean square misfit of a tile in one frame, relative to its usual one, beyond which something hides the tile."""
_SMOOTHNESS = 1e-2
"""Weight of the spline's second differences relative to one observation. It has an effect only where there are no
observations."""
_RIDGE = 1e-6
"""Keeps the equations regular where nothing was observed at all."""


@dataclass(frozen=True)
class TileViews:
    """The pixels of tiles, view after view; a view is one tile in one frame."""

    offsets: Floats
    """(m, 2) places of the pixels relative to the tile's centre of rotation, px."""
    values: NDArray[np.float32]
    """(m, planes) their grey levels."""
    starts: Integers
    """(views + 1,) index at which each view's pixels begin."""

    def without(self, out: NDArray[np.bool_]) -> TileViews:
        """Return a copy in which the views marked in ``out`` (views,) have no pixels."""
        if not out.any():
            return self
        length = np.diff(self.starts)
        kept = np.repeat(~out, length)
        starts = np.append(0, np.cumsum(np.where(out, 0, length)))
        return TileViews(self.offsets[kept], self.values[kept], starts)


@dataclass(frozen=True)
class TileAppearance:
    """The appearance of tiles of one size."""

    corners: Floats
    """(tiles, 2) upper left corners in the reference frame, px."""
    side: int
    """px."""
    coefficients: Floats
    """(tiles, planes, knots, knots) of the splines, y first."""
    gains: Floats
    """(tiles, GAIN_POWERS, 3): constant, x and y, for every power of the angle in rad."""
    leans: Floats
    """(tiles, 2) gradient of the height over the tile."""
    parallax: Floats
    """(2,) displacement of the centre of rotation for each px of height."""

    def __len__(self) -> int:
        return len(self.corners)


def join_tiles(tiles: Sequence[TileAppearance]) -> TileAppearance:
    """Concatenate tiles of one size."""
    return TileAppearance(
        np.concatenate([t.corners for t in tiles]),
        tiles[0].side,
        np.concatenate([t.coefficients for t in tiles]),
        np.concatenate([t.gains for t in tiles]),
        np.concatenate([t.leans for t in tiles]),
        tiles[0].parallax,
    )


def learn_tile(
    corner: Floats,
    side: int,
    views: TileViews,
    turns: Floats,
    pivot: Floats,
    parallax: Floats,
    lean: Floats,
    gains: Floats | None = None,
) -> TileAppearance:
    """Fit one tile's appearance to its views in frames of known angle.

    Parameters
    ----------
    corner : ndarray
        (2,) upper left corner of the tile, px.
    side : int
        Side of the tile, px.
    views : TileViews
        The tile in a number of frames.
    turns : ndarray
        (views,) angle of the body from the reference frame, counter-clockwise as seen, rad.
    pivot : ndarray
        (2,) the tile's centre of rotation in the reference frame, px.
    parallax : ndarray
        (2,) displacement of the centre of rotation for each px of height.
    lean : ndarray
        (2,) gradient of the height over the tile.
    gains : ndarray, optional
        (GAIN_POWERS, 3) initial gains; zero by default.

    Returns
    -------
    TileAppearance
        A single tile: coefficients for the initial gains, then gains for those coefficients.
    """
    n = round(side / KNOT_SPACING_PX) + 3
    start = np.zeros((GAIN_POWERS, 3)) if gains is None else gains
    placed = place_on_tile(views.offsets, views.starts, turns, pivot, corner, side, start, parallax, lean)
    order, begins = sort_by_cell(placed, side, n - 3)
    band, right = spline_equations(views.values, placed, order, begins, side, n)
    band += _regularisation(n)
    options = {"overwrite_ab": True, "overwrite_b": True, "lower": True, "check_finite": False}
    coefficients = np.ascontiguousarray(solveh_banded(band.T, right.T, **options).T).reshape(-1, n, n)
    normal, gradient = gain_equations(views.values, placed, order, begins, views.starts, turns, side, coefficients)
    fitted = np.linalg.lstsq(normal, gradient, rcond=1e-9)[0].reshape(1, GAIN_POWERS, 3)
    return TileAppearance(corner[None], side, coefficients[None], fitted, lean[None], parallax)


@dataclass(frozen=True)
class TileFit:
    """The normal equations of each view for its angle: sums over its pixels."""

    normal: Floats
    """(views, 5, 5) products of the derivatives by angle (rad), by x and y of the body's place (px), and by the tile's
    lean along x and y."""
    gradient: Floats
    """(views, 5) products of derivative and residual."""
    squares: Floats
    """(views,) sum of squared residuals."""
    count: Integers
    """(views,) number of pixels times colour planes."""
    light: Floats
    """(views, planes, 3) gain and offset of brightness, and variance of blur along the path (px²), of the view relative
    to the tile's appearance."""

    @property
    def without_information(self) -> NDArray[np.bool_]:
        """Views that show nothing of the angle.

        In a view of few pixels the light, which is fitted with the angle, may explain all. What is left is then zero,
        or less by rounding.
        """
        return self.normal[..., 0, 0] <= 0.0

    def without(self, out: NDArray[np.bool_]) -> TileFit:
        """Return a copy in which the views marked in ``out`` count as if they had no pixels."""
        kept = ~out
        return replace(
            self,
            normal=self.normal * kept[..., None, None],
            gradient=self.gradient * kept[..., None],
            squares=self.squares * kept,
            count=self.count * kept,
        )

    def rigid(self) -> TileFit:
        """Return a copy for angle, x and y alone."""
        return replace(self, normal=self.normal[..., :3, :3], gradient=self.gradient[..., :3])

    def weighted(self, variance: Floats) -> tuple[Floats, Floats]:
        """Return normal matrix and gradient divided by the residuals' variances, given along the first axis."""
        whole = (slice(None), *(None,) * (self.gradient.ndim - 1))
        return self.normal / variance[(*whole, None)], self.gradient / variance[whole]


def equalise_brightness(views: TileViews, light: Floats) -> TileViews:
    """Remove from each view the gain and offset of brightness in which it differs from the mean of all views.

    Parameters
    ----------
    views : TileViews
        Of one tile.
    light : ndarray
        (views, planes, 3) from a `TileFit` of the tile's appearance; its blur is not used.

    Returns
    -------
    TileViews
        With values as if all had been lit alike.
    """
    difference = light - light.mean(axis=0)
    return replace(views, values=relight(views.values, views.starts, difference[..., 0], difference[..., 1]))


def compare_tiles(tiles: TileAppearance, views: TileViews, turns: Floats, pivots: Floats) -> TileFit:
    """Compare tiles with their views at assumed angles, for a Gauss-Newton step.

    Each view's brightness, a gain and an offset for each colour, is fitted and eliminated. So is the second derivative
    along the path that motion adds during the exposure: comparing a sharp appearance with a blurred view would cause
    a bias, not only noise.

    Parameters
    ----------
    tiles : TileAppearance
        One tile, seen in every view, or one tile for each view.
    views : TileViews
        The pixels.
    turns : ndarray
        (views,) rad.
    pivots : ndarray
        (tiles, 2) centres of rotation, px.

    Returns
    -------
    TileFit
        A row for each view.
    """
    places, away, gains, rises = place_on_tiles(
        views.offsets,
        views.starts,
        turns,
        np.array(pivots, order="C"),  # one pivot may stand for all
        tiles.corners,
        tiles.side,
        tiles.gains,
        tiles.parallax,
        tiles.leans,
    )
    return TileFit(
        *turn_equations(views.values, views.starts, places, away, gains, rises, tiles.side, tiles.coefficients)
    )


@lru_cache
def _regularisation(n: int) -> Floats:
    """Return the quadratic form of the coefficients' second differences along both axes, and a small ridge.

    It is a band (n², 3·n + 4) as from `anglecam.vision.registration.learn_kernel.spline_equations`.
    """
    second = np.diff(np.eye(n), 2, axis=0)
    once = second.T @ second
    whole = np.kron(np.eye(n), once) + np.kron(once, np.eye(n))
    band = np.zeros((n * n, 3 * n + 4))
    for shift in (0, 1, 2, n, 2 * n):
        band[: n * n - shift, shift] = _SMOOTHNESS * np.diagonal(whole, -shift)
    band[:, 0] += _RIDGE
    return band
