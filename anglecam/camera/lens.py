"""Map points between the filmed picture and the plane of motion as a camera on the axis of rotation would see it.

Only points are mapped, never frames. `Lens.rectify` corrects two effects, each only if it is known. The first is the
lens, by OpenCV's model and a calibration. The second is a declared tilt: the line of sight to the pivot leans by τ from
the axis of rotation, because the camera is turned about an axis a in the picture. With the pivot at the origin, U along
a and V across a, a point (X, Y) of the plane, in pixels of the rectified view, appears at ::

    U = X / (1 − Y·sin τ / f),    V = Y·cos τ / (1 − Y·sin τ / f)

A circle about the pivot therefore appears with axes in the ratio cos τ, and nearer points appear larger. The inverse is
::

    X = U / (1 + V·tan τ / f),    Y = V / cos τ / (1 + V·tan τ / f)

At the pivot, lengths along a do not change. Both coordinates have the same denominator. Without f (weak perspective),
the line from the pivot to the mark still has the correct direction, and only distances from the pivot are wrong, by a
relative error Y·sin τ/f. A centre fitted to a path of radius R is then off by about R²·sin τ/f, which the path does not
reveal.

A point of the body that lies z nearer to the camera than the pivot also turns, rectified, by exactly the same angle on
a circle, but about a different centre: the tilted view shows the axis of rotation obliquely, and the centre is where
the axis passes the height z. With b the unit vector across a, upward for a view from above, that centre is off the
pivot by −b·z·sin τ/(cos τ − z/f). A line of sight to the axis at another height z leans otherwise, by z·sin τ/f.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike

from anglecam.camera.calibration import Calibration, read_calibration
from anglecam.data.typing import Floats
from anglecam.errors import InputError, RigError
from anglecam.io.rig import Rig

_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)
"""Iterations of the undistortion; OpenCV's default of five leaves an error of 0.1 px in the corners of a wide lens."""
_STEP_PX = 0.5
"""Half the step of a difference quotient, px; lenses are smooth over many pixels."""
_RETURNS_PX = 0.01
"""Largest error of a point that is rectified and distorted again, px."""
_INVERSE_FOCAL = 0.7
"""RMS of 1/f of an unknown camera, in units of 1/(the picture's width): 0 from afar to 1.2 of a telephone."""


@dataclass(frozen=True, eq=False)
class Lens:
    """Camera, lens and view of one clip; without arguments the identity.

    Examples
    --------
    Seen at a tilt of 60° from above, heights above the pivot appear at half their length:

    >>> lens = Lens(tilt=math.radians(60.0), pivot_px=(100.0, 100.0))
    >>> lens.rectify([130.0, 80.0]).round(9)
    array([130.,  60.])
    >>> lens.distort(lens.rectify([130.0, 80.0])).round(9)
    array([130.,  80.])
    """

    calibration: Calibration | None = None
    """``None``: a pinhole."""
    tilt: float = 0.0
    """Angle τ between the line of sight to the pivot and the axis of rotation, rad."""
    tilt_axis: float = 0.0
    """Direction in the picture of the axis about which the camera is turned, rad, y up: at 0 it looks from above."""
    tilt_sigma: float = 0.0
    """Standard uncertainty of the tilt, rad."""
    focal_px: float | None = None
    """Focal length f, px; ``None``: weak perspective."""
    pivot_px: tuple[float, float] = (0.0, 0.0)
    """Centre of the tilted view in the picture without distortion, px."""

    @property
    def is_identity(self) -> bool:
        """Whether points are left unchanged."""
        return self.calibration is None and self.tilt == 0.0

    @property
    def neglects_perspective(self) -> bool:
        """Whether distances in a tilted view are wrong because the focal length is unknown."""
        return self.tilt != 0.0 and self.focal_px is None

    @property
    def parallax(self) -> Floats:
        """(2,) rectified offset from the pivot of the centre about which nearer points turn, px for each px of height.

        The direction is exact for every height z. The length is of first order: the exact one is larger by the factor
        (cos τ)/(cos τ − z/f).
        """
        return math.tan(self.tilt) * np.array([math.sin(self.tilt_axis), math.cos(self.tilt_axis)])

    def looking_at(self, pivot_px: ArrayLike, height_sigma_px: float = 0.0) -> Lens:
        """Return this lens with the tilted view centred on a pivot.

        Parameters
        ----------
        pivot_px : array_like
            (2,) in the picture as it was filmed, px.
        height_sigma_px : float
            Standard uncertainty of the height at which that is a point of the axis of rotation, px: the tilt was
            declared for a line of sight to the axis at the plane of motion.
        """
        x, y = self._undistort(np.asarray(pivot_px, dtype=float))
        leans = 0.0 if self.focal_px is None else height_sigma_px * math.sin(self.tilt) / self.focal_px
        sigma = math.hypot(self.tilt_sigma, leans)
        return dataclasses.replace(self, pivot_px=(float(x), float(y)), tilt_sigma=sigma)

    def neglected_displacement(self, radius_px: float, width_px: int) -> Floats:
        """Return (2,) px: how uncertain an unknown focal length makes the centre that is fitted to a tilted circle."""
        along = np.array([math.sin(self.tilt_axis), math.cos(self.tilt_axis)])
        return along * radius_px**2 * math.sin(self.tilt) * _INVERSE_FOCAL / width_px

    def rectify(self, points_px: ArrayLike) -> Floats:
        """Return (…, 2) points of the picture at their positions in the rectified view, px; NaN stays NaN."""
        points = self._undistort(np.asarray(points_px, dtype=float))
        return points if self.tilt == 0.0 else _map(self._homography(), points)

    def distort(self, points_px: ArrayLike) -> Floats:
        """Return (…, 2) rectified points at their positions in the picture, px: the inverse of `rectify`."""
        points = np.asarray(points_px, dtype=float)
        if self.tilt != 0.0:
            points = _map(np.asarray(np.linalg.inv(self._homography()), dtype=float), points)
        if self.calibration is None or points.size == 0:
            return points
        square, centre = self._square()
        rays = np.dstack([(points.reshape(-1, 1, 2) - centre) / square, np.ones(points.size // 2)[:, None]])
        seen = cv2.projectPoints(
            rays, np.zeros(3), np.zeros(3), self.calibration.camera_matrix, self.calibration.distortion
        )[0]
        return np.asarray(seen, dtype=float).reshape(points.shape)

    def jacobian(self, points_px: ArrayLike) -> Floats:
        """Return (…, 2, 2) the derivative J of `rectify`: a point's covariance C becomes J·C·Jᵀ."""
        points = np.asarray(points_px, dtype=float)
        if self.is_identity:
            return np.broadcast_to(np.eye(2), (*points.shape, 2))
        columns = [
            (self.rectify(points + step) - self.rectify(points - step)) / (2.0 * _STEP_PX)
            for step in _STEP_PX * np.eye(2)
        ]
        return np.stack(columns, axis=-1)

    def deviants(self) -> tuple[Lens, ...]:
        """Return lenses that are each off by one standard deviation in one independent direction.

        The lens contributes Σ (y(deviant) − y(lens))² to the variance of any result y that is computed through it. The
        errors are common to all frames, so a difference of two angles must be computed with the same deviant.

        Returns
        -------
        tuple of Lens
            One lens for each direction in which calibration and tilt are uncertain; empty if they state no uncertainty.
        """
        found = []
        if self.calibration is not None and self.calibration.covariance is not None:
            found = [dataclasses.replace(self, calibration=c) for c in _deviate(self.calibration)]
            found = [lens._keeping_focal(self) for lens in found]
        if self.tilt_sigma > 0.0:
            found.append(dataclasses.replace(self, tilt=self.tilt + self.tilt_sigma))
        return tuple(found)

    def covariance(self, points_px: ArrayLike) -> Floats:
        """Return (…, 2, 2) the covariance of rectified points due to calibration and tilt alone, px²."""
        here = self.rectify(points_px)
        moved = [lens.rectify(points_px) - here for lens in self.deviants()]
        return sum((d[..., :, None] * d[..., None, :] for d in moved), np.zeros((*here.shape, 2)))

    def _keeping_focal(self, nominal: Lens) -> Lens:
        """Return this lens with the focal length of the perspective set to that of its calibration."""
        assert self.calibration is not None
        focal = None if nominal.focal_px is None else self.calibration.focal_px
        return dataclasses.replace(self, focal_px=focal)

    def _square(self) -> tuple[float, Floats]:
        """Return focal length and principal point, px, of the picture without distortion, whose pixels are square."""
        assert self.calibration is not None
        return self.calibration.focal_px, self.calibration.camera_matrix[:2, 2]

    def _undistort(self, points: Floats) -> Floats:
        if self.calibration is None or points.size == 0:
            return points
        focal, (x, y) = self._square()
        matrix = np.array([[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]])
        ideal = cv2.undistortPoints(
            np.ascontiguousarray(points).reshape(-1, 1, 2),
            self.calibration.camera_matrix,
            self.calibration.distortion,
            P=matrix,
            criteria=_UNTIL,
        )
        return np.asarray(ideal, dtype=float).reshape(points.shape)

    def _homography(self) -> Floats:
        """Return (3, 3) the homography from the tilted view to the rectified one; it leaves the pivot unchanged."""
        c, s = math.cos(self.tilt_axis), math.sin(self.tilt_axis)
        turn = np.array([[c, -s, 0.0], [-s, -c, 0.0], [0.0, 0.0, 1.0]])  # rows: along a and across it, y down
        nearer = 0.0 if self.focal_px is None else math.tan(self.tilt) / self.focal_px
        lean = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 / math.cos(self.tilt), 0.0], [0.0, nearer, 1.0]])
        there = np.eye(3)
        there[:2, 2] = self.pivot_px
        back = np.eye(3)
        back[:2, 2] = -np.asarray(self.pivot_px)
        return np.asarray(there @ turn.T @ lean @ turn @ back)


def lens_from_rig(rig: Rig, size: tuple[int, int], clip: Path) -> Lens:
    """Return the lens that a rig declares for a clip.

    Parameters
    ----------
    rig : Rig
        Its ``camera``, ``facing`` and ``pivot`` are used; ``facing: left`` also mirrors the tilt's axis.
    size : tuple of int
        Width and height of the clip, px.
    clip : Path
        The clip, named in the error if the calibration does not fit it.

    Returns
    -------
    Lens
        The identity if nothing is declared. The tilted view is centred on the expected pivot, else on the middle of the
        picture; `Lens.looking_at` replaces this centre.

    Raises
    ------
    RigError
        If the calibration cannot be read, or its distortion cannot be inverted within the picture.
    InputError
        If the calibration was made for pictures of another size.
    """
    camera = rig.camera
    calibration = None
    if camera.calibration is not None:
        path = Path(camera.calibration)
        calibration = read_calibration(path)
        if calibration.size is not None and calibration.size != size:
            made, has = ("×".join(map(str, s)) for s in (calibration.size, size))
            raise InputError(f"{clip}: {has} px, but {path} was made for pictures of {made} px")
        _check_border(Lens(calibration), size, path)
    axis = math.radians(camera.tilt_axis_deg)
    lens = Lens(
        calibration=calibration,
        tilt=math.radians(camera.tilt_deg or 0.0),
        tilt_axis=axis if rig.facing == "right" else -axis,
        tilt_sigma=math.radians(camera.tilt_sigma_deg),
        focal_px=camera.focal_px if calibration is None else calibration.focal_px,
    )
    middle = ((size[0] - 1) / 2.0, (size[1] - 1) / 2.0)
    return lens.looking_at(middle if rig.pivot.expected is None else rig.pivot.expected)


def _check_border(lens: Lens, size: tuple[int, int], path: Path) -> None:
    """Raise `RigError` if the distortion folds the picture over itself, so that points there have no unique inverse."""
    across, down = (np.linspace(0.0, side - 1.0, 9) for side in size)
    grid = np.stack(np.meshgrid(across, down), axis=-1)
    returned = lens.distort(lens.rectify(grid))
    folded = np.linalg.det(lens.jacobian(grid)) <= 0.0
    error = np.nan_to_num(np.abs(returned - grid).max(axis=-1), nan=np.inf)
    if folded.any() or (error > _RETURNS_PX).any():
        x, y = grid[np.unravel_index(np.argmax(np.where(folded, np.inf, error)), error.shape)]
        raise RigError(f"{path}: its distortion cannot be inverted at pixel {x:.0f},{y:.0f} of the picture")


def _deviate(calibration: Calibration) -> list[Calibration]:
    """Return the calibration shifted by one standard deviation along each principal axis of its correlation matrix."""
    covariance = np.asarray(calibration.covariance)
    sigma = np.sqrt(np.diag(covariance))
    stated = np.flatnonzero(sigma > 0.0)
    values, axes = np.linalg.eigh(covariance[np.ix_(stated, stated)] / np.outer(sigma[stated], sigma[stated]))
    found = []
    for value, axis in zip(values, axes.T, strict=True):
        if value <= 1e-12:
            continue
        step = np.zeros(len(sigma))
        step[stated] = math.sqrt(value) * axis * sigma[stated]
        matrix = calibration.camera_matrix.copy()
        matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += step[:4]
        found.append(
            dataclasses.replace(calibration, camera_matrix=matrix, distortion=calibration.distortion + step[4:])
        )
    return found


def _map(homography: Floats, points: Floats) -> Floats:
    mapped = points @ homography[:2, :2].T + homography[:2, 2]
    return np.asarray(mapped / (points @ homography[2, :2] + homography[2, 2])[..., None])
