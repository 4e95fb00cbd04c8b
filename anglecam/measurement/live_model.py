"""What the first frames of a film show, by which the angle in each further frame is measured at once.

The first frames are measured as a clip (`anglecam.measurement.clip`). This finds the mark, the pivot and the body, and
refuses what is not a rotation. The angle in another frame is that of the whole body, where the body could be learnt and
only among the angles at which it was learnt: light and perspective change with the angle. A body that fits worse than
in the first frames is covered, or was sought at a wrong angle. Otherwise the angle is that of the line from the pivot
to the mark. Its uncertainty has the terms of `anglecam.measurement.fine_angles` and `anglecam.measurement.angles`.
Their part that all frames share is that of the first frames.
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
from anglecam.measurement.carried_marks import UncoveredBody, uncovered_body
from anglecam.measurement.clip import Measurement
from anglecam.measurement.mark_path import MarkPath
from anglecam.measurement.sigma import angle_sigma
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.segment import Region
from anglecam.vision.pivot.estimate import PivotEstimate
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
class MarkTerms:
    """From the mark's place to the uncertainty of its line, see `anglecam.measurement.sigma.angle_sigma`."""

    place_px: float
    """Standard deviation of the place along the path, relative to the places in neutral, px."""
    along: Floats
    """(2,) mean unit vector along the path in neutral; zero where neutral is declared."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    others: float
    """Standard uncertainty by view and exposure, rad."""

    def sigma(self, arm_px: Floats) -> float:
        """Return the standard uncertainty of the line along an arm (2,), rad."""
        lever = float(np.hypot(*arm_px))
        along = np.array([-arm_px[1], arm_px[0]]) / lever - self.along
        by_place = (self.place_px**2 + float(along @ self.pivot_covariance_px2 @ along)) / lever**2
        return float(np.sqrt(by_place + self.others**2))


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
    uncovered: UncoveredBody
    """How the body looks where nothing covers it."""


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
    mark: MarkTerms
    body: BodyAhead | None
    """The body; ``None`` where the mark alone is measured."""
    terms: BodyTerms | None
    """Of the body."""

    def mark_in(self, regions: Sequence[Region]) -> Region | str:
        """Return the only region of a frame that may be the whole mark, or the status where there is none."""
        marks = self.path.marks(regions)
        if len(marks) != 1:
            return "ambiguous" if marks else "no_mouth"
        least, most = _WHOLE_AREA
        whole = marks[0].whole and least < marks[0].area_px2 / self.path.area_px2 < most
        return marks[0] if whole else "occluded"

    def angle(self, mark: Region | str, turn: TurnEstimate) -> LiveAngle:
        """Return the angle in a frame.

        Parameters
        ----------
        mark : Region or str
            By `mark_in`.
        turn : TurnEstimate
            The body's rotation.

        Returns
        -------
        LiveAngle
            By the body where all of it is seen, otherwise by the mark, otherwise with the status of
            `anglecam.data.series`.
        """
        terms = self.terms
        if terms is not None and self.shows(turn):
            moved = turn.pivot_sensitivity - terms.sensitivity
            by_pivot = float(moved @ terms.pivot_covariance_px2 @ moved)
            sigma = float(np.sqrt(turn.noise**2 + turn.pose**2 + terms.shared**2 + by_pivot))
            return LiveAngle(OK, terms.zero + self.sign * turn.turn, sigma)
        if isinstance(mark, str):
            return LiveAngle(mark)
        ahead = 0.0 if self.sign > 0.0 else np.pi
        line = ahead + self.sign * self.path.direction(mark, self.pivot_px)
        return LiveAngle(OK, line, self.mark.sigma(self.path.lens.rectify(mark.centre_px) - self.pivot_px))

    def shows(self, turn: TurnEstimate) -> bool:
        """Return whether a rotation is that of the uncovered body, and among those at which it was learnt."""
        terms = self.terms
        if terms is None or not terms.turns[0] <= turn.turn <= terms.turns[1]:
            return False
        return bool(terms.uncovered.is_seen(turn.misfit, turn.clear))


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
    ).total
    body, terms = _body(first, path, rig), None
    if body is not None:
        terms = _body_terms(angles, first, rig, coarse)
    return LiveModel(
        found=detections.found,
        path=path,
        pivot_px=detections.pivot.centre_px,
        neutral=angles.neutral,
        sign=1.0 if rig.facing == "right" else -1.0,
        mark=_mark_terms(angles, detections.pivot, coarse),
        body=None if terms is None else body,
        terms=terms,
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


def _mark_terms(angles: Angles, pivot: PivotEstimate, coarse: Floats) -> MarkTerms:
    """Return the terms of the mark's uncertainty, of which ``coarse`` (n,) rad is the result in each first frame."""
    arm = angles.mark_px - pivot.centre_px
    lever = np.hypot(*arm.T)
    along = np.column_stack([-arm[:, 1], arm[:, 0]]) / lever[:, None]
    in_neutral = np.zeros(2) if angles.resting is None else along[angles.resting].mean(axis=0)
    by_pivot = np.einsum("ni,ij,nj->n", along - in_neutral, pivot.covariance_px2, along - in_neutral)
    return MarkTerms(
        place_px=float(np.sqrt(np.mean((coarse * lever) ** 2 - by_pivot))),
        along=in_neutral,
        pivot_covariance_px2=pivot.covariance_px2,
        others=float(np.sqrt(np.mean(angles.view.sigma**2 + angles.within_exposure**2))),
    )


def _body_terms(angles: Angles, first: Measurement, rig: Rig, coarse: Floats) -> BodyTerms | None:
    """Return the terms that the first frames determine; see `anglecam.measurement.fine_angles.fine_angles`.

    There are none where no part of the body is at the mark: the mark could then be covered unnoticed.
    """
    registered = angles.registered
    assert registered is not None
    uncovered = uncovered_body(first.detections, first.ok, registered)
    if uncovered is None:
        return None
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
        uncovered=uncovered,
    )
