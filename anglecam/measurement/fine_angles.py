"""Fine angles: from the turn of the whole head, which knows nothing of the mouth.

The line to the mouth's median place on the head is turned along. The mouth's own place in a frame stays the centroid
that was measured there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.shutter import mean_off_middle
from anglecam.data.command import Command
from anglecam.data.typing import Floats
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles, neutral_of
from anglecam.measurement.registration_pass import Registered
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
    """Take the turns of the whole head in place of the mouth's.

    A frame in which the head was not found keeps its coarse angle. Neutral is a mean over frames of its own: its
    error is shared by all angles, and part of the pivot's error cancels against it.

    Parameters
    ----------
    coarse : Angles
        From the mouth's centroid.
    found : Registered
        The turns, in every frame of the clip.
    rows : ndarray
        (n,) numbers of the frames in which the mouth was seen.
    filmed_px : ndarray
        (n, 2) where those frames show it, px.
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
    turn, noise, pose, pull = found.turn[rows], found.noise[rows], found.pose[rows], found.pivot_sensitivity[rows]
    seen = np.isfinite(turn)
    signed = turn if rig.facing == "right" else -turn
    base = float(np.median(coarse.line[seen] - signed[seen]))
    line = np.where(seen, base + signed, coarse.line)
    neutral, resting = neutral_of(rig, command, time, line, coarse.lever_px)
    used = seen if resting is None or not (resting & seen).any() else resting & seen
    shared = _sigma_of_mean(turn[used], noise[used], float(np.median(pose[seen])), filmed_px[used])
    against = pull - pull[used].mean(axis=0)
    by_pivot = np.einsum("ni,ij,nj->n", against, found.pivot_covariance_px2, against)
    unsteady = mean_off_middle(time, line, rig.camera.exposure_s)
    sigma = np.sqrt(noise**2 + pose**2 + shared**2 + by_pivot + coarse.view.sigma**2 + unsteady**2)
    if resting is None:
        # an absolute line stands on the mouth's mean place on the head, and on the pivot
        sigma = np.sqrt(sigma**2 + float(np.median(coarse.sigma[seen])) ** 2)
    pivot = PivotEstimate(found.pivot_px, found.pivot_covariance_px2, f"{coarse.pivot.source} and the head's turns")
    return replace(
        coarse,
        line=line,
        sigma=np.where(seen, sigma, coarse.sigma),
        pivot=pivot,
        neutral=neutral,
        resting=resting,
        within_exposure=unsteady,
        registered=found,
        shared=shared,
    )


def _sigma_of_mean(turn: Floats, noise: Floats, pose: float, filmed_px: Floats) -> float:
    """Return the standard uncertainty of the mean turn of frames in few poses, rad.

    What goes with the place on the pixel grid does not grow less by resting there. As far as frames at rest scatter
    more than the pixels' noise makes them, it is another in every frame: a codec's errors where noise stirs them, a
    camera's that shakes.
    """
    n, places = len(turn), np.unique(np.round(filmed_px).astype(int), axis=0, return_inverse=True)[1].ravel()
    count = np.bincount(places)
    own = 0.0
    if n > len(count):
        within = turn - (np.bincount(places, turn) / count)[places]
        own = float(np.clip((within**2).sum() / (n - len(count)) - (noise**2).mean(), 0.0, pose**2))
    return float(np.sqrt(((noise**2).mean() + own) / n + (pose**2 - own) / len(count)))
