"""Collect the error sources of a measured clip."""

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
"""Degrees of freedom of a marker's covariance: twelve sectors of its edge minus two coordinates."""
_MAD_EFFICIENCY = 0.37
"""Statistical efficiency of the median absolute deviation as an estimate of a normal standard deviation."""
_FEWEST_REPEATS = 20
"""Number of frames in repeated poses below which the noise comes from the pixels
(`anglecam.measurement.sigma.place_errors`)."""


def error_sources(measured: Measurement, rig: Rig) -> ErrorSources:
    """Collect the error sources of a measured clip.

    Parameters
    ----------
    measured : Measurement
        The measured clip.
    rig : Rig
        The rig that it was measured with.

    Returns
    -------
    ErrorSources
        Sources whose terms combine to the series' sigma in every frame.
    """
    series, angles = measured.series, measured.angles
    # A duplicate frame is detected after it was measured, so it contributes to neutral.
    rows = np.array([i for i, status in enumerate(series.status) if status in (OK, "duplicate")])
    kept = series.ok[rows]
    mirrored = rig.facing == "left"
    _, pose, count = np.unique(np.round(angles.mark_px), axis=0, return_inverse=True, return_counts=True)
    repeats, poses = count[count > 1], max(len(count) - 3.0, 1.0)
    noise, registration, sensitivity, mark_on_body = angles.errors.noise_px, None, None, None
    pose_px, pivot_dof = angles.errors.pose_px, _pivot_dof(angles.pivot.source, poses)
    neutral = None
    if angles.resting is not None:
        neutral = _neutral(angles, angles.resting, pose.reshape(-1), mirrored)
    if angles.registered is not None:
        # The fit uses some thousand pixels of a hundred frames, so its uncertainty is well known.
        pose_px, pivot_dof = 0.0, math.inf
        registration, sensitivity, noise, mark_on_body, neutral = _by_registration(
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
        noise_dof=_MAD_EFFICIENCY * (repeats - 1).sum() if repeats.sum() >= _FEWEST_REPEATS else math.inf,
        pose_px=pose_px,
        pose_dof=poses,
        neutral=neutral,
        registration=None if registration is None else registration[kept],
        pivot_sensitivity=None if sensitivity is None else sensitivity[kept],
        mark_on_body=None if mark_on_body is None else mark_on_body[kept],
        lens_px=(angles.view.lens * angles.lever_px)[kept] if angles.view.lens.any() else None,
        tilt=angles.view.tilt,
        within_exposure=angles.within_exposure[kept] if angles.within_exposure.any() else None,
        exposure_s=rig.camera.exposure_s,
    )


def _pivot_dof(source: str, poses: float) -> float:
    """Return the pivot's degrees of freedom: the smallest of its sources; a declaration has infinitely many."""
    dof = [_MARKER_DOF] if "marker" in source else []
    return min([*dof, poses] if "centre" in source else dof, default=math.inf)


def _neutral(angles: Angles, resting: Flags, pose: NDArray[np.int64], mirrored: bool) -> Neutral:
    upright = np.array([-1.0 if mirrored else 1.0, -1.0])
    position = (angles.mark_px[resting] - angles.pivot.centre_px) * upright
    ahead, up = (position / np.hypot(*position.T)[:, None]).mean(axis=0)
    frames = int(resting.sum())
    return Neutral(
        frames=frames,
        poses=len(np.unique(pose[resting])),
        place_px=position.mean(axis=0),
        along=np.array([-up, ahead]),
        noise_px=math.sqrt(float((angles.errors.noise_px[resting] ** 2).mean()) / frames),
    )


def _by_registration(
    angles: Angles, found: Registered, rows: NDArray[np.int64], neutral: Neutral | None, mirrored: bool
) -> tuple[Floats, Floats, Floats, Floats | None, Neutral]:
    """Return the error sources of an angle measured by registration.

    They are the sources from which `anglecam.measurement.angles.fine_angles` computes sigma. If neutral is declared,
    the reference is the mean over all frames, and the absolute line adds the error of the mark's position on the body.

    Returns
    -------
    registration : ndarray
        (n,) standard uncertainty of the rotation, rad.
    sensitivity : ndarray
        (n, 2) pivot sensitivity, rad/px.
    noise : ndarray
        (n,) standard uncertainty of the mark in frames without a registration, px.
    mark_on_body : ndarray or None
        (n,) standard uncertainty of the absolute line, rad; ``None`` if neutral is not declared.
    neutral : Neutral
        The reference line.
    """
    sigma, sensitivity = found.sigma[rows], found.pivot_sensitivity[rows]
    registered = np.isfinite(found.turn[rows])
    used = registered if angles.resting is None else angles.resting & registered
    shared = angles.shared
    mean = sensitivity[used].mean(axis=0) if used.any() else np.zeros(2)
    sensitivity = np.where(registered[:, None], sensitivity, mean)
    difference = sensitivity - mean
    by_pivot = np.einsum("ni,ij,nj->n", difference, angles.pivot.covariance_px2, difference)
    explained = by_pivot + shared**2 + angles.within_exposure**2 + np.where(registered, sigma**2, 0.0)
    rest = np.sqrt(np.maximum(angles.sigma**2 - explained, 0.0))
    noise = np.where(registered, 0.0, rest * angles.lever_px)
    mark_on_body = np.where(registered, rest, 0.0) if neutral is None else None
    reference = neutral or _neutral(angles, used, np.zeros(len(rows), np.int64), mirrored)
    fine = Neutral(int(used.sum()), reference.poses, reference.place_px, reference.along, 0.0, shared, mean)
    return np.where(registered, sigma, 0.0), sensitivity, noise, mark_on_body, fine
