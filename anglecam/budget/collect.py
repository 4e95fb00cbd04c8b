"""From a measured clip to what errs in it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from anglecam.budget.terms import ErrorSources, Neutral
from anglecam.data.series import OK
from anglecam.data.typing import Flags, Floats
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles
from anglecam.measurement.clip import Measurement
from anglecam.measurement.registration_pass import Registered

_MARKER_DOF = 10.0
"""Of a marker's covariance: twelve sectors of its edge less two coordinates."""
_MAD_EFFICIENCY = 0.37
"""Of a median absolute deviation as an estimate of a normal spread."""
_FEWEST_REPEATS = 20
"""Below, noise is taken from the pixels (`anglecam.measurement.sigma.place_errors`)."""


def error_sources(measured: Measurement, rig: Rig) -> ErrorSources:
    """Gather from a measured clip what errs in it.

    Parameters
    ----------
    measured : Measurement
        Of the clip.
    rig : Rig
        That it was measured with.

    Returns
    -------
    ErrorSources
        Such that its terms give the series' sigma, frame by frame.
    """
    series, angles = measured.series, measured.angles
    # A duplicate was measured, and has its part in neutral, before it was found out.
    rows = np.array([i for i, status in enumerate(series.status) if status in (OK, "duplicate")])
    kept = series.ok[rows]
    mirrored = rig.facing == "left"
    _, pose, count = np.unique(np.round(angles.mark_px), axis=0, return_inverse=True, return_counts=True)
    several, poses = count[count > 1], max(len(count) - 3.0, 1.0)
    noise, registration, pull, mouth_on_head = angles.errors.noise_px, None, None, None
    pose_px, pivot_dof = angles.errors.pose_px, _pivot_dof(angles.pivot.source, poses)
    neutral = None
    if angles.resting is not None:
        neutral = _neutral(angles, angles.resting, pose.reshape(-1), mirrored)
    if angles.registered is not None:
        # Fitted to some thousand pixels of a hundred frames: what is uncertain about its uncertainty does not count.
        pose_px, pivot_dof = 0.0, math.inf
        registration, pull, noise, mouth_on_head, neutral = _by_registration(
            angles, angles.registered, rows, neutral, mirrored
        )
    return ErrorSources(
        frame=rows[kept],
        time=series.time[rows][kept],
        angle=angles.line[kept] - angles.neutral,
        line=angles.line[kept],
        lever_px=angles.lever_px[kept],
        mirrored=mirrored,
        pivot_px=angles.pivot.centre_px,
        pivot_covariance_px2=angles.pivot.covariance_px2,
        pivot_source=angles.pivot.source,
        pivot_dof=pivot_dof,
        noise_px=noise[kept],
        noise_dof=_MAD_EFFICIENCY * (several - 1).sum() if several.sum() >= _FEWEST_REPEATS else math.inf,
        pose_px=pose_px,
        pose_dof=poses,
        neutral=neutral,
        registration=None if registration is None else registration[kept],
        pivot_sensitivity=None if pull is None else pull[kept],
        mouth_on_head=None if mouth_on_head is None else mouth_on_head[kept],
        lens_px=(angles.view.lens * angles.lever_px)[kept] if angles.view.lens.any() else None,
        tilt=angles.view.tilt,
        within_exposure=angles.within_exposure[kept] if angles.within_exposure.any() else None,
        exposure_s=rig.camera.exposure_s,
    )


def _pivot_dof(source: str, poses: float) -> float:
    """Of two sources return those of the one that knows less: both together are no less sure than that."""
    dof = [_MARKER_DOF] if "marker" in source else []
    return min([*dof, poses] if "centre" in source else dof)


def _neutral(angles: Angles, resting: Flags, pose: NDArray[np.int64], mirrored: bool) -> Neutral:
    upright = np.array([-1.0 if mirrored else 1.0, -1.0])
    places = (angles.mark_px[resting] - angles.pivot.centre_px) * upright
    ahead, up = (places / np.hypot(*places.T)[:, None]).mean(axis=0)
    frames = int(resting.sum())
    return Neutral(
        frames=frames,
        poses=len(np.unique(pose[resting])),
        place_px=places.mean(axis=0),
        along=np.array([-up, ahead]),
        noise_px=math.sqrt(float((angles.errors.noise_px[resting] ** 2).mean()) / frames),
    )


def _by_registration(
    angles: Angles, found: Registered, rows: NDArray[np.int64], neutral: Neutral | None, mirrored: bool
) -> tuple[Floats, Floats, Floats, Floats | None, Neutral]:
    """Return registration, pull, noise of the mouth where the head was not found, mouth on head, and neutral.

    Everything is what `anglecam.measurement.angles.fine_angles` made sigma of. A declared neutral leaves the mean over all frames
    in its place, and what the line itself stands on: the mouth's place on the head.
    """
    sigma, pull = found.sigma[rows], found.pivot_sensitivity[rows]
    seen = np.isfinite(found.turn[rows])
    used = seen if angles.resting is None else angles.resting & seen
    some = bool(used.any())
    shared = angles.shared
    mean = pull[used].mean(axis=0) if some else np.zeros(2)
    pull = np.where(seen[:, None], pull, mean)
    off = pull - mean
    by_pivot = np.einsum("ni,ij,nj->n", off, angles.pivot.covariance_px2, off)
    explained = by_pivot + shared**2 + angles.within_exposure**2 + np.where(seen, sigma**2, 0.0)
    rest = np.sqrt(np.maximum(angles.sigma**2 - explained, 0.0))
    alone = np.where(seen, 0.0, rest * angles.lever_px)
    mouth_on_head = np.where(seen, rest, 0.0) if neutral is None else None
    stand_in = neutral or _neutral(angles, used, np.zeros(len(rows), np.int64), mirrored)
    fine = Neutral(int(used.sum()), stand_in.poses, stand_in.place_px, stand_in.along, 0.0, shared, mean)
    return np.where(seen, sigma, 0.0), pull, alone, mouth_on_head, fine
