"""What somebody declares about the body, and whether a body is the declared one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from anglecam.data.typing import Floats
from anglecam.engine.refine import Fit
from anglecam.engine.sample import Sample
from anglecam.engine.target import turned

_FAR = 9.0
"""Squared standard uncertainties by which a hint may be off the centre: true hints are so in 1 % of all films."""
_CLICK_PX = 7.0
"""Standard uncertainty of each coordinate of a place that is pointed at, px of the film: it is usually 10 px off."""
_LEAST_PART = 0.05
"""Of the area of a body's largest part, that of another one that counts."""


@dataclass(frozen=True)
class Hints:
    """What is declared; px of the film."""

    pivot_px: Floats | None = None
    """(2,) about where it turns."""
    pivot_sigma_px: float = 30.0
    """Standard uncertainty of each coordinate."""
    mark_px: Floats | None = None
    """(4,) box, left, top, right, bottom, that covers a part of it."""
    mark_frame: int = 0
    """In which frame of the film."""

    @property
    def around_mark_px(self) -> Floats | None:
        """(4,) box in which the mark is, if the place was pointed at as well as usual; it is looked at, too."""
        if self.mark_px is None:
            return None
        reach = np.sqrt(_FAR) * _CLICK_PX
        return self.mark_px + np.array([-reach, -reach, reach, reach])


NO_HINTS = Hints()


def obeys(fit: Fit, sample: Sample, hints: Hints) -> bool:
    """Return whether a body turns about the hinted pivot and is where it was pointed at."""
    if not agrees_with_pivot(fit.proposal.centre_px, fit.covariance_px2, hints):
        return False
    return beside_mark(fit, sample, hints) <= np.sqrt(_FAR)


def agrees_with_pivot(centre_px: Floats, covariance_px2: Floats, hints: Hints) -> bool:
    """Return whether a centre (2,) with its covariance (2, 2) may be the hinted pivot."""
    if hints.pivot_px is None:
        return True
    off = centre_px - hints.pivot_px
    return bool(off @ np.linalg.solve(covariance_px2 + hints.pivot_sigma_px**2 * np.eye(2), off) <= _FAR)


def agrees_with_click(place_px: Floats, radius_px: float, hints: Hints) -> bool:
    """Return whether a thing of some radius at a place (2,) may be what was pointed at in that frame."""
    if hints.mark_px is None:
        return True
    off = place_px - np.clip(place_px, hints.mark_px[:2], hints.mark_px[2:])
    return bool(np.hypot(*off) - radius_px <= np.sqrt(_FAR) * _CLICK_PX)


def beside_mark(fit: Fit, sample: Sample, hints: Hints) -> float:
    """Return how far a body is from where it was pointed at, in standard uncertainties of a click.

    It is 0 where nothing contradicts the hint. Pixels that look like the body by chance are few and lie by themselves.
    """
    k = int(np.argmin(np.abs(sample.frames - hints.mark_frame)))
    turn = fit.proposal.turn[k]
    if hints.mark_px is None or sample.frames[k] != hints.mark_frame or not np.isfinite(turn):
        return 0.0
    _, labels, stats, _ = cv2.connectedComponentsWithStats((fit.target.visibility > 0.5).astype(np.uint8))
    areas = stats[1:, cv2.CC_STAT_AREA]
    parts = 1 + np.flatnonzero(areas >= _LEAST_PART * areas.max())
    rows, columns = np.nonzero(np.isin(labels, parts))
    places = np.column_stack([columns, rows]) - float(fit.target.pad)
    pose = turned(sample.place(fit.proposal.centre_px), float(turn))
    there = sample.in_film(places @ pose[:, :2].T + pose[:, 2])
    there = np.vstack([there, fit.proposal.centre_px])  # a hub is not seen to turn
    off = there - np.clip(there, hints.mark_px[:2], hints.mark_px[2:])
    return float(np.hypot(*off.T).min() / np.hypot(_CLICK_PX, 1.0 / sample.scale))
