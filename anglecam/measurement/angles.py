"""From positions in the picture to angles: the line from pivot to mark, its zero, and their uncertainty.

The definition of the angle, of its sign and of its zero is here, for marks that anglecam finds and for tracks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.lens import Lens
from anglecam.camera.shutter import mean_off_middle
from anglecam.camera.tilt import Tilt
from anglecam.data.command import Command
from anglecam.data.typing import Flags, Floats
from anglecam.io.rig import Rig
from anglecam.measurement.detections import Detections
from anglecam.measurement.registration_pass import Registered
from anglecam.measurement.rigid_motion import RigidMotion
from anglecam.measurement.sigma import PlaceErrors, Sigma, angle_sigma, place_errors, sigma_by_pivot
from anglecam.vision.image.transforms import rotate_each
from anglecam.vision.pivot.estimate import PivotEstimate

_THICK = 0.25
"""Standard deviation of the height of a mark's visible part, as a share of the root of its area."""
_LEAST_ARM_PX = 1e-3
"""Least distance of a body's middle from its pivot that counts, px."""


@dataclass(frozen=True)
class ViewErrors:
    """Contribution of lens and tilt to the angles' uncertainty; arrays of length n, standard uncertainties, rad."""

    lens: Floats
    """Due to the calibration."""
    tilt: Tilt | None
    by_tilt: Floats
    """Due to the declared tilt."""

    @property
    def sigma(self) -> Floats:
        """Combined standard uncertainty, rad."""
        return np.asarray(np.hypot(self.lens, self.by_tilt))


@dataclass(frozen=True)
class Angles:
    """The frames in which the mark was found; arrays of length n."""

    line: Floats
    """Direction from pivot to mark from the picture's horizontal, upward positive for either facing, rad."""
    uncertainty: Sigma
    """Of ``line`` minus ``neutral``."""
    mark_px: Floats
    """(n, 2) mark, px."""
    pivot: PivotEstimate
    neutral: float
    """Direction that counts as zero, rad."""
    resting: NDArray[np.bool_] | None
    """Frames whose mean is neutral; ``None`` where neutral is declared."""
    errors: PlaceErrors
    """Of the mark's centroid."""
    view: ViewErrors
    """Contribution of lens and tilt."""
    within_exposure: Floats
    """Standard uncertainty due to acceleration within the exposure, and to a long blur, rad."""
    registered: Registered | None = None
    """Source of the fine angles; ``None`` for coarse angles."""
    shared: float = 0.0
    """Standard uncertainty of neutral that all fine angles share, without the pivot's contribution, rad."""

    @property
    def sigma(self) -> Floats:
        """(n,) standard uncertainty of ``line`` minus ``neutral``, rad."""
        return self.uncertainty.total

    @property
    def lever_px(self) -> Floats:
        """(n,) distance from pivot to mark, px."""
        return np.asarray(np.hypot(*(self.mark_px - self.pivot.centre_px).T))

    def frame_noise(self, ok: NDArray[np.bool_]) -> Floats:
        """Return (n,) standard deviation of what differs between neighbouring frames, rad; ``ok`` are the n frames."""
        by_mark = np.hypot(self.errors.noise_px, self.errors.pose_px) / self.lever_px
        if self.registered is None:
            return np.asarray(by_mark)
        by_body = self.registered.sigma[ok]
        return np.where(np.isfinite(by_body), by_body, by_mark)


def coarse_angles(
    detections: Detections, ok: NDArray[np.bool_], time: Floats, rig: Rig, command: Command | None
) -> Angles:
    """Return the angles of the mark's centroid.

    Parameters
    ----------
    detections : Detections
        Mark and pivot.
    ok : ndarray
        (frames,) the n frames to use.
    time : ndarray
        (frames,) time at which the mark was at the measured position, s.
    rig : Rig
        Facing and neutral.
    command : Command, optional
        Its first change ends the rest that defines neutral.

    Returns
    -------
    Angles
        Without registration.
    """
    if detections.body is not None:
        return _angles_of_body(detections, detections.body, ok, time, rig, command)
    regions = [r for r, counts in zip(detections.regions, ok, strict=True) if counts and r is not None]
    mark, circle = np.array([r.centre_px for r in regions]), detections.circle
    arm = mark - detections.pivot.centre_px
    lever = np.hypot(*arm.T)
    off = lever - np.median(lever) if circle is None else np.hypot(*(mark - circle.centre_px).T) - circle.radius_px
    out = arm / lever[:, None]
    noise = detections.noise**2 * np.array([r.noise_px2 for r in regions])
    across, along = (
        np.sqrt(np.einsum("ni,nij,nj->n", v, noise, v)) for v in (out, np.column_stack([-out[:, 1], out[:, 0]]))
    )
    errors = place_errors(mark, off, across, along)
    # the distance from the pivot does not show an error of the camera's roll
    errors = replace(errors, noise_px=np.hypot(errors.noise_px, lever * detections.turn_sigma[ok]))
    # of a mark seen obliquely, other parts become visible as it rotates, and they lie at other heights
    thick = _THICK * float(np.median(np.sqrt([r.area_px2 for r in regions])))
    return angles_of_places(mark, detections.pivot, errors, detections.lens, time[ok], rig, command, thick_px=thick)


def angles_of_places(
    mark_px: Floats,
    pivot: PivotEstimate,
    errors: PlaceErrors,
    lens: Lens,
    time: Floats,
    rig: Rig,
    command: Command | None,
    *,
    thick_px: float = 0.0,
) -> Angles:
    """Return the angles of the line from the pivot to the mark.

    Parameters
    ----------
    mark_px : ndarray
        (n, 2) positions in the plane of motion, px.
    pivot : Pivot
        In the plane of motion.
    errors : PlaceErrors
        Of those positions.
    lens : Lens
        Between the picture and the plane of motion.
    time : ndarray
        (n,) s.
    rig : Rig
        Facing, neutral and exposure.
    command : Command, optional
        Its first change ends the rest that defines neutral.
    thick_px : float
        Standard deviation of the height of the mark's visible part, px.

    Returns
    -------
    Angles
        Without registration.
    """
    arm = mark_px - pivot.centre_px
    # y points down in the image; facing left is mirrored, so that an upward motion is positive
    line = np.unwrap(np.arctan2(-arm[:, 1], _ahead(arm[:, 0], rig)))
    line -= 2.0 * np.pi * np.round(np.median(line) / (2.0 * np.pi))
    lever = np.hypot(*arm.T)
    neutral, resting = neutral_of(rig, command, time, line, lever)
    view = _view_errors(lens, mark_px, pivot.centre_px, line, neutral, resting, rig)
    aside = thick_px * np.hypot(*lens.parallax) * (line - neutral) / lever
    known = angle_sigma(mark_px, pivot.centre_px, pivot.covariance_px2, errors, resting)
    unsteady = mean_off_middle(time, line, rig.camera.exposure_s)
    sigma = known.with_sources(pose=(unsteady,), common=(view.sigma, aside))
    return Angles(line, sigma, mark_px, pivot, neutral, resting, errors, view, unsteady)


def _angles_of_body(
    detections: Detections, body: RigidMotion, ok: Flags, time: Floats, rig: Rig, command: Command | None
) -> Angles:
    """Return the angles of the line from the pivot through the middle of the rigid body.

    The body reaches beyond a middle that is near the pivot, as a wheel's is: the line then ends where the body does.
    """
    turn, noise = body.turn[ok], np.hypot(body.sigma[ok], detections.turn_sigma[ok])
    arm = detections.lens.rectify(body.centre_px) - detections.pivot.centre_px
    arm *= max(1.0, body.extent_px / max(float(np.hypot(*arm)), _LEAST_ARM_PX))
    mark = detections.pivot.centre_px + rotate_each(arm, turn)
    signed = turn if rig.facing == "right" else -turn
    line = float(np.arctan2(-arm[1], _ahead(arm[:1], rig)[0])) + signed
    lever = np.full(len(turn), float(np.hypot(*arm)))
    neutral, resting = neutral_of(rig, command, time[ok], line, lever)
    errors = PlaceErrors(noise * lever, 0.0)
    view = _view_errors(detections.lens, mark, detections.pivot.centre_px, line, neutral, resting, rig)
    known = angle_sigma(mark, detections.pivot.centre_px, np.zeros((2, 2)), errors, resting)
    by_pivot = sigma_by_pivot(body.pivot_sensitivity[ok], body.pivot_covariance_px2, resting)
    unsteady = mean_off_middle(time[ok], line, rig.camera.exposure_s)
    sigma = known.with_sources(pose=(unsteady,), common=(by_pivot, view.sigma))
    return Angles(line, sigma, mark, detections.pivot, neutral, resting, errors, view, unsteady)


def turns(angles: Angles, rig: Rig) -> Floats:
    """Return (n,) rotation of the body from the median line, counter-clockwise as seen, rad."""
    turn = angles.line - np.median(angles.line)
    return turn if rig.facing == "right" else -turn


def _view_errors(
    lens: Lens, mark: Floats, pivot: Floats, line: Floats, neutral: float, resting: Flags | None, rig: Rig
) -> ViewErrors:
    """Propagate one standard deviation of each lens parameter to the angles."""
    zero = slice(None) if resting is None and rig.neutral == "auto" else resting
    variance = np.zeros(len(line))
    filmed, filmed_pivot = lens.distort(mark), lens.distort(pivot)
    for deviant in lens.deviants():
        if deviant.tilt != lens.tilt:
            continue
        arm = deviant.rectify(filmed) - deviant.rectify(filmed_pivot)
        off = (np.arctan2(-arm[:, 1], _ahead(arm[:, 0], rig)) - line + np.pi) % (2.0 * np.pi) - np.pi
        variance += (off - (0.0 if zero is None else off[zero].mean())) ** 2
    if lens.tilt_sigma == 0.0:
        return ViewErrors(np.sqrt(variance), None, np.zeros(len(line)))
    tilt = Tilt(lens.tilt, np.radians(rig.camera.tilt_axis_deg), lens.tilt_sigma)
    off = tilt.turned(line, tilt.sigma) - line
    if rig.neutral == "auto":
        off = off - (tilt.turned(np.array([neutral]), tilt.sigma) - neutral)
    return ViewErrors(np.sqrt(variance), tilt, np.abs(off))


def _ahead(x: Floats, rig: Rig) -> Floats:
    return x if rig.facing == "right" else -x


def neutral_of(
    rig: Rig, command: Command | None, time: Floats, line: Floats, lever: Floats
) -> tuple[float, NDArray[np.bool_] | None]:
    """Return the direction that counts as zero, rad, and the frames it is the mean of; ``None`` where it is declared.

    The median's uncertainty is that of the frames within half a pixel of it.
    """
    if rig.neutral != "auto":
        return float(np.radians(rig.neutral)), None
    change = None if command is None else command.first_change()
    if change is not None and (time < change).any():
        resting = time < change
        return float(line[resting].mean()), resting
    middle = float(np.median(line))
    away = np.abs(line - middle) * lever
    return middle, away <= max(0.5, float(away.min()))
