"""Two ways to measure a rotation with OpenCV, given a rectangle that the body fills in the first frame.

Both return the rotation from the first frame, counter-clockwise as seen, rad; NaN where the method gives up.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

Region = tuple[int, int, int, int]
"""Left, top, right, bottom, px."""
_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-7)
_BLUR = 5
"""Side of the Gaussian filter that `findTransformECC` applies, px; its default."""
_CORNERS, _QUALITY, _APART_PX = 200, 0.01, 5
_WINDOW = (21, 21)
_RETURNS_PX = 0.5
"""A point that does not return to its start when tracked backwards is dropped, px."""
_FEWEST = 3


def with_ecc(pictures: Iterable[np.ndarray], region: Region) -> np.ndarray:
    """Align the rectangle of the first frame with each frame by enhanced correlation (Evangelidis & Psarakis 2008)."""
    left, top, right, bottom = region
    found, template = [], None
    warp = np.array([[1.0, 0.0, left], [0.0, 1.0, top]], np.float32)
    for picture in pictures:
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        template = grey[top:bottom, left:right] if template is None else template
        try:
            warp = cv2.findTransformECC(template, grey, warp, cv2.MOTION_EUCLIDEAN, _UNTIL, None, _BLUR)[1]
            found.append(float(np.arctan2(-warp[1, 0], warp[0, 0])))
        except cv2.error:
            found.append(np.nan)
    return np.array(found)


def with_lucas_kanade(pictures: Iterable[np.ndarray], region: Region) -> np.ndarray:
    """Track corners of the rectangle from frame to frame and fit a rotation with RANSAC and least squares."""
    left, top, right, bottom = region
    mask = None
    start = here = np.empty((0, 2), np.float32)
    before, found = None, []
    for picture in pictures:
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        if mask is None or before is None:
            mask = np.zeros_like(grey)
            mask[top:bottom, left:right] = 255
            corners = cv2.goodFeaturesToTrack(grey, _CORNERS, _QUALITY, _APART_PX, mask=mask)
            start = here = np.empty((0, 2), np.float32) if corners is None else corners.reshape(-1, 2)
        elif len(here) >= _FEWEST:
            there, seen, _ = cv2.calcOpticalFlowPyrLK(before, grey, here, None, winSize=_WINDOW, criteria=_UNTIL)
            back, again, _ = cv2.calcOpticalFlowPyrLK(grey, before, there, None, winSize=_WINDOW, criteria=_UNTIL)
            good = (seen & again).ravel().astype(bool) & (np.hypot(*(back - here).T) < _RETURNS_PX)
            start, here = start[good], there[good]
        before = grey
        found.append(_rotation(start, here))
    return np.array(found)


def _rotation(start: np.ndarray, here: np.ndarray) -> float:
    if len(here) < _FEWEST:
        return np.nan
    inliers = cv2.estimateAffinePartial2D(start, here, method=cv2.RANSAC, ransacReprojThreshold=1.0)[1]
    kept = np.ones(len(here), bool) if inliers is None else inliers.ravel().astype(bool)
    a, b = (points[kept].astype(float) - points[kept].mean(axis=0) for points in (start, here))
    return float(-np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
