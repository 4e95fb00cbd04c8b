"""Measure the angle in every frame from two points that another program has tracked.

Zero, sign, bounds and the propagation of errors are those of `anglecam.measurement.angles`. Only the positions and the
estimate of their errors are specific to tracks.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.lens import lens_from_rig
from anglecam.camera.shutter import measurement_time, rig_as_shown
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
from anglecam.measurement.trust import why_few
from anglecam.video.film import Film
from anglecam.video.film_rows import ends_before, why_short
from anglecam.vision.pivot.estimate import PivotEstimate

_SHORTEST_PX = 1.0
"""A shorter lever has no meaningful direction."""
_LEAST_FRAMES = 3
_LEAST_TRIPLES = 10
"""Fewest second differences from which a scatter is estimated."""
_FAR = 4.0
"""Standard deviations beyond which a frame's distance from the pivot counts as its error."""


@dataclass(frozen=True)
class MeasuredTracks:
    """The result of measuring tracks of points."""

    series: AngleSeries
    angles: Angles
    """The measured frames, and the contributions to their uncertainty."""
    by: str
    """Object that the angles were measured on."""
    notes: tuple[str, ...]
    """Messages to the user, a line each."""
    truncated: str | None = None
    """How many frames there are, where they end before the last that is wanted."""
    few: str | None = None
    """Message where less than the required share of the frames is measured."""

    @property
    def pivot(self) -> str:
        """Source of the pivot's position."""
        return self.angles.pivot.source

    @property
    def doubt(self) -> str | None:
        """Why the tracks as a whole are no success although frames of them are measured; ``None`` where they are."""
        return self.truncated or self.few

    @property
    def contours_px(self) -> tuple[None, ...]:
        """One ``None`` a frame: points have no outline."""
        return (None,) * len(self.series.time)


@dataclass(frozen=True)
class _Points:
    """Mark and pivot in every frame of the film."""

    mark_px: Floats
    """(frames, 2) NaN where missing."""
    pivot_px: Floats
    """(frames, 2)."""
    time: Floats
    """(frames,) s."""
    size: tuple[int, int] | None
    """Width and height of the picture, px; ``None`` without the film."""
    by: str
    notes: tuple[str, ...]


def measure_tracks(path: Path, rig: Rig, command: Command | None = None, *, film: Film | None = None) -> MeasuredTracks:
    """Measure the angle in every frame from two tracked points.

    Parameters
    ----------
    path : Path
        A file of tracks, in a format of `anglecam.io.tracks`.
    rig : Rig
        Its ``marks`` name the points; facing, neutral, camera and bounds are used as for a clip.
    command : Command, optional
        Its first change ends the rest that defines neutral.
    film : Film, optional
        The clip that the tracks were made from; its frames date the rows.

    Returns
    -------
    MeasuredTracks
        Its series has a row for every frame of the film, without a film of the tracks.

    Raises
    ------
    InputError
        Where the file cannot be used, lacks a point, or nothing dates its frames.
    RigError
        Where the rig does not declare which points are mark and pivot.
    """
    rig = rig if film is None else rig_as_shown(rig, film)
    marks, points = _read_points(path, rig, film)
    mark, pivot, size = points.mark_px, points.pivot_px, points.size
    seen, based = np.isfinite(mark[:, 0]), np.isfinite(pivot[:, 0])
    ok = seen & based
    lens = lens_from_rig(rig, size or (1, 1), path).looking_at(np.median(pivot[ok], axis=0))
    mark_in_plane, pivot_in_plane = lens.rectify(mark), lens.rectify(pivot)
    fixed = _fixed_pivot(pivot_in_plane, ok, marks.pivot)
    arm = mark_in_plane - (pivot_in_plane if fixed is None else fixed.centre_px)
    ok[ok] = np.hypot(*arm[ok].T) >= _SHORTEST_PX
    if ok.sum() < _LEAST_FRAMES:
        raise InputError(f"{path}: {marks.mouth} and {marks.pivot} lie in the same place; there is no angle")
    status = [_cause(*row) for row in zip(ok, seen, based, strict=True)]
    time = points.time if size is None else measurement_time(points.time, mark[:, 1], size[1], rig.camera.row_time_s)
    # a moving pivot carries the mark along; relative to it, the mark rotates about a fixed point
    about = fixed or _moving_pivot(pivot_in_plane[ok], marks.pivot)
    errors = _place_errors(arm[ok], np.flatnonzero(ok), float(np.abs(mark[ok]).max()))
    angles = angles_of_places(arm[ok] + about.centre_px, about, errors, lens, time[ok], rig, command)
    shown, marker = pivot, None
    if fixed is not None:
        x, y = lens.distort(fixed.centre_px)
        shown = np.broadcast_to((x, y), pivot.shape)
        marker = (float(x), float(y)) if lens.calibration is None else None
    evidence = CameraEvidence(picture_px=size, marker_px=marker, from_mark=True)
    series = series_of_angles(recording_name(path), time, status, ok, angles, mark, shown, rig, evidence)
    zero = why_zero_is_elsewhere(rig, command, time[ok])
    notes = (*points.notes, *([zero] if zero else []))
    short = why_short(rig.frames.last, (rig.frames.first or 0) + len(time))
    return MeasuredTracks(series, angles, points.by, notes, short, why_few(series.status, rig.least_measured))


def _read_points(path: Path, rig: Rig, film: Film | None) -> tuple[RigKeypoints, _Points]:
    """Read the two points that the rig names, for every frame of the film."""
    tracks, marks = read_tracks(path), rig.marks
    if marks is None:
        known = ", ".join(tracks.keypoints)
        raise RigError(
            f"{path}: declare which of {known} are mark and pivot: marks: {{mouth: …, pivot: …}} in rig.yaml"
        )
    least = tracks.usual_limit if marks.least_likelihood is None else marks.least_likelihood
    pair = choose_pair(tracks, marks.mouth, marks.pivot, least)
    first = rig.frames.first or 0
    wanted = slice(first, None if rig.frames.last is None else rig.frames.last + 1)
    if len(pair.mark_px) <= first:
        raise ends_before(path, first, len(pair.mark_px))
    mark, pivot = pair.mark_px[wanted], pair.pivot_px[wanted]
    rows = len(mark)
    both = int(np.isfinite(mark + pivot).all(axis=1).sum())
    if both < _LEAST_FRAMES:
        raise InputError(
            f"{path}: {marks.mouth} and {marks.pivot} are both present in only {both} of {rows} frames (likelihood at"
            f" least {least:g})"
        )
    notes = [] if pair.followed is None else [pair.followed]
    size = None
    if film is not None:
        size, time = film.size, film.times
        mark, pivot = film.display.square(mark), film.display.square(pivot)
        undecodable = film.undecodable
        if rows > len(time):
            raise InputError(
                f"{path}: {rows} frames, but {film.path.name} has {len(time)}: the tracks were not made from this clip"
            )
        if undecodable:
            notes.append(f"{undecodable} frames of {film.path.name} cannot be decoded; {path.name} may not count them")
    elif marks.rate_hz is None:
        raise InputError(
            f"{path}: its frames have no times: put the clip {recording_name(path)}.… in the same folder, or declare"
            " marks: {rate_hz: …} in rig.yaml"
        )
    elif rig.camera.calibration is not None or rig.camera.row_time_s is not None:
        raise InputError(f"{path}: calibration and row_time_s need the clip in the folder of the tracks, for its size")
    else:
        time = np.arange(first, first + rows) / marks.rate_hz
    missing = ((0, len(time) - rows), (0, 0))
    mark, pivot = (np.pad(places, missing, constant_values=np.nan) for places in (mark, pivot))
    return marks, _Points(mark, pivot, time, size, f"{marks.mouth} ({tracks.software})", tuple(notes))


def _cause(ok: bool, seen: bool, based: bool) -> str:
    if ok:
        return OK
    if not seen:
        return "no_mouth"
    return "ambiguous" if based else "no_pivot"


def _fixed_pivot(pivot_px: Floats, there: Flags, name: str) -> PivotEstimate | None:
    """Return the median of a pivot that moves less than it scatters, ``None`` for one that moves more.

    The slow variation is motion or drift of the tracker; the difference from frame to frame is scatter. The median's
    error is the slow part, which does not average out, and the remaining share of the fast part.
    """
    places, frames = pivot_px[there], np.flatnonzero(there)
    fast = np.array([_fast(axis, frames) for axis in places.T])
    slow2 = np.maximum(np.array([_spread(axis) for axis in places.T]) ** 2 - fast**2, 0.0)
    if (slow2 > fast**2).any():
        return None
    variance = slow2 + np.pi / 2.0 * fast**2 / len(frames)
    return PivotEstimate(np.median(places, axis=0), np.diag(variance), f"{name}, fixed")


def _moving_pivot(pivot_px: Floats, name: str) -> PivotEstimate:
    """Return the median position of a moving pivot; its scatter is part of the lever's in each frame."""
    return PivotEstimate(np.median(pivot_px, axis=0), np.zeros((2, 2)), f"{name}, moving")


def _place_errors(arm_px: Floats, frames: NDArray[np.intp], farthest_px: float) -> PlaceErrors:
    """Estimate the error of the mark's position from its distance to the pivot, which motion does not change.

    All scatter of that distance is error. The part that differs from frame to frame (second differences, divided by √6
    for independent errors) is noise; the rest changes slowly and depends on the pose. Both are assumed to be as large
    along the path as along the lever. Where second differences along the path, to which noise and motion both
    contribute, are smaller still, they are used as the noise.

    This is the uncertainty of the varying part. It does not include a constant offset between a point and the part of
    the body that it stands for: that offset rotates all lines equally and cancels against neutral as long as it rotates
    with the body. Nor does it include errors along the path alone, such as blur in fast motion.

    Parameters
    ----------
    arm_px : ndarray
        (n, 2) from the pivot to the mark, px.
    frames : ndarray
        (n,) numbers of these frames.
    farthest_px : float
        Largest coordinate, px: trackers write single precision, which limits the resolution of a position.

    Returns
    -------
    PlaceErrors
        A frame whose distance is far off has that deviation as its error.
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
    """Estimate a normal distribution's standard deviation from the 5th and the 95th percentile."""
    low, high = np.percentile(values, (5.0, 95.0))
    return float(high - low) / 3.2897


def _fast(values: Floats, frames: NDArray[np.intp]) -> float:
    """Estimate the standard deviation of the part independent from frame to frame, from consecutive frames."""
    neighbours = (frames[2:] - frames[:-2]) == 2
    if neighbours.sum() < _LEAST_TRIPLES:
        return _spread(values)
    bent = (values[2:] - 2.0 * values[1:-1] + values[:-2])[neighbours]
    return _spread(bent) / float(np.sqrt(6.0))
