"""What the first frames of a film show, by which the angle in each further frame is measured at once.

The first frames are measured as a clip (`anglecam.measurement.clip`). This finds the mark, the pivot and the body, and
refuses what is not a rotation. The angle in another frame is that of the whole body, where the body could be learnt and
only among the angles at which it was learnt: light and perspective change with the angle. Otherwise it is that of the
line from the pivot to the mark. Its uncertainty has the terms of `anglecam.measurement.fine_angles` and
`anglecam.measurement.angles`. Their part that all frames share is that of the first frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.series import OK
from anglecam.data.typing import Floats
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles
from anglecam.measurement.body_ahead import LESS_THAN_A_TURN, BodyAhead
from anglecam.measurement.clip import Measurement
from anglecam.measurement.mark_path import MarkPath
from anglecam.measurement.sigma import angle_sigma
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.segment import Region
from anglecam.vision.registration.turn import TurnEstimate

_WHOLE_AREA = (0.7, 1.4)
"""Limits of a mark's area, relative to its usual one, beyond which a part of it is hidden."""


@dataclass(frozen=True)
class LiveAngle:
    """The angle in a frame."""

    status: str
    line: float = np.nan
    """Direction from pivot to mark from the picture's horizontal, upward positive for either facing, rad."""
    sigma: float = np.nan
    """Standard uncertainty of ``line`` minus neutral, rad."""


@dataclass(frozen=True)
class BodyTerms:
    """From the rotation of the body to the angle, and to its uncertainty."""

    zero: float
    """Direction of the line at which the rotation is zero, rad."""
    turns: tuple[float, float]
    """Least and largest rotation at which the body was learnt, rad."""
    sensitivity: Floats
    """(2,) derivative of neutral with respect to the pivot's position, rad/px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    shared: float
    """Standard uncertainty that all frames share, without the pivot's contribution, rad."""


@dataclass(frozen=True)
class LiveModel:
    """What the first frames show."""

    found: FoundMark
    path: MarkPath
    pivot_px: Floats
    """(2,) in the plane of motion."""
    neutral: float
    """Direction that counts as zero, rad."""
    sign: float
    """1 for a rig that faces right, -1 for one that faces left."""
    mark_sigma: float
    """Standard uncertainty of an angle by the mark alone, rad."""
    body: BodyAhead | None
    """The body; ``None`` where the mark alone is measured."""
    terms: BodyTerms | None
    """Of the body."""

    def angle(self, regions: Sequence[Region], turn: TurnEstimate) -> LiveAngle:
        """Return the angle in a frame.

        Parameters
        ----------
        regions : sequence of Region
            Regions of the mark's colour in the frame.
        turn : TurnEstimate
            The body's rotation, begun at the mark.

        Returns
        -------
        LiveAngle
            With the status of `anglecam.data.series`.
        """
        marks = self.path.marks(regions)
        if len(marks) != 1:
            return LiveAngle("ambiguous" if marks else "no_mouth")
        terms = self.terms
        if terms is None or not terms.turns[0] <= turn.turn <= terms.turns[1]:
            return self._by_mark(marks[0])
        moved = turn.pivot_sensitivity - terms.sensitivity
        by_pivot = float(moved @ terms.pivot_covariance_px2 @ moved)
        sigma = float(np.sqrt(turn.noise**2 + turn.pose**2 + terms.shared**2 + by_pivot))
        return LiveAngle(OK, terms.zero + self.sign * turn.turn, sigma)

    def _by_mark(self, mark: Region) -> LiveAngle:
        """Return the angle of the line from the pivot to the mark."""
        least, most = _WHOLE_AREA
        if not (mark.whole and least < mark.area_px2 / self.path.area_px2 < most):
            return LiveAngle("occluded")
        ahead = 0.0 if self.sign > 0.0 else np.pi
        return LiveAngle(OK, ahead + self.sign * self.path.direction(mark, self.pivot_px), self.mark_sigma)


def live_model(first: Measurement, rig: Rig) -> LiveModel | str:
    """Return the model by which further frames are measured.

    Parameters
    ----------
    first : Measurement
        Of the first frames.
    rig : Rig
        What is declared.

    Returns
    -------
    LiveModel or str
        The cause, in a few words, where further frames cannot be measured at once.
    """
    detections, angles = first.detections, first.angles
    if first.doubt is not None:
        return first.doubt
    if detections.found is None or detections.circle is None:
        return "only a mark that moves is measured at once"
    if detections.camera_moves is not None:
        return "the camera moves"
    marks = [r for r, s in zip(detections.regions, detections.status, strict=True) if r is not None and s == OK]
    area = float(np.median([mark.area_px2 for mark in marks]))
    # positions are in the plane of motion already
    path = MarkPath(detections.circle.centre_px, detections.circle.radius_px, area, detections.lens)
    coarse = angle_sigma(
        angles.mark_px, detections.pivot.centre_px, detections.pivot.covariance_px2, angles.errors, angles.resting
    )
    body = _body(first, path, rig)
    return LiveModel(
        found=detections.found,
        path=path,
        pivot_px=detections.pivot.centre_px,
        neutral=angles.neutral,
        sign=1.0 if rig.facing == "right" else -1.0,
        mark_sigma=float(np.sqrt(np.mean(coarse**2 + angles.view.sigma**2 + angles.within_exposure**2))),
        body=body,
        terms=None if body is None else _terms(angles, first, rig, coarse),
    )


def _body(first: Measurement, path: MarkPath, rig: Rig) -> BodyAhead | None:
    """Return the body where its rotation in a frame depends on that frame alone."""
    detections, registered = first.detections, first.angles.registered
    if registered is None or rig.camera.row_time_s is not None or detections.lens.tilt != 0.0:
        return None
    turns = registered.turn[np.isfinite(registered.turn)]
    if np.ptp(turns) > LESS_THAN_A_TURN:
        return None
    arm = detections.places_px - detections.pivot.centre_px
    apart = np.arctan2(-arm[:, 1], arm[:, 0]) - registered.turn
    zero = float(np.angle(np.nanmean(np.exp(1j * apart))))
    return BodyAhead(
        appearance=registered.appearance,
        pivot=detections.pivot,
        path=path,
        middle=float(turns.min() + turns.max()) / 2.0,
        poses=len(turns),
        zero=zero,
    )


def _terms(angles: Angles, first: Measurement, rig: Rig, coarse: Floats) -> BodyTerms:
    """Return the terms that the first frames determine; see `anglecam.measurement.fine_angles.fine_angles`."""
    registered = angles.registered
    assert registered is not None
    turn, sensitivity = registered.turn[first.ok], registered.pivot_sensitivity[first.ok]
    seen = np.isfinite(turn)
    sign = 1.0 if rig.facing == "right" else -1.0
    used = seen if angles.resting is None or not (angles.resting & seen).any() else angles.resting & seen
    others = angles.view.sigma**2 + angles.within_exposure**2
    shared = angles.shared**2 + float(others[seen].mean())
    if angles.resting is None:
        shared += float(np.median(coarse[seen])) ** 2  # a declared neutral is an absolute direction
    return BodyTerms(
        turns=(float(turn[seen].min()), float(turn[seen].max())),
        zero=float(np.median(angles.line[seen] - sign * turn[seen])),
        sensitivity=sensitivity[used].mean(axis=0),
        pivot_covariance_px2=registered.pivot_covariance_px2,
        shared=float(np.sqrt(shared)),
    )
