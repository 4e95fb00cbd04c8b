"""The pivot: a round marker found by its symmetry, the centre of rotation of the mouth's path, or both together.

Round marks, disc or rings, bright or dark, have edges whose gradients all point to or from one centre. Edge pixels
vote for the centres they point at (Loy & Zelinsky 2003); then the centre is the point nearest to all gradient lines
by weighted least squares (Parthasarathy 2012), which needs neither the marker's size nor its colour.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image

_RADII_PX = np.arange(3, 25)
_LEAST_COVERAGE = 0.6
"""Share of a circle's circumference that must point at its centre."""
_LINE_PX = 1.5
"""A gradient line that passes the centre farther off than this belongs to something else."""
_EDGE_SHARE = 0.4
"""Of the steepest gradient; fainter ones are no edge of the marker."""
_FLOOR_PX = 0.03
"""Standard uncertainty of a marker's centre that no number of edge pixels improves: shading, chroma, codec."""
_SECTORS = 12
"""Gradients within a sector of the circumference share their noise and the slope of the ground behind them."""


@dataclass(frozen=True)
class RoundMarker:
    """A round mark."""

    centre_px: Floats
    """(2,) px."""
    covariance_px2: Floats
    """(2, 2) px²."""
    radius_px: float
    """Of its most complete edge, px."""


def find_marker(image: Image, about_px: Floats | None, covariance_px2: Floats | None) -> RoundMarker | None:
    """Find the round mark nearest to where it is expected.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) blue, green, red; the median of several frames shows what stands still.
    about_px : ndarray, optional
        (2,) where to look, px; without it the whole image is searched.
    covariance_px2 : ndarray, optional
        (2, 2) how sure that is, px²; marks beyond three standard uncertainties are not considered.

    Returns
    -------
    Marker or None
        ``None`` where no circle is complete enough.
    """
    height, width = image.shape[:2]
    x0, y0, x1, y1 = 0, 0, width, height
    if about_px is not None and covariance_px2 is not None:
        half = 3.0 * np.sqrt(np.diag(covariance_px2)) + _RADII_PX[-1] + 4
        x0, y0 = (max(int(v), 0) for v in about_px - half)
        x1, y1 = (min(int(v), most) for v, most in zip(about_px + half, (width, height), strict=True))
        if x1 - x0 < 12 or y1 - y0 < 12:
            return None
    part = image[y0:y1, x0:x1]
    gx, gy = _gradients(part)
    prior = np.ones(gx.shape)
    if about_px is not None and covariance_px2 is not None:
        yy, xx = np.mgrid[y0:y1, x0:x1]
        off = np.stack([xx - about_px[0], yy - about_px[1]], axis=-1)
        away = np.einsum("...i,ij,...j->...", off, np.linalg.inv(covariance_px2), off)
        prior = np.where(away <= 9.0, np.exp(-away / 8.0), 0.0)
    best, radius, place = 0.0, 0.0, (0, 0)
    for r, coverage in _coverages(part, gx, gy):
        # A larger circle is a longer chance to fail, so of two equally complete ones it is the better found.
        worth = np.where(coverage < _LEAST_COVERAGE, 0.0, (coverage - 0.5) * np.sqrt(r) * prior)
        top = int(np.argmax(worth))
        if worth.flat[top] > best:
            row, column = np.unravel_index(top, worth.shape)
            best, radius, place = float(worth.flat[top]), float(r), (int(column), int(row))
    if best == 0.0:
        return None
    refined = _refine(gx, gy, np.array(place, float), radius)
    if refined is None:
        return None
    centre, covariance = refined
    return RoundMarker(centre + [x0, y0], covariance, radius)


def _gradients(image: Image) -> tuple[Floats, Floats]:
    """Return the gradient of whichever colour plane has the steepest one at each pixel, grey levels per px."""
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0).astype(np.float64)
    gx = cv2.Scharr(smooth, cv2.CV_64F, 1, 0, scale=1 / 32)
    gy = cv2.Scharr(smooth, cv2.CV_64F, 0, 1, scale=1 / 32)
    steepest = np.argmax(gx**2 + gy**2, axis=2)[..., None]
    return tuple(np.take_along_axis(g, steepest, axis=2)[..., 0] for g in (gx, gy))  # type: ignore[return-value]


def _coverages(image: Image, gx: Floats, gy: Floats) -> Iterator[tuple[int, Floats]]:
    """Yield, per radius, each centre's share of the circumference whose edge pixels point there with one sign."""
    height, width = gx.shape
    edges = np.maximum.reduce([cv2.Canny(p, 40, 80) for p in cv2.split(cv2.GaussianBlur(image, (0, 0), 1.0))])
    y, x = np.nonzero(edges)
    size = np.hypot(gx[y, x], gy[y, x]) + 1e-9
    ux, uy = gx[y, x] / size, gy[y, x] / size
    for r in _RADII_PX:
        share = np.zeros((height, width))
        for sign in (-1.0, 1.0):
            cx, cy = np.round(x + sign * r * ux).astype(int), np.round(y + sign * r * uy).astype(int)
            inside = (cx >= 0) & (cy >= 0) & (cx < width) & (cy < height)
            count = np.bincount(cy[inside] * width + cx[inside], minlength=height * width)
            # Directions are good to about a pixel at the centre, and Canny gives about one pixel per px of edge.
            near = cv2.boxFilter(count.reshape(height, width).astype(np.float64), -1, (3, 3), normalize=False)
            share = np.maximum(share, np.minimum(near / (2.0 * np.pi * r), 1.0))
        yield int(r), share


def _refine(gx: Floats, gy: Floats, centre: Floats, radius: float) -> tuple[Floats, Floats] | None:
    """Solve for the point nearest to the gradient lines: minimise Σ |g|² (n·(c − p))², n ⟂ g."""
    height, width = gx.shape
    yy, xx = np.mgrid[0:height, 0:width]
    strong = np.hypot(gx, gy)
    covariance = None
    for _ in range(10):
        near = np.hypot(xx - centre[0], yy - centre[1])
        pick = (near <= radius + 3.0) & (near >= 1.5)
        # The marker's edges are the strongest here; the slopes of its ground would drag the centre with them.
        pick &= strong > _EDGE_SHARE * np.quantile(strong[pick], 0.95)
        p = np.column_stack([xx[pick], yy[pick]]).astype(float)
        size = strong[pick]
        normal = np.column_stack([-gy[pick], gx[pick]]) / size[:, None]
        miss = ((centre - p) * normal).sum(axis=1)
        keep = np.abs(miss) < _LINE_PX
        if keep.sum() < 12:
            return None
        p, normal, weight = p[keep], normal[keep], size[keep] ** 2
        N = (normal * weight[:, None]).T @ normal
        target = (normal * (weight * (normal * p).sum(axis=1))[:, None]).sum(axis=0)
        now = np.linalg.solve(N, target)
        miss = ((now - p) * normal).sum(axis=1)
        # cluster-robust sandwich (Liang & Zeger 1986), a cluster a sector
        sector = (np.arctan2(*(p - now).T) / (2.0 * np.pi) % 1.0 * _SECTORS).astype(int) % _SECTORS
        told = np.zeros((_SECTORS, 2))
        np.add.at(told, sector, normal * (weight * miss)[:, None])
        inverse = np.linalg.inv(N)
        meat = told.T @ told * _SECTORS / (_SECTORS - 2)
        covariance = inverse @ meat @ inverse + _FLOOR_PX**2 * np.eye(2)
        moved, centre = np.hypot(*(now - centre)), now
        if moved < 1e-3:
            break
    return (centre, covariance) if covariance is not None else None
