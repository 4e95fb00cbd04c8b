"""Arrange the angles of the measured frames as a series of all frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.command import Command
from anglecam.data.series import CONTRACT_RADII_PX, OK, AngleSeries
from anglecam.data.typing import Flags, Floats
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles
from anglecam.measurement.bounds import worst_case
from anglecam.measurement.derivatives import with_derivatives
from anglecam.measurement.sigma import scatter_of


def series_of_angles(
    name: str,
    time: Floats,
    status: Sequence[str],
    ok: Flags,
    angles: Angles,
    mark_px: Floats,
    pivot_px: Floats,
    rig: Rig,
    evidence: CameraEvidence,
) -> AngleSeries:
    """Return a series of all the recording's frames, with the measured angles in place.

    Parameters
    ----------
    name : str
        The recording's name.
    time : ndarray
        (frames,) s.
    status : sequence of str
        Of every frame; a frame that is not ``ok`` stays empty, even if it was measured.
    ok : ndarray
        (frames,) the n frames that ``angles`` belong to.
    angles : Angles
        Of these n frames.
    mark_px, pivot_px : ndarray
        (frames, 2) positions in the picture, px.
    rig : Rig
        Declares ``pixel_error_px``, the radii of further bounds besides 6 px and 10 px.
    evidence : CameraEvidence
        What the film shows besides the angle.

    Returns
    -------
    AngleSeries
        A row a frame, with velocity and acceleration.
    """
    measured = np.array([s == OK for s in status])

    def in_all_frames(values: Floats) -> Floats:
        placed = np.full(len(measured), np.nan)
        placed[ok] = values
        return np.where(measured, placed, np.nan)

    lines, levers = in_all_frames(angles.line), in_all_frames(angles.lever_px)
    series = AngleSeries(
        name=name,
        time=time,
        angle=lines - angles.neutral,
        sigma=in_all_frames(angles.sigma),
        sigma_random=in_all_frames(angles.uncertainty.random(scatter_of(time[ok], angles.line))),
        status=tuple(status),
        line=lines,
        mark_px=np.where(measured[:, None], mark_px, np.nan),
        pivot_px=np.where(measured[:, None], pivot_px, np.nan),
        first_frame=rig.frames.first or 0,
        evidence=evidence,
        bounds={r: worst_case(r, levers) for r in {*CONTRACT_RADII_PX, *rig.pixel_error_px}},
    )
    return with_derivatives(series)


def why_zero_is_elsewhere(rig: Rig, command: Command | None, time: Floats) -> str | None:
    """Return a message where zero is not the rest before the first command change, ``None`` where it is.

    ``time`` holds the times of the measured frames, s.
    """
    change = None if command is None or rig.neutral != "auto" else command.first_change()
    if change is None or (time < change).any():
        return None
    return f"zero is the clip's median: no frame before the first command change at {change:.3f} s could be measured"
