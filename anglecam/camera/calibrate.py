"""A clip of a chessboard -> the camera's calibration, how sure it is, and which pictures it stands on.

The sharpest frame of each stretch of the clip is searched for the board; of what is found, views that differ are
kept. Distortion gets as many terms as predict views that were not fitted better, no more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from anglecam.camera.calibration import Calibration
from anglecam.camera.chessboard import find_corners
from anglecam.data.typing import Floats
from anglecam.errors import InputError
from anglecam.video.film import Film

_STRETCHES = 120
"""Parts of the clip from each of which one frame is searched."""
_MOST_VIEWS = 40
_FEWEST_VIEWS = 6
_APART = 0.02
"""Of the picture's diagonal: views whose board's corners all lie nearer than this are the same view."""
_FITTED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-10)
_BAD = 4.0
"""Robust standard deviations above the median at which a view's error means that its board was seen wrongly …"""
_BAD_SHARE = 2.5
"""… and least multiple of it: good views differ by a factor of two, as the board is near or far, lit well or badly."""
_WORTH = 2.0
"""Standard errors by which further terms must predict held-out views better."""
_FOLDS = 5
_LOOSE_FOCAL = 0.03
"""Relative uncertainty of the focal length above which the views say too little."""

_ALWAYS = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_K3
_MODELS = (
    ((), _ALWAYS | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST),
    (("k1",), _ALWAYS | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST),
    (("k1", "k2"), _ALWAYS | cv2.CALIB_ZERO_TANGENT_DIST),
    (("k1", "k2", "p1", "p2"), _ALWAYS),
)
"""Distortion terms from few to many; pixels are square in all."""


@dataclass(frozen=True, eq=False)
class BoardView:
    """One picture of the board that was used."""

    frame: int
    corners_px: Floats
    """(n, 2) as found."""
    residuals_px: Floats
    """(n, 2) found less reprojected."""


@dataclass(frozen=True, eq=False)
class BoardCalibration:
    """A calibration and what it stands on."""

    calibration: Calibration
    terms: tuple[str, ...]
    """Distortion coefficients that the views support; the others are zero."""
    held_out_px: dict[str, float]
    """RMS error of views that were not fitted, by the terms of the model, px."""
    views: tuple[BoardView, ...]
    rejected: int
    """Views whose corners did not fit with the others."""
    reach: float
    """How far out corners were seen, as a share of the way from the picture's middle to its corner."""
    notes: tuple[str, ...]
    """What the user should know, a line each."""


@dataclass(frozen=True, eq=False)
class _Seen:
    frame: int
    corners: Floats
    sharpness: float


@dataclass(frozen=True, eq=False)
class _Fit:
    rms: float
    K: Floats
    distortion: Floats
    rvecs: tuple[Floats, ...]
    tvecs: tuple[Floats, ...]
    per_view: Floats


def calibrate_clip(film: Film, board: tuple[int, int], square_m: float = 1.0) -> BoardCalibration:
    """Calibrate a camera from a clip in which a chessboard is shown to it in many poses.

    Parameters
    ----------
    film : Film
        The clip.
    board : tuple of int
        Inner corners, columns and rows: a board of 10 by 7 squares has (9, 6).
    square_m : float
        Side of a square, m. It scales the board's distances, never the calibration.

    Returns
    -------
    BoardCalibration
        Camera matrix, distortion, covariance, and what they stand on.

    Raises
    ------
    InputError
        Where the clip cannot be read, the board is not seen, seen in too few poses, or never at a slant.
    """
    clip = film.path
    if min(board) < 3 or not square_m > 0.0:
        raise InputError(f"{clip}: a board needs at least 3×3 inner corners and squares larger than nothing")
    size = film.size
    name = f"chessboard of {board[0]}×{board[1]} inner corners"
    seen, searched = _search(film, board)
    if not seen:
        raise InputError(
            f"{clip}: {name} not seen in any of {searched} frames searched; count the corners where four squares"
            " meet, and show the whole board with a white rim"
        )
    found = _diverse(seen, math.hypot(*size))
    if len(found) < _FEWEST_VIEWS:
        raise InputError(
            f"{clip}: {name} seen in {len(seen)} of {searched} frames searched, but in only {len(found)} different"
            f" poses; at least {_FEWEST_VIEWS} are needed, 15 are good: move and lean the board"
        )
    X = np.zeros((board[0] * board[1], 3))
    X[:, :2] = square_m * np.mgrid[: board[0], : board[1]].T.reshape(-1, 2)
    kept = _without_bad_views(X, [(view.frame, view.corners) for view in found], size)
    if len(kept) < _FEWEST_VIEWS:
        raise InputError(f"{clip}: only {len(kept)} of {len(found)} poses of the board agree with each other")
    corners = [c for _, c in kept]
    held_out = [_held_out(X, corners, size, flags) for _, flags in _MODELS]
    chosen = _choose(held_out)
    terms, flags = _MODELS[chosen]
    fit = _fit(X, corners, size, flags)
    residuals = _residuals(X, corners, fit)
    covariance = _covariance(X, fit, residuals, terms)
    loose = math.sqrt(covariance[0, 0]) / fit.K[0, 0]
    if not loose < _LOOSE_FOCAL:
        raise InputError(
            f"{clip}: the focal length stays uncertain by {100 * loose:.0f} %: the board is always seen nearly square"
            " on; lean it by 20° to 40°, to all sides"
        )
    middle = (np.array(size) - 1) / 2
    reach = max(float(np.hypot(*(c - middle).T).max()) for c in corners) / float(np.hypot(*middle))
    notes = []
    if reach < 0.8:
        notes.append(f"corners reach {reach:.0%} of the way to the picture's corner; farther out the lens is a guess")
    if len(kept) < 15:
        notes.append(f"{len(kept)} poses of the board; 15 and more are better")
    return BoardCalibration(
        calibration=Calibration(size, fit.K, fit.distortion, covariance, fit.rms, len(kept)),
        terms=terms,
        held_out_px={
            " ".join(t) or "none": float(np.sqrt(h.mean())) for (t, _), h in zip(_MODELS, held_out, strict=True)
        },
        views=tuple(BoardView(i, c, r) for (i, c), r in zip(kept, residuals, strict=True)),
        rejected=len(found) - len(kept),
        reach=reach,
        notes=tuple(notes),
    )


def _search(film: Film, board: tuple[int, int]) -> tuple[list[_Seen], int]:
    """Find the board in the sharpest frame of each stretch of a clip; say how many frames were searched."""
    sharpness = [
        -1.0 if f.image is None else float(cv2.Laplacian(cv2.cvtColor(f.image, cv2.COLOR_BGR2GRAY), cv2.CV_32F).var())
        for f in film.frames()
    ]
    stretches = np.array_split(np.arange(len(sharpness)), min(_STRETCHES, len(sharpness)))
    chosen = {int(part[np.argmax(np.array(sharpness)[part])]) for part in stretches}
    found: list[_Seen] = []
    for frame in film.frames():
        if frame.index in chosen and frame.image is not None:
            corners = find_corners(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY), board)
            if corners is not None:
                found.append(_Seen(frame.index, corners, sharpness[frame.index]))
    return found, len(chosen)


def _diverse(seen: list[_Seen], diagonal: float) -> list[_Seen]:
    """Keep views that differ, at most `_MOST_VIEWS`, the farthest from those kept first; of one pose the sharpest."""
    # a board may be counted from either end: both orders are the same pose
    there = np.array([np.stack([view.corners, view.corners[::-1]]) for view in seen])
    apart = np.full(len(seen), np.inf)
    kept: list[int] = []
    while len(kept) < _MOST_VIEWS and apart.max() > _APART * diagonal:
        distance = _distance(there, int(np.argmax(apart)))
        alike = np.flatnonzero((distance <= _APART * diagonal) & (apart > _APART * diagonal))
        kept.append(max((int(i) for i in alike), key=lambda i: seen[i].sharpness))
        apart = np.minimum(apart, _distance(there, kept[-1]))
    return [seen[i] for i in sorted(kept)]


def _distance(there: Floats, i: int) -> Floats:
    """Largest distance (n,) between a corner in view i and the same corner in each view, px."""
    return np.asarray(np.hypot(*np.moveaxis(there - there[i, 0], -1, 0)).max(axis=-1).min(axis=-1))


def _without_bad_views(X: Floats, views: list[tuple[int, Floats]], size: tuple[int, int]) -> list[tuple[int, Floats]]:
    """Leave out, worst first, the views whose error stands out from the others'."""
    while len(views) >= _FEWEST_VIEWS:
        error = _fit(X, [c for _, c in views], size, _MODELS[-1][1]).per_view
        middle = float(np.median(error))
        spread = 1.4826 * float(np.median(np.abs(error - middle)))
        worst = int(np.argmax(error))
        if error[worst] <= max(middle + _BAD * spread, _BAD_SHARE * middle):
            break
        views = views[:worst] + views[worst + 1 :]
    return views


def _fit(X: Floats, corners: Sequence[Floats], size: tuple[int, int], flags: int) -> _Fit:
    seen = [c.astype(np.float32).reshape(-1, 1, 2) for c in corners]
    boards = [X.astype(np.float32)] * len(seen)
    # With FIX_ASPECT_RATIO OpenCV takes fx/fy from the matrix it is given; its own start gives the focal length.
    start = cv2.initCameraMatrix2D(boards, seen, size, 1.0)
    rms, K, distortion, rvecs, tvecs, _, _, per_view = cv2.calibrateCameraExtended(
        boards, seen, size, start, np.zeros(5), flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS, criteria=_FITTED
    )
    return _Fit(
        float(rms),
        np.asarray(K, dtype=float),
        np.asarray(distortion, dtype=float).ravel()[:5],
        tuple(np.asarray(r, dtype=float) for r in rvecs),
        tuple(np.asarray(t, dtype=float) for t in tvecs),
        np.asarray(per_view, dtype=float).ravel(),
    )


def _residuals(X: Floats, corners: Sequence[Floats], fit: _Fit) -> list[Floats]:
    return [
        c - np.asarray(cv2.projectPoints(X, r, t, fit.K, fit.distortion)[0]).reshape(-1, 2)
        for c, r, t in zip(corners, fit.rvecs, fit.tvecs, strict=True)
    ]


def _held_out(X: Floats, corners: Sequence[Floats], size: tuple[int, int], flags: int) -> Floats:
    """Mean squared error (n,), px², of each view under a calibration by the others, its own pose fitted."""
    error = np.empty(len(corners))
    for k in range(_FOLDS):
        fit = _fit(X, [c for i, c in enumerate(corners) if i % _FOLDS != k], size, flags)
        for i in range(k, len(corners), _FOLDS):
            _, r, t = cv2.solvePnP(X, corners[i], fit.K, fit.distortion)
            shown = np.asarray(cv2.projectPoints(X, r, t, fit.K, fit.distortion)[0]).reshape(-1, 2)
            error[i] = ((corners[i] - shown) ** 2).sum(axis=1).mean()
    return error


def _choose(held_out: Sequence[Floats]) -> int:
    """Return the largest model that predicts better, view by view, than every smaller one that was worth it."""
    chosen = 0
    for larger in range(1, len(held_out)):
        gain = held_out[chosen] - held_out[larger]
        if gain.mean() > _WORTH * gain.std(ddof=1) / math.sqrt(len(gain)):
            chosen = larger
    return chosen


def _covariance(X: Floats, fit: _Fit, residuals: Sequence[Floats], terms: tuple[str, ...]) -> Floats:
    """Return the (9, 9) covariance of fx, fy, cx, cy and five coefficients, poses eliminated.

    The cluster-robust sandwich (Liang & Zeger 1986) with views as clusters: corners of one view share its blur and
    its board's faults. With Q the projector off the six directions of a view's pose, A = Σ JᵀQJ and g = JᵀQr,
    the covariance is A⁻¹·(Σ g·gᵀ)·n/(n − p)·A⁻¹.
    """
    active = [("k1", "k2", "p1", "p2").index(term) for term in terms]
    p = 3 + len(active)
    A, meat = np.zeros((p, p)), np.zeros((p, p))
    for r, t, residual in zip(fit.rvecs, fit.tvecs, residuals, strict=True):
        J = np.asarray(cv2.projectPoints(X, r, t, fit.K, fit.distortion)[1])  # rvec, tvec, fx, fy, cx, cy, k1 …
        inner = np.column_stack([J[:, 6] + J[:, 7], J[:, 8:10], J[:, 10:][:, active]])
        pose = np.linalg.qr(J[:, :6])[0]
        inner = inner - pose @ (pose.T @ inner)
        g = inner.T @ residual.ravel()
        A += inner.T @ inner
        meat += np.outer(g, g)
    n = len(residuals)
    bread = np.linalg.inv(A)
    small = bread @ meat @ bread * n / max(n - p, 1)
    place = np.zeros((9, p))
    place[[0, 1], 0] = 1.0  # fx and fy are one number
    place[[2, 3], [1, 2]] = 1.0
    place[[4 + i for i in active], range(3, p)] = 1.0
    return np.asarray(place @ small @ place.T)
