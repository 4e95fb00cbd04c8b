"""From places in the picture to angles: the line from pivot to mouth, its zero, and how sure each of them is.

What an angle is, which way is up and where its zero lies, is said here once, for marks of our own and of others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.lens import Lens
from anglecam.camera.shutter import mean_off_middle
from anglecam.camera.tilt import Tilt
from anglecam.data.command import Command
from anglecam.data.typing import Flags, Floats
from anglecam.io.rig import Rig
from anglecam.measurement.detections import Detections
from anglecam.measurement.registration_pass import Registered
from anglecam.measurement.sigma import PlaceErrors, angle_sigma, place_errors
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.rigid_body.centre_of_rotation import RigidMotion

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
    mark_px: Floats
    """(n, 2) px."""
    pivot: PivotEstimate
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
        return np.asarray(np.hypot(*(self.mark_px - self.pivot.centre_px).T))


def coarse_angles(seen: Detections, ok: NDArray[np.bool_], time: Floats, rig: Rig, command: Command | None) -> Angles:
    """Read angles from the mouth's centroid.

    Parameters
    ----------
    seen : Detections
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
    mark_px: Floats,
    pivot: PivotEstimate,
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
    mark_px : ndarray
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
    arm = mark_px - pivot.centre_px
    # y goes down in the image; a face that looks to the left is mirrored, so that an upward nod is positive.
    line = np.unwrap(np.arctan2(-arm[:, 1], _ahead(arm[:, 0], rig)))
    line -= 2.0 * np.pi * np.round(np.median(line) / (2.0 * np.pi))
    lever = np.hypot(*arm.T)
    neutral, resting = neutral_of(rig, command, time, line, lever)
    view = _view_errors(lens, mark_px, pivot.centre_px, line, neutral, resting, rig)
    aside = thick_px * np.hypot(*lens.parallax) * (line - neutral) / lever
    known = angle_sigma(mark_px, pivot.centre_px, pivot.covariance_px2, errors, resting)
    unsteady = mean_off_middle(time, line, rig.camera.exposure_s)
    sigma = np.sqrt(known**2 + view.sigma**2 + aside**2 + unsteady**2)
    return Angles(line, sigma, mark_px, pivot, neutral, resting, errors, view, unsteady)


def _angles_of_head(
    seen: Detections, head: RigidMotion, ok: Flags, time: Floats, rig: Rig, command: Command | None
) -> Angles:
    """Read angles from the rigid head: of the line from the pivot to its middle."""
    turn, sigma = head.turn[ok], head.sigma[ok]
    arm = seen.lens.rectify(head.centre_px) - seen.pivot.centre_px
    c, s = np.cos(turn), np.sin(turn)
    mouth = seen.pivot.centre_px + np.column_stack([c * arm[0] + s * arm[1], -s * arm[0] + c * arm[1]])
    signed = turn if rig.facing == "right" else -turn
    line = float(np.arctan2(-arm[1], _ahead(arm[:1], rig)[0])) + signed
    lever = np.full(len(turn), float(np.hypot(*arm)))
    neutral, resting = neutral_of(rig, command, time[ok], line, lever)
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


def neutral_of(
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
