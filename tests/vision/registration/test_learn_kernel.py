"""The compiled sums for learning a tile agree with sums over a matrix of weights, pixel by pixel."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from anglecam.data.typing import Floats
from anglecam.vision.registration.kernels import place_on_tile, sort_by_cell
from anglecam.vision.registration.learn_kernel import gain_equations, spline_equations

SIDE, N = 8, 19
STARTS = np.array([0, 700, 700, 1500, 2200])
TURNS = np.array([-0.2, 0.0, 0.1, 0.35])
PIVOT, CORNER = np.array([30.0, 40.0]), np.array([36.0, 41.0])
LEAN, PARALLAX = np.array([0.3, -0.2]), np.array([0.05, 0.1])


def _weights(place: Floats) -> Floats:
    """Return (m, N) the splines at places (m,) along one axis, px."""
    knots = np.arange(-3, N + 1) * SIDE / (N - 3)
    return BSpline.design_matrix(place, knots, 3).toarray()


def test_equations_are_the_sums_over_pixels() -> None:
    rng = np.random.default_rng(5)
    view = np.repeat(np.arange(4), np.diff(STARTS))
    gains = rng.normal(0.0, 0.2, (3, 3))
    c, s = np.cos(TURNS[view]), np.sin(TURNS[view])
    wanted = rng.uniform(-0.5, SIDE + 0.5, (len(view), 2))  # from the corner, before the lean displaces it
    away = wanted + CORNER - PIVOT
    offsets = np.stack([c * away[:, 0] + s * away[:, 1], -s * away[:, 0] + c * away[:, 1]], axis=1)
    across = np.stack([(1 - c) * PARALLAX[0] + s * PARALLAX[1], (1 - c) * PARALLAX[1] - s * PARALLAX[0]], axis=1)
    rise = (wanted - SIDE / 2) @ LEAN / (1.0 - across @ LEAN)
    x, y = (wanted + across * rise[:, None]).T
    values = rng.uniform(0.0, 255.0, (len(view), 2)).astype(np.float32)

    placed = place_on_tile(offsets, STARTS, TURNS, PIVOT, CORNER, SIDE, gains, PARALLAX, LEAN)
    order, begins = sort_by_cell(placed, SIDE, N - 3)
    band, right = spline_equations(values, placed, order, begins, SIDE, N)
    coefficients = rng.normal(100.0, 30.0, (2, N, N))
    normal, gradient = gain_equations(values, placed, order, begins, STARTS, TURNS, SIDE, coefficients)

    on = (x >= 0) & (y >= 0) & (x < SIDE) & (y < SIDE)
    assert len(order) == on.sum() > 1000
    x, y, view, values = x[on], y[on], view[on], values[on].astype(float)
    linear = np.stack([np.ones(len(x)), 2 * x / SIDE - 1, 2 * y / SIDE - 1], axis=1)
    basis = np.concatenate([TURNS[view, None] ** power * linear for power in (1, 2, 3)], axis=1)
    of_pixel = (_weights(y)[:, :, None] * _weights(x)[:, None, :]).reshape(len(x), -1)
    weighted = of_pixel * (1.0 + basis @ gains.ravel())[:, None]
    whole = weighted.T @ weighted
    for distance in range(3 * N + 4):
        np.testing.assert_allclose(band[: N * N - distance, distance], np.diagonal(whole, distance), atol=1e-11)
    np.testing.assert_allclose(right, (weighted.T @ values).T, rtol=1e-10, atol=1e-8)
    levels = of_pixel @ coefficients.reshape(2, -1).T
    np.testing.assert_allclose(normal, basis.T @ (basis * (levels**2).sum(axis=1)[:, None]), rtol=1e-10)
    np.testing.assert_allclose(gradient, basis.T @ (levels * (values - levels)).sum(axis=1), rtol=1e-9)
