"""From two tracked points to the angle in every frame: other eyes than ours, the same angle.

Zero, direction, bounds and how errors travel are those of `anglecam.measurement.angles`; only the places and what is known of
their errors are made here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.lens import lens_from_rig
from anglecam.camera.shutter import measurement_time
from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.command import Command
from anglecam.data.series import OK, AngleSeries
from anglecam.data.typing import Flags, Floats
from anglecam.errors import InputError, RigError
from anglecam.io.rig import Rig, RigKeypoints
from anglecam.io.session import recording_name
from anglecam.io.tracks.files import read_tracks
from anglecam.io.tracks.tracks import choose_pair
from anglecam.measurement.angles import Angles, angles_of_places
from anglecam.measurement.series import series_of_angles, why_zero_is_elsewhere
from anglecam.measurement.sigma import PlaceErrors
from anglecam.video.film import Film
from anglecam.vision.pivot.estimate import PivotEstimate

_SHORTEST_PX = 1.0
"""A lever shorter than this has no direction worth the name."""
_LEAST_FRAMES = 3
_LEAST_TRIPLES = 10
"""Fewer second differences than this tell no scatter."""
_FAR = 4.0
"""Standard deviations beyond which a frame's own distance from the pivot says how wrong it is."""


@dataclass(frozen=True)
class MeasuredTracks:
    """What tracks of points gave."""

    series: AngleSeries
    angles: Angles
    """The measured frames, and what their uncertainties are made of."""
    by: str
    """What the angles were read off."""
    notes: tuple[str, ...]
    """What the user should know, a line each."""
    truncated: str | None = None
    """What of the film could not be read."""

    @property
    def pivot(self) -> str:
        """Where the pivot's place comes from."""
        return self.angles.pivot.source

    @property
    def contours_px(self) -> tuple[None, ...]:
        """No frame has an outline: points have none."""
        return (None,) * len(self.series.time)


@dataclass(frozen=True)
class _Points:
    """Mouth and pivot in every frame of the film."""

    mark_px: Floats
    """(frames, 2) NaN where missing."""
    pivot_px: Floats
    """(frames, 2)."""
    time: Floats
    """(frames,) s."""
    size: tuple[int, int] | None
    """Of the picture; ``None`` where the film is not there."""
    by: str
    notes: tuple[str, ...]


def measure_tracks(path: Path, rig: Rig, command: Command | None = None, *, film: Film | None = None) -> MeasuredTracks:
    """Measure the nodding angle in every frame from two tracked points.

    Parameters
    ----------
    path : Path
        DeepLabCut's or SLEAP's file.
    rig : Rig
        Whose ``marks`` name the points; facing, neutral, camera and bounds count as for a clip.
    command : Command, optional
        What was commanded; its first change ends the rest that defines neutral.
    film : Film, optional
        The clip that the tracks were made from; its frames date the rows.

    Returns
    -------
    MeasuredTracks
        The series has a row for every frame of the clip beside the tracks, else of the tracks.

    Raises
    ------
    InputError
        Where the file cannot be used, lacks a point, or nothing says when its frames were taken.
    RigError
        Where the rig does not say which points are mouth and pivot.
    """
    marks, points = _read_points(path, rig, film)
    mouth, pivot, size = points.mark_px, points.pivot_px, points.size
    seen, based = np.isfinite(mouth[:, 0]), np.isfinite(pivot[:, 0])
    ok = seen & based
    lens = lens_from_rig(rig, size or (1, 1), path).looking_at(np.median(pivot[ok], axis=0))
    mouth_in_plane, pivot_in_plane = lens.rectify(mouth), lens.rectify(pivot)
    fixed = _fixed_pivot(pivot_in_plane, ok, marks.pivot)
    arm = mouth_in_plane - (pivot_in_plane if fixed is None else fixed.centre_px)
    ok[ok] = np.hypot(*arm[ok].T) >= _SHORTEST_PX
    if ok.sum() < _LEAST_FRAMES:
        raise InputError(f"{path}: {marks.mouth} and {marks.pivot} lie in the same place; there is no angle")
    status = [_cause(*row) for row in zip(ok, seen, based, strict=True)]
    time = points.time if size is None else measurement_time(points.time, mouth[:, 1], size[1], rig.camera.row_time_s)
    # A pivot that moves carries the mouth along: as seen from it, the mouth turns about one place.
    about = fixed or _moving_pivot(pivot_in_plane[ok], marks.pivot)
    errors = _place_errors(arm[ok], np.flatnonzero(ok), float(np.abs(mouth[ok]).max()))
    angles = angles_of_places(arm[ok] + about.centre_px, about, errors, lens, time[ok], rig, command)
    shown, marker = pivot, None
    if fixed is not None:
        x, y = lens.distort(fixed.centre_px)
        shown = np.broadcast_to((x, y), pivot.shape)
        marker = (float(x), float(y)) if lens.calibration is None else None
    evidence = CameraEvidence(picture_px=size, marker_px=marker, from_mark=True)
    series = series_of_angles(recording_name(path), time, status, ok, angles, mouth, shown, rig, evidence)
    zero = why_zero_is_elsewhere(rig, command, time[ok])
    return MeasuredTracks(series, angles, points.by, (*points.notes, *([zero] if zero else [])))


def _read_points(path: Path, rig: Rig, film: Film | None) -> tuple[RigKeypoints, _Points]:
    """Read the two points that the rig names, in as many frames as the film has."""
    tracks, marks = read_tracks(path), rig.marks
    if marks is None:
        known = ", ".join(tracks.keypoints)
        raise RigError(f"{path}: which of {known} is which? marks: {{mouth: …, pivot: …}} in rig.yaml says it")
    least = tracks.usual_limit if marks.least_likelihood is None else marks.least_likelihood
    pair = choose_pair(tracks, marks.mouth, marks.pivot, least)
    rows = len(pair.mark_px)
    both = int(np.isfinite(pair.mark_px + pair.pivot_px).all(axis=1).sum())
    if both < _LEAST_FRAMES:
        raise InputError(
            f"{path}: {marks.mouth} and {marks.pivot} are both there in {both} of {rows} frames only (likelihood at"
            f" least {least:g})"
        )
    notes = [] if pair.followed is None else [pair.followed]
    size = None
    if film is not None:
        size, time = film.size, film.times
        undecodable = film.undecodable
        if rows > len(time):
            raise InputError(
                f"{path}: {rows} frames, but {film.path.name} has {len(time)}: it was not made from this clip"
            )
        if undecodable:
            notes.append(f"{undecodable} frames of {film.path.name} cannot be decoded; {path.name} may count past them")
    elif marks.rate_hz is None:
        raise InputError(
            f"{path}: nothing says when its frames were taken: put the clip {recording_name(path)}.… beside it, or"
            " marks: {rate_hz: …} in rig.yaml"
        )
    elif rig.camera.calibration is not None or rig.camera.row_time_s is not None:
        raise InputError(f"{path}: calibration and row_time_s need the clip beside the tracks; its size is not known")
    else:
        time = np.arange(rows) / marks.rate_hz
    missing = ((0, len(time) - rows), (0, 0))
    mouth, pivot = (np.pad(places, missing, constant_values=np.nan) for places in (pair.mark_px, pair.pivot_px))
    return marks, _Points(mouth, pivot, time, size, f"{marks.mouth} ({tracks.software})", tuple(notes))


def _cause(ok: bool, seen: bool, based: bool) -> str:
    if ok:
        return OK
    if not seen:
        return "no_mouth"
    return "ambiguous" if based else "no_pivot"


def _fixed_pivot(pivot_px: Floats, there: Flags, name: str) -> PivotEstimate | None:
    """Return the median of a pivot that moves less than it scatters, ``None`` of one that moves more.

    What varies slowly is motion, or the tracker's own wandering; what differs from frame to frame is scatter. The
    median errs by the slow part, which no number of frames averages out, and by the share of the fast part that is
    left over.
    """
    places, frames = pivot_px[there], np.flatnonzero(there)
    fast = np.array([_fast(axis, frames) for axis in places.T])
    slow2 = np.maximum(np.array([_spread(axis) for axis in places.T]) ** 2 - fast**2, 0.0)
    if (slow2 > fast**2).any():
        return None
    variance = slow2 + np.pi / 2.0 * fast**2 / len(frames)
    return PivotEstimate(np.median(places, axis=0), np.diag(variance), f"{name}, fixed")


def _moving_pivot(pivot_px: Floats, name: str) -> PivotEstimate:
    """Return the middle of a moving pivot's places; its scatter is in the lever's, frame by frame."""
    return PivotEstimate(np.median(pivot_px, axis=0), np.zeros((2, 2)), f"{name}, moving")


def _place_errors(arm_px: Floats, frames: NDArray[np.intp], farthest_px: float) -> PlaceErrors:
    """Tell how well the mouth is placed, from what cannot be motion.

    No motion alters the distance from pivot to mouth: all of its scatter is error. The part of it that differs from
    frame to frame (second differences, ÷√6 for independent errors) is noise; the rest changes slowly and goes with
    the pose. Both are taken to be as large along the path as they are along the lever. Where second differences along
    the path, in which noise and motion add up, are smaller still, these are the noise.

    It is an uncertainty of what varies. It knows nothing of a constant offset between a point and the part of the body
    that it is meant to be, which turns all lines alike and cancels against neutral as long as the offset turns along;
    nor of errors along the path alone, such as blur in fast motion.

    Parameters
    ----------
    arm_px : ndarray
        (n, 2) from the pivot to the mouth, px.
    frames : ndarray
        (n,) numbers of those frames.
    farthest_px : float
        Largest coordinate: trackers write single precision, and no place is known better than that.

    Returns
    -------
    PlaceErrors
        A frame whose distance is far off is as wrong as that.
    """
    lever = np.hypot(*arm_px.T)
    out = lever - np.median(lever)
    direction = np.unwrap(np.arctan2(arm_px[:, 1], arm_px[:, 0]))
    least = float(np.spacing(np.float32(farthest_px))) / np.sqrt(12.0)
    across, total = _fast(out, frames), _spread(out)
    slow = float(np.sqrt(max(total**2 - across**2, 0.0)))
    noise = max(min(across, _fast(direction * float(np.median(lever)), frames)), least)
    far = np.where(np.abs(out) > _FAR * np.hypot(noise, slow), np.abs(out), 0.0)
    return PlaceErrors(np.hypot(noise, far), slow)


def _spread(values: Floats) -> float:
    """Return half the way from the 5th to the 95th percentile as the standard deviation of a normal distribution."""
    low, high = np.percentile(values, (5.0, 95.0))
    return float(high - low) / 3.2897


def _fast(values: Floats, frames: NDArray[np.intp]) -> float:
    """Return the standard deviation of what is independent from frame to frame, by frames that follow each other."""
    neighbours = (frames[2:] - frames[:-2]) == 2
    if neighbours.sum() < _LEAST_TRIPLES:
        return _spread(values)
    bent = (values[2:] - 2.0 * values[1:-1] + values[:-2])[neighbours]
    return _spread(bent) / float(np.sqrt(6.0))
