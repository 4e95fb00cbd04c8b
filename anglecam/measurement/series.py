"""A recording's angle series from the angles of those of its frames that were measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.command import Command
from anglecam.data.series import CONTRACT_RADII_PX, OK, AngleSeries
from anglecam.data.typing import Flags, Floats
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles
from anglecam.measurement.sigma import worst_case


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
    """Lay the measured frames among all the recording's frames.

    Parameters
    ----------
    name : str
        The recording's.
    time : ndarray
        (frames,) s.
    status : sequence of str
        Of every frame; one that is not ``ok`` stays empty, measured or not.
    ok : ndarray
        (frames,) to which of them ``angles`` belong.
    angles : Angles
        Of those n frames.
    mark_px, pivot_px : ndarray
        (frames, 2) where the picture shows them, px.
    rig : Rig
        Whose ``pixel_error_px`` the bounds are worked out for, besides the contract's.
    evidence : CameraEvidence
        What the film shows besides.

    Returns
    -------
    AngleSeries
        A row a frame.
    """
    told = np.array([s == OK for s in status])

    def among(values: Floats) -> Floats:
        laid = np.full(len(told), np.nan)
        laid[ok] = values
        return np.where(told, laid, np.nan)

    lines, levers = among(angles.line), among(angles.lever_px)
    return AngleSeries(
        name=name,
        time=time,
        angle=lines - angles.neutral,
        sigma=among(angles.sigma),
        status=tuple(status),
        line=lines,
        mark_px=np.where(told[:, None], mark_px, np.nan),
        pivot_px=np.where(told[:, None], pivot_px, np.nan),
        evidence=evidence,
        bounds={r: worst_case(r, levers) for r in {*CONTRACT_RADII_PX, *rig.pixel_error_px}},
    )


def why_zero_is_elsewhere(rig: Rig, command: Command | None, time: Floats) -> str | None:
    """Say in a line that zero is not where it should be, ``None`` where it is; ``time`` (n,) of measured frames, s."""
    change = None if command is None or rig.neutral != "auto" else command.first_change()
    if change is None or (time < change).any():
        return None
    return f"zero is the clip's median: no frame before the first command change at {change:.3f} s could be measured"
