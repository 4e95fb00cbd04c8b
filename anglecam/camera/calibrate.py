"""Calibrate a camera from a clip of a chessboard: the calibration, its covariance and the pictures it is based on.

The sharpest frame of each stretch of the clip is searched for the board, and views that differ are kept. A distortion
term is added only if it improves the prediction of views that were held out of the fit.
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
from anglecam.progress import Progress, Stage, unseen, watched
from anglecam.video.film import Film

_STRETCHES = 120
"""Number of parts of the clip; one frame of each is searched."""
_MOST_VIEWS = 40
_FEWEST_VIEWS = 6
_APART = 0.02
"""Share of the picture's diagonal: two views count as the same if each corner moves by less from one to the other."""
_FITTED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-10)
_BAD = 4.0
"""A view is rejected if its error exceeds the median by more than this many robust standard deviations …"""
_BAD_SHARE = 2.5
"""… and exceeds this multiple of the median: errors of good views differ by a factor of two, because the board is near
or far and lit well or badly."""
_WORTH = 2.0
"""Number of standard errors by which further distortion terms must improve the prediction of held-out views."""
_FOLDS = 5
"""Number of parts for the cross-validation of the distortion terms."""
_LOOSE_FOCAL = 0.03
"""Relative uncertainty of the focal length above which a calibration is refused."""

_ALWAYS = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_K3
_MODELS = (
    ((), _ALWAYS | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST),
    (("k1",), _ALWAYS | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST),
    (("k1", "k2"), _ALWAYS | cv2.CALIB_ZERO_TANGENT_DIST),
    (("k1", "k2", "p1", "p2"), _ALWAYS),
)
"""Distortion models from few to many terms, with OpenCV's flags; all have square pixels."""


@dataclass(frozen=True, eq=False)
class BoardView:
    """One picture of the board that the calibration uses."""

    frame: int
    corners_px: Floats
    """(n, 2) corners as found."""
    residuals_px: Floats
    """(n, 2) corners as found minus corners as reprojected."""


@dataclass(frozen=True, eq=False)
class BoardCalibration:
    """A calibration and the views that it is based on."""

    calibration: Calibration
    terms: tuple[str, ...]
    """Distortion coefficients that the views support; the others are zero."""
    held_out_px: dict[str, float]
    """RMS error of held-out views by the terms of the distortion model, px."""
    views: tuple[BoardView, ...]
    rejected: int
    """Number of views whose corners do not agree with the other views."""
    reach: float
    """Largest distance of a corner from the picture's middle, as a share of the distance to the picture's corner."""
    notes: tuple[str, ...]
    """Remarks for the user, one line each."""


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


def calibrate_clip(
    film: Film, board: tuple[int, int], square_m: float = 1.0, *, progress: Progress = unseen
) -> BoardCalibration:
    """Calibrate a camera from a clip that shows a chessboard in many poses.

    Parameters
    ----------
    film : Film
        The clip.
    board : tuple of int
        Number of inner corners, columns and rows: a board of 10 by 7 squares has (9, 6).
    square_m : float
        Side of a square, m. It scales the distances to the board and does not affect the calibration.
    progress : Progress
        Called with each stage, and after each frame.

    Returns
    -------
    BoardCalibration
        Camera matrix, distortion, covariance and the views that they are based on.

    Raises
    ------
    InputError
        If the clip cannot be read, or the board is not found, found in too few poses, or never at a slant.
    """
    clip = film.path
    if min(board) < 3 or not square_m > 0.0:
        raise InputError(f"{clip}: a board needs at least 3×3 inner corners and squares larger than zero")
    size = film.size
    name = f"chessboard of {board[0]}×{board[1]} inner corners"
    seen, searched = _search(film, board, progress)
    if not seen:
        raise InputError(
            f"{clip}: {name} not found in any of {searched} frames searched; count the corners where four squares"
            " meet, and show the whole board with a white rim"
        )
    found = _diverse(seen, math.hypot(*size))
    if len(found) < _FEWEST_VIEWS:
        raise InputError(
            f"{clip}: {name} found in {len(seen)} of {searched} frames searched, but in only {len(found)} different"
            f" poses; at least {_FEWEST_VIEWS} are needed, 15 are good: move and lean the board"
        )
    progress(Stage("fitting the camera"))
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
            f"{clip}: the focal length remains uncertain by {100 * loose:.0f} % because the board always faces the"
            " camera; lean it by 20° to 40° to all sides"
        )
    middle = (np.array(size) - 1) / 2
    reach = max(float(np.hypot(*(c - middle).T).max()) for c in corners) / float(np.hypot(*middle))
    notes = []
    if reach < 0.8:
        notes.append(f"corners reach {reach:.0%} of the way to the picture's corner; beyond, the lens is extrapolated")
    if len(kept) < 15:
        notes.append(f"{len(kept)} poses of the board; 15 or more are better")
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


def _search(film: Film, board: tuple[int, int], progress: Progress) -> tuple[list[_Seen], int]:
    """Find the board in the sharpest frame of each stretch of a clip; also return how many frames were searched."""
    sharpness = [
        -1.0 if f.image is None else float(cv2.Laplacian(cv2.cvtColor(f.image, cv2.COLOR_BGR2GRAY), cv2.CV_32F).var())
        for f in watched(film.frames(), progress, "looking for sharp pictures", film.rows.declared)
    ]
    stretches = np.array_split(np.arange(len(sharpness)), min(_STRETCHES, len(sharpness)))
    chosen = {int(part[np.argmax(np.array(sharpness)[part])]) for part in stretches}
    found: list[_Seen] = []
    for frame in watched(film.frames(), progress, "looking for the chessboard", len(sharpness)):
        if frame.index in chosen and frame.image is not None:
            corners = find_corners(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY), board)
            if corners is not None:
                found.append(_Seen(frame.index, corners, sharpness[frame.index]))
    return found, len(chosen)


def _diverse(seen: list[_Seen], diagonal: float) -> list[_Seen]:
    """Select views that differ, at most `_MOST_VIEWS`: repeatedly the one farthest from those selected so far.

    Of views of the same pose, the sharpest is taken.
    """
    # the corners may be listed from either end of the board: both orders are the same pose
    corners = np.array([np.stack([view.corners, view.corners[::-1]]) for view in seen])
    apart = np.full(len(seen), np.inf)
    kept: list[int] = []
    while len(kept) < _MOST_VIEWS and apart.max() > _APART * diagonal:
        distance = _distance(corners, int(np.argmax(apart)))
        alike = np.flatnonzero((distance <= _APART * diagonal) & (apart > _APART * diagonal))
        kept.append(max((int(i) for i in alike), key=lambda i: seen[i].sharpness))
        apart = np.minimum(apart, _distance(corners, kept[-1]))
    return [seen[i] for i in sorted(kept)]


def _distance(corners: Floats, i: int) -> Floats:
    """Return (n,) the largest distance between a corner in view i and the same corner in each view, px."""
    return np.asarray(np.hypot(*np.moveaxis(corners - corners[i, 0], -1, 0)).max(axis=-1).min(axis=-1))


def _without_bad_views(X: Floats, views: list[tuple[int, Floats]], size: tuple[int, int]) -> list[tuple[int, Floats]]:
    """Return the views without those whose error is an outlier; the worst is removed first."""
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
    # With FIX_ASPECT_RATIO, OpenCV keeps fx/fy of the given matrix; initCameraMatrix2D supplies a focal length.
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
    """Return (n,) each view's mean squared error, px², under a calibration by other views; only its pose is fitted."""
    error = np.empty(len(corners))
    for k in range(_FOLDS):
        fit = _fit(X, [c for i, c in enumerate(corners) if i % _FOLDS != k], size, flags)
        for i in range(k, len(corners), _FOLDS):
            _, r, t = cv2.solvePnP(X, corners[i], fit.K, fit.distortion)
            projected = np.asarray(cv2.projectPoints(X, r, t, fit.K, fit.distortion)[0]).reshape(-1, 2)
            error[i] = ((corners[i] - projected) ** 2).sum(axis=1).mean()
    return error


def _choose(held_out: Sequence[Floats]) -> int:
    """Return the index of the chosen model: each larger model replaces the last chosen one if it predicts better."""
    chosen = 0
    for larger in range(1, len(held_out)):
        gain = held_out[chosen] - held_out[larger]
        if gain.mean() > _WORTH * gain.std(ddof=1) / math.sqrt(len(gain)):
            chosen = larger
    return chosen


def _covariance(X: Floats, fit: _Fit, residuals: Sequence[Floats], terms: tuple[str, ...]) -> Floats:
    """Return the (9, 9) covariance of fx, fy, cx, cy and five coefficients, with the poses eliminated.

    This is the cluster-robust sandwich estimator (Liang & Zeger 1986) with views as clusters, because the corners of
    one view share its blur and the faults of the board. With Q the projector onto the complement of the six directions
    of a view's pose, A = Σ JᵀQJ and g = JᵀQr, the covariance is A⁻¹·(Σ g·gᵀ)·n/(n − p)·A⁻¹.
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
