"""Fine angles: from the rotation of the whole body, which is measured without the mark.

The line to the mark's median position on the body is rotated with it. The mark's position in a frame remains the
centroid that was measured there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.shutter import blur_error, mean_off_middle
from anglecam.data.command import Command
from anglecam.data.typing import Floats
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles, neutral_of
from anglecam.measurement.registration_pass import Registered
from anglecam.measurement.sigma import Sigma, in_squares, sigma_by_pivot, sigma_of_mean
from anglecam.vision.pivot.estimate import PivotEstimate


def fine_angles(
    coarse: Angles,
    found: Registered,
    rows: NDArray[np.intp],
    filmed_px: Floats,
    time: Floats,
    rig: Rig,
    command: Command | None,
) -> Angles:
    """Replace the mark's angles by the rotation of the whole body.

    A frame in which the body was not found keeps its coarse angle. Neutral is the mean over a set of frames: all angles
    share its error, and part of the pivot's error cancels against it.

    Parameters
    ----------
    coarse : Angles
        From the mark's centroid.
    found : Registered
        The rotations, in every frame of the clip.
    rows : ndarray
        (n,) numbers of the frames in which the mark was found.
    filmed_px : ndarray
        (n, 2) the mark's positions in these frames, px.
    time : ndarray
        (n,) s.
    rig : Rig
        Facing and neutral.
    command : Command, optional
        As for the coarse angles.

    Returns
    -------
    Angles
        With registration.
    """
    turn, noise, pose, sensitivity = (
        found.turn[rows],
        found.noise[rows],
        found.pose[rows],
        found.pivot_sensitivity[rows],
    )
    registered = np.isfinite(turn)
    signed = turn if rig.facing == "right" else -turn
    base = float(np.median(coarse.line[registered] - signed[registered]))
    line = np.where(registered, base + signed, coarse.line)
    neutral, resting = neutral_of(rig, command, time, line, coarse.lever_px)
    used = registered if resting is None or not (resting & registered).any() else resting & registered
    shared = sigma_of_mean(turn[used], noise[used], float(np.median(pose[registered])), filmed_px[used])
    by_pivot = sigma_by_pivot(sensitivity, found.pivot_covariance_px2, used)
    exposure = rig.camera.exposure_s
    unsteady = np.hypot(mean_off_middle(time, line, exposure), blur_error(time, line, coarse.lever_px, exposure))
    # an absolute direction depends on the mark's mean position on the body, and on the pivot
    direction = float(np.median(coarse.sigma[registered])) if resting is None else 0.0
    common = in_squares(shared, by_pivot, coarse.view.sigma, direction)
    sigma = Sigma(
        np.where(registered, noise, coarse.uncertainty.noise),
        np.where(registered, np.hypot(pose, unsteady), coarse.uncertainty.pose),
        np.where(registered, common, coarse.uncertainty.common),
    )
    pivot = PivotEstimate(found.pivot_px, found.pivot_covariance_px2, f"{coarse.pivot.source} and the body's rotation")
    return replace(
        coarse,
        line=line,
        uncertainty=sigma,
        pivot=pivot,
        neutral=neutral,
        resting=resting,
        within_exposure=unsteady,
        registered=found,
        shared=shared,
    )
