"""A fitted curve on a grid over the range visited, with its uncertainty and how often each point was visited.

The uncertainty is that of a Bayesian smoother, V = s²·(JᵀJ + λP)⁻¹, in which the curve is random and its bending has
the variance that λ implies. Averaged over the curve, its 95 % band holds 95 % of the true curve, because V contains the
bias of smoothing (Wahba, J. R. Statist. Soc. B 45, 1983; Nychka, J. Am. Stat. Assoc. 83, 1988).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.loop.free_form.penalised import RIDGE
from anglecam.loop.free_form.search import curve_of
from anglecam.loop.free_form.visited import Visited

POINTS, POINTS_EACH = 41, 11
"""Points of a curve over one quantity, and along each axis of one over two."""


@dataclass(frozen=True)
class Band:
    """A curve at n points."""

    over: tuple[str, ...]
    """One or two of `anglecam.models.torque_curve.QUANTITIES`."""
    points: tuple[Floats, ...] = field(repr=False)
    """(n,) for each quantity, in its unit; angles are as they were measured."""
    acceleration: Floats = field(repr=False)
    """(n,) rad/s²."""
    sigma: Floats = field(repr=False)
    """(n,) standard uncertainty of ``acceleration``, rad/s²."""
    visited: Floats = field(repr=False)
    """(n,) share of the time in which the quantities were nearest to each point; points of a pair that were never
    visited are left out."""


def band_of(fit: Fit, visited: Visited) -> Band:
    """Return a fitted curve with its uncertainty.

    Parameters
    ----------
    fit : Fit
        Of a `CurvedPlant`.
    visited : Visited
        The motion over which the curve was made.

    Returns
    -------
    Band
        In SI.
    """
    curve = curve_of(fit)
    first = len(fit.parameters) - curve.count
    count = POINTS if len(curve.axes) == 1 else POINTS_EACH
    grids = [np.linspace(axis.low, axis.high, count) for axis in curve.axes]
    points = [mesh.ravel() for mesh in np.meshgrid(*grids, indexing="ij")]
    share = _shares([visited.all(name) for name in curve.over], grids)
    seen = np.ones(len(share), bool) if len(grids) == 1 else share > 0.0
    points = [x[seen] for x in points]
    columns, zero = curve.columns(points), _zero(fit, visited)
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", columns, covariance(fit)[first:, first:], columns))
    points = [x + zero if name == "angle" else x for name, x in zip(curve.over, points, strict=True)]
    return Band(curve.over, tuple(points), columns @ fit.parameters[first:], sigma, share[seen])


def _zero(fit: Fit, visited: Visited) -> float:
    """Return the mean fitted zero, rad: the angle that was measured is that of the plant plus the zero."""
    zeros = [own[-1] for own, r in zip(fit.nuisance, visited.records, strict=True) if not r.zero_known]
    return float(np.mean(zeros)) if zeros else 0.0


def covariance(fit: Fit) -> Floats:
    """Return the (p, p) covariance V of the parameters of a fitted `CurvedPlant`, SI."""
    jacobian, penalty = fit.slopes.projected, curve_of(fit).penalty
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    jacobian = jacobian / scale
    first = len(scale) - penalty.shape[1]
    rows = np.hstack([np.zeros((len(penalty), first)), penalty]) / scale
    gram = jacobian.T @ jacobian
    inverse = np.linalg.inv(gram + rows.T @ rows + RIDGE * np.eye(len(scale)))
    spent = float(np.trace(inverse @ gram)) + fit.slopes.rank - jacobian.shape[1]
    return fit.cost / max(1.0, len(fit.white) - spent) * inverse / np.outer(scale, scale)


def _shares(values: list[Floats], grids: list[Floats]) -> Floats:
    """Return the share of values that are nearest to each point of a grid."""
    known = np.all(np.isfinite(values), axis=0)
    place = [
        np.clip(np.rint((x[known] - grid[0]) / (grid[1] - grid[0])).astype(int), 0, len(grid) - 1)
        for x, grid in zip(values, grids, strict=True)
    ]
    flat = np.ravel_multi_index(tuple(place), tuple(len(grid) for grid in grids))
    found = np.bincount(flat, minlength=int(np.prod([len(grid) for grid in grids])))
    return np.asarray(found / max(1, known.sum()))
