"""Find a round marker by its symmetry.

Round markers, discs or rings, bright or dark, have edges whose gradients all point towards or away from one centre.
Edge pixels vote for the centres they point at (Loy & Zelinsky 2003). The centre is then refined as the point nearest to
all gradient lines by weighted least squares (Parthasarathy 2012), which requires neither the marker's size nor its
colour.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image

_RADII_PX = np.arange(3, 25)
_MIN_COVERAGE = 0.6
"""Share of a circle's circumference that must point at its centre."""
_FEWEST = 12
"""Gradients that determine a centre."""
_LINE_PX = 1.5
"""A gradient line that passes the centre at a greater distance belongs to something else, px."""
_EDGE_SHARE = 0.4
"""Share of the marker's steep gradients (their 95 % quantile) below which a gradient does not count as its edge."""
_FLOOR_PX = 0.03
"""Standard uncertainty of a marker's centre that no number of edge pixels reduces: shading, chroma, codec."""
_SECTORS = 12
"""Sectors of the circumference: gradients within one have correlated noise and the same slope of the background."""


@dataclass(frozen=True)
class RoundMarker:
    """A round marker in the picture."""

    centre_px: Floats
    """(2,) px."""
    covariance_px2: Floats
    """(2, 2) px²."""
    radius_px: float
    """Radius of its most complete edge, px."""


def find_marker(image: Image, expected_px: Floats | None, covariance_px2: Floats | None) -> RoundMarker | None:
    """Find the round marker nearest to its expected place.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) blue, green, red. The median of several frames shows only what does not move.
    expected_px : ndarray, optional
        (2,) expected place, px; without it the whole image is searched.
    covariance_px2 : ndarray, optional
        (2, 2) covariance of the expected place, px². Markers beyond three standard uncertainties are not considered.

    Returns
    -------
    RoundMarker or None
        ``None`` where no circle is complete enough.
    """
    height, width = image.shape[:2]
    x0, y0, x1, y1 = 0, 0, width, height
    if expected_px is not None and covariance_px2 is not None:
        half = 3.0 * np.sqrt(np.diag(covariance_px2)) + _RADII_PX[-1] + 4
        x0, y0 = (max(int(v), 0) for v in expected_px - half)
        x1, y1 = (min(int(v), most) for v, most in zip(expected_px + half, (width, height), strict=True))
        if x1 - x0 < 12 or y1 - y0 < 12:
            return None
    part = image[y0:y1, x0:x1]
    gx, gy = _gradients(part)
    prior = np.ones(gx.shape)
    if expected_px is not None and covariance_px2 is not None:
        yy, xx = np.mgrid[y0:y1, x0:x1]
        off = np.stack([xx - expected_px[0], yy - expected_px[1]], axis=-1)
        away = np.einsum("...i,ij,...j->...", off, np.linalg.inv(covariance_px2), off)
        prior = np.where(away <= 9.0, np.exp(-away / 8.0), 0.0)
    best, radius, place = 0.0, 0.0, (0, 0)
    for r, coverage in _coverages(part, gx, gy):
        # A larger circle has more edge pixels that could disagree, so of two equally complete circles it scores higher.
        worth = np.where(coverage < _MIN_COVERAGE, 0.0, (coverage - 0.5) * np.sqrt(r) * prior)
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


def count_round_things(image: Image) -> int:
    """Count the round things in a picture (h, w, 3), among which a marker is one."""
    gx, gy = _gradients(image)
    found = np.zeros(gx.shape, np.uint8)
    for _, coverage in _coverages(image, gx, gy):
        found |= (coverage >= _MIN_COVERAGE).astype(np.uint8)
    return int(cv2.connectedComponents(cv2.dilate(found, np.ones((7, 7), np.uint8)))[0] - 1)


def _gradients(image: Image) -> tuple[Floats, Floats]:
    """Return the gradient of the colour plane with the steepest one at each pixel, grey levels per px."""
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0).astype(np.float64)
    gx = cv2.Scharr(smooth, cv2.CV_64F, 1, 0, scale=1 / 32)
    gy = cv2.Scharr(smooth, cv2.CV_64F, 0, 1, scale=1 / 32)
    steepest = np.argmax(gx**2 + gy**2, axis=2)[..., None]
    return tuple(np.take_along_axis(g, steepest, axis=2)[..., 0] for g in (gx, gy))  # type: ignore[return-value]


def _coverages(image: Image, gx: Floats, gy: Floats) -> Iterator[tuple[int, Floats]]:
    """Yield for each radius a map of the share of the circumference whose edge pixels point at each centre.

    The gradients of one circle must all point inwards or all outwards.
    """
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
            # Gradient directions are accurate to about a pixel at the centre: sum over 3 × 3 pixels. Canny gives about
            # one edge pixel per px of circumference.
            near = cv2.boxFilter(count.reshape(height, width).astype(np.float64), -1, (3, 3), normalize=False)
            share = np.maximum(share, np.minimum(near / (2.0 * np.pi * r), 1.0))
        yield int(r), share


def _refine(gx: Floats, gy: Floats, centre: Floats, radius: float) -> tuple[Floats, Floats] | None:
    """Solve for the point nearest to the gradient lines: minimise Σ |g|² (n·(c − p))², n ⟂ g.

    Returns
    -------
    tuple of ndarray or None
        The centre (2,), px, and its covariance (2, 2), px²; ``None`` where fewer than `_FEWEST` gradients point at it.
    """
    height, width = gx.shape
    yy, xx = np.mgrid[0:height, 0:width]
    steepness = np.hypot(gx, gy)
    covariance = None
    for _ in range(10):
        distance = np.hypot(xx - centre[0], yy - centre[1])
        pick = (distance <= radius + 3.0) & (distance >= 1.5)
        if pick.sum() < _FEWEST:  # the lines meet outside the part that is searched
            return None
        # The marker's edges are the steepest here; the slopes of the background would bias the centre.
        pick &= steepness > _EDGE_SHARE * np.quantile(steepness[pick], 0.95)
        p = np.column_stack([xx[pick], yy[pick]]).astype(float)
        size = steepness[pick]
        normal = np.column_stack([-gy[pick], gx[pick]]) / size[:, None]
        miss = ((centre - p) * normal).sum(axis=1)
        keep = np.abs(miss) < _LINE_PX
        if keep.sum() < _FEWEST:
            return None
        p, normal, weight = p[keep], normal[keep], size[keep] ** 2
        N = (normal * weight[:, None]).T @ normal
        target = (normal * (weight * (normal * p).sum(axis=1))[:, None]).sum(axis=0)
        now = np.linalg.solve(N, target)
        miss = ((now - p) * normal).sum(axis=1)
        # Cluster-robust sandwich (Liang & Zeger 1986) with one cluster for each sector.
        sector = (np.arctan2(*(p - now).T) / (2.0 * np.pi) % 1.0 * _SECTORS).astype(int) % _SECTORS
        scores = np.zeros((_SECTORS, 2))
        np.add.at(scores, sector, normal * (weight * miss)[:, None])
        inverse = np.linalg.inv(N)
        meat = scores.T @ scores * _SECTORS / (_SECTORS - 2)
        covariance = inverse @ meat @ inverse + _FLOOR_PX**2 * np.eye(2)
        step, centre = np.hypot(*(now - centre)), now
        if step < 1e-3:
            break
    return (centre, covariance) if covariance is not None else None
