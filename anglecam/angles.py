"""From places in the picture to angles: the line from pivot to mouth, its zero, and how sure each of them is.

Coarse angles come from the mouth's centroid frame by frame; fine ones from the turn of the whole head, which knows
nothing of the mouth: the line to the mouth's median place on the head is turned along. The mouth's own place in a frame
stays the centroid that was measured there. What an angle is, which way is up and where its zero lies, is said here
once, for marks of our own and of others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.budget import PlaceErrors, angle_sigma, place_errors, worst_case
from anglecam.lens import Lens
from anglecam.registration import Registered
from anglecam.rig import Rig
from anglecam.series import CONTRACT_RADII_PX, OK, AngleSeries
from anglecam.session import Command
from anglecam.shutter import mean_off_middle
from anglecam.sighting import Sighting
from anglecam.uncertainty import Tilt
from anglecam.vision.one_centre import RigidMotion
from anglecam.vision.pivot import Pivot

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


_THICK = 0.25
"""Standard deviation of the height of what is seen of a mouth, as a share of the root of its area."""


@dataclass(frozen=True)
class ViewErrors:
    """What the uncertainty of lens and tilt does to the angles; arrays of length n, standard uncertainties, rad."""

    lens: Floats
    tilt: Tilt | None
    by_tilt: Floats

    @property
    def sigma(self) -> Floats:
        """Of both, rad."""
        return np.asarray(np.hypot(self.lens, self.by_tilt))


@dataclass(frozen=True)
class Angles:
    """The frames in which the mouth was seen; arrays of length n."""

    line: Floats
    """Direction from pivot to mouth from the picture's horizontal, upward positive for either facing, rad."""
    sigma: Floats
    """Standard uncertainty of ``line`` less ``neutral``, rad."""
    mouth_px: Floats
    """(n, 2) px."""
    pivot: Pivot
    neutral: float
    """Line that counts as zero, rad."""
    resting: NDArray[np.bool_] | None
    """Frames that neutral is taken from; ``None`` where it is declared."""
    errors: PlaceErrors
    """Of the mouth's centroid."""
    view: ViewErrors
    """Of lens and tilt."""
    within_exposure: Floats
    """Standard uncertainty by motion that is not steady within the exposure, rad."""
    registered: Registered | None = None
    """What the fine angles come from."""
    shared: float = 0.0
    """Standard uncertainty of neutral that all fine angles share, the pivot's aside, rad."""

    @property
    def lever_px(self) -> Floats:
        """Pivot to mouth, (n,) px."""
        return np.asarray(np.hypot(*(self.mouth_px - self.pivot.centre_px).T))


def coarse_angles(seen: Sighting, ok: NDArray[np.bool_], time: Floats, rig: Rig, command: Command | None) -> Angles:
    """Read angles from the mouth's centroid.

    Parameters
    ----------
    seen : Sighting
        Mouth and pivot.
    ok : ndarray
        (frames,) which n of them count.
    time : ndarray
        (frames,) when the mouth was where it was seen, s.
    rig : Rig
        Facing and neutral.
    command : Command, optional
        Its first change ends the rest that defines neutral.

    Returns
    -------
    Angles
        Without registration.
    """
    if seen.head is not None:
        return _angles_of_head(seen, seen.head, ok, time, rig, command)
    regions = [r for r, counts in zip(seen.regions, ok, strict=True) if counts and r is not None]
    mouth, circle = np.array([r.centre_px for r in regions]), seen.circle
    arm = mouth - seen.pivot.centre_px
    lever = np.hypot(*arm.T)
    off = lever - np.median(lever) if circle is None else np.hypot(*(mouth - circle.centre_px).T) - circle.radius_px
    out = arm / lever[:, None]
    noise = seen.noise**2 * np.array([r.noise_px2 for r in regions])
    across, along = (
        np.sqrt(np.einsum("ni,nij,nj->n", v, noise, v)) for v in (out, np.column_stack([-out[:, 1], out[:, 0]]))
    )
    errors = place_errors(mouth, off, across, along)
    # of a mouth that is seen at a slant, other parts come into sight as it turns: they stand at other heights
    thick = _THICK * float(np.median(np.sqrt([r.area_px2 for r in regions])))
    return angles_of_places(mouth, seen.pivot, errors, seen.lens, time[ok], rig, command, thick_px=thick)


def angles_of_places(
    mouth_px: Floats,
    pivot: Pivot,
    errors: PlaceErrors,
    lens: Lens,
    time: Floats,
    rig: Rig,
    command: Command | None,
    *,
    thick_px: float = 0.0,
) -> Angles:
    """Read the angle off the line from the pivot to the mouth.

    Parameters
    ----------
    mouth_px : ndarray
        (n, 2) places in the plane of motion, px.
    pivot : Pivot
        In the plane of motion.
    errors : PlaceErrors
        Of those places.
    lens : Lens
        Through which they were seen.
    time : ndarray
        (n,) s.
    rig : Rig
        Facing, neutral and exposure.
    command : Command, optional
        Its first change ends the rest that defines neutral.
    thick_px : float
        Standard deviation of the height of what is seen of the mouth, px.

    Returns
    -------
    Angles
        Without registration.
    """
    arm = mouth_px - pivot.centre_px
    # y goes down in the image; a face that looks to the left is mirrored, so that an upward nod is positive.
    line = np.unwrap(np.arctan2(-arm[:, 1], _ahead(arm[:, 0], rig)))
    line -= 2.0 * np.pi * np.round(np.median(line) / (2.0 * np.pi))
    lever = np.hypot(*arm.T)
    neutral, resting = _neutral(rig, command, time, line, lever)
    view = _view_errors(lens, mouth_px, pivot.centre_px, line, neutral, resting, rig)
    aside = thick_px * np.hypot(*lens.parallax) * (line - neutral) / lever
    known = angle_sigma(mouth_px, pivot.centre_px, pivot.covariance_px2, errors, resting)
    unsteady = mean_off_middle(time, line, rig.camera.exposure_s)
    sigma = np.sqrt(known**2 + view.sigma**2 + aside**2 + unsteady**2)
    return Angles(line, sigma, mouth_px, pivot, neutral, resting, errors, view, unsteady)


def series_of_angles(
    name: str,
    time: Floats,
    status: Sequence[str],
    ok: Flags,
    angles: Angles,
    mouth_px: Floats,
    pivot_px: Floats,
    rig: Rig,
    *,
    picture_px: tuple[int, int] | None = None,
    marker_px: tuple[float, float] | None = None,
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
    mouth_px, pivot_px : ndarray
        (frames, 2) where the picture shows them, px.
    rig : Rig
        Whose ``pixel_error_px`` the bounds are worked out for, besides the contract's.
    picture_px, marker_px : tuple, optional
        As of `AngleSeries`.

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
        mouth_px=np.where(told[:, None], mouth_px, np.nan),
        pivot_px=np.where(told[:, None], pivot_px, np.nan),
        picture_px=picture_px,
        marker_px=marker_px,
        by_mouth=angles.registered is None,
        bounds={r: worst_case(r, levers) for r in {*CONTRACT_RADII_PX, *rig.pixel_error_px}},
    )


def why_zero_is_elsewhere(rig: Rig, command: Command | None, time: Floats) -> str | None:
    """Say in a line that zero is not where it should be, ``None`` where it is; ``time`` (n,) of measured frames, s."""
    change = None if command is None or rig.neutral != "auto" else command.first_change()
    if change is None or (time < change).any():
        return None
    return f"zero is the clip's median: no frame before the first command change at {change:.3f} s could be measured"


def _angles_of_head(
    seen: Sighting, head: RigidMotion, ok: Flags, time: Floats, rig: Rig, command: Command | None
) -> Angles:
    """Read angles from the rigid head: of the line from the pivot to its middle."""
    turn, sigma = head.turn[ok], head.sigma[ok]
    arm = seen.lens.rectify(head.centre_px) - seen.pivot.centre_px
    c, s = np.cos(turn), np.sin(turn)
    mouth = seen.pivot.centre_px + np.column_stack([c * arm[0] + s * arm[1], -s * arm[0] + c * arm[1]])
    signed = turn if rig.facing == "right" else -turn
    line = float(np.arctan2(-arm[1], _ahead(arm[:1], rig)[0])) + signed
    lever = np.full(len(turn), float(np.hypot(*arm)))
    neutral, resting = _neutral(rig, command, time[ok], line, lever)
    errors = PlaceErrors(sigma * lever, 0.0)
    view = _view_errors(seen.lens, mouth, seen.pivot.centre_px, line, neutral, resting, rig)
    known = angle_sigma(mouth, seen.pivot.centre_px, seen.pivot.covariance_px2, errors, resting)
    unsteady = mean_off_middle(time[ok], line, rig.camera.exposure_s)
    sigma = np.sqrt(known**2 + view.sigma**2 + unsteady**2)
    return Angles(line, sigma, mouth, seen.pivot, neutral, resting, errors, view, unsteady)


def turns(angles: Angles, rig: Rig) -> Floats:
    """Turn of the head from the median line, counter-clockwise as seen, (n,) rad."""
    turn = angles.line - np.median(angles.line)
    return turn if rig.facing == "right" else -turn


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
    turn, noise, pose, pull = found.turn[rows], found.noise[rows], found.pose[rows], found.pull[rows]
    seen = np.isfinite(turn)
    signed = turn if rig.facing == "right" else -turn
    base = float(np.median(coarse.line[seen] - signed[seen]))
    line = np.where(seen, base + signed, coarse.line)
    neutral, resting = _neutral(rig, command, time, line, coarse.lever_px)
    used = seen if resting is None or not (resting & seen).any() else resting & seen
    shared = _sigma_of_mean(turn[used], noise[used], float(np.median(pose[seen])), filmed_px[used])
    against = pull - pull[used].mean(axis=0)
    by_pivot = np.einsum("ni,ij,nj->n", against, found.pivot_covariance_px2, against)
    unsteady = mean_off_middle(time, line, rig.camera.exposure_s)
    sigma = np.sqrt(noise**2 + pose**2 + shared**2 + by_pivot + coarse.view.sigma**2 + unsteady**2)
    if resting is None:
        # an absolute line stands on the mouth's mean place on the head, and on the pivot
        sigma = np.sqrt(sigma**2 + float(np.median(coarse.sigma[seen])) ** 2)
    pivot = Pivot(found.pivot_px, found.pivot_covariance_px2, f"{coarse.pivot.source} and the head's turns")
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


def _view_errors(
    lens: Lens, mouth: Floats, pivot: Floats, line: Floats, neutral: float, resting: Flags | None, rig: Rig
) -> ViewErrors:
    """See what lenses that err by one standard deviation each make of the angles."""
    zero = slice(None) if resting is None and rig.neutral == "auto" else resting
    variance = np.zeros(len(line))
    filmed, filmed_pivot = lens.distort(mouth), lens.distort(pivot)
    for deviant in lens.deviants():
        if deviant.tilt != lens.tilt:
            continue
        arm = deviant.rectify(filmed) - deviant.rectify(filmed_pivot)
        off = (np.arctan2(-arm[:, 1], _ahead(arm[:, 0], rig)) - line + np.pi) % (2.0 * np.pi) - np.pi
        variance += (off - (0.0 if zero is None else off[zero].mean())) ** 2
    if lens.tilt_sigma == 0.0:
        return ViewErrors(np.sqrt(variance), None, np.zeros(len(line)))
    tilt = Tilt(lens.tilt, np.radians(rig.camera.tilt_axis_deg), lens.tilt_sigma)
    off = tilt.turned(line, tilt.sigma) - line
    if rig.neutral == "auto":
        off = off - (tilt.turned(np.array([neutral]), tilt.sigma) - neutral)
    return ViewErrors(np.sqrt(variance), tilt, np.abs(off))


def _ahead(x: Floats, rig: Rig) -> Floats:
    return x if rig.facing == "right" else -x


def _neutral(
    rig: Rig, command: Command | None, time: Floats, line: Floats, lever: Floats
) -> tuple[float, NDArray[np.bool_] | None]:
    """Return the line that counts as zero, and the frames that it is taken from, if it is.

    A median errs as the frames do that lie within half a pixel of it.
    """
    if rig.neutral != "auto":
        return float(np.radians(rig.neutral)), None
    change = None if command is None else command.first_change()
    if change is not None and (time < change).any():
        resting = time < change
        return float(line[resting].mean()), resting
    middle = float(np.median(line))
    away = np.abs(line - middle) * lever
    return middle, away <= max(0.5, float(away.min()))
