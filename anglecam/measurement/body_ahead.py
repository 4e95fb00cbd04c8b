"""The body's appearance, learnt from evenly spaced frames of a long film before all of its frames are read.

So the film is decoded once more only, and each frame is measured while it is at hand: first the mark, then the body's
rotation, from the place of the mark. `anglecam.measurement.registration_pass` takes these rotations over where the
angles that the whole film shows are those at which they began, and repeats the others.

It is done for a camera at rest, seen without tilt, with a shutter that opens for all rows at once. In other clips the
rotation in a frame depends on what only the whole film shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from anglecam.camera.lens import Lens
from anglecam.data.series import OK
from anglecam.data.typing import Flags, Floats, Image
from anglecam.io.rig import Rig
from anglecam.measurement.body_learning import FEWEST, learn_from_frames, spread_out
from anglecam.measurement.mark_path import MarkPath
from anglecam.measurement.pivot import find_pivot
from anglecam.threads import Backlog
from anglecam.video.film import Film
from anglecam.video.picture import Picture
from anglecam.vision.mark.found_mark import FoundMark, region_in_plane
from anglecam.vision.mark.segment import LARGEST_SHARE, SMALLEST_SHARE, Region, find_regions
from anglecam.vision.mark.track import follow_mark
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.registration.tiles import FrameView, motion_plane
from anglecam.vision.registration.turn import NO_TURN, BodyAppearance, TurnEstimate, find_turn, refine_doubtful_turn

LESS_THAN_A_TURN = 5.0
"""Largest range of directions in such frames, rad. Between frames far apart, whole turns are not counted."""
_BASIN_PX = 1.0
"""Distance at the body's middle, px, between two angles from which the search ends at the same one."""


@dataclass(frozen=True)
class BodyAhead:
    """A body that was learnt from some of a film's frames."""

    appearance: BodyAppearance
    pivot: PivotEstimate
    """By these frames."""
    path: MarkPath
    """Of the mark, by these frames."""
    middle: float
    """Middle of the directions in these frames, rad: what is learnt of the light depends on the direction."""
    poses: int
    """Number of frames from which it was learnt."""
    zero: float = 0.0
    """Direction of the mark at which the rotation is zero, rad."""

    def begin(self, regions: Sequence[Region]) -> float:
        """Return the direction from the pivot to the only region that may be the mark.

        It is counter-clockwise as seen, rad, near the directions in the frames from which the body was learnt; it is
        NaN where no region or more than one may be the mark.
        """
        marks = self.path.marks(regions)
        if len(marks) != 1:
            return np.nan
        turn = self.path.direction(marks[0], self.pivot.centre_px) - self.zero
        return turn + 2.0 * np.pi * round((self.middle - turn) / (2.0 * np.pi))


def learn_body_ahead(film: Film, found: FoundMark, images: Sequence[Image], rig: Rig, lens: Lens) -> BodyAhead | None:
    """Learn the body from the frames of a film.

    Parameters
    ----------
    film : Film
        Evenly spaced frames of a clip (`Film.thinned`), by a camera at rest.
    found : FoundMark
        The mark.
    images : sequence of ndarray
        (h, w, 3) some frames, in which the pivot's marker is sought.
    rig : Rig
        What is declared about the pivot.
    lens : Lens
        From the picture to the plane of motion.

    Returns
    -------
    BodyAhead or None
        ``None`` where these frames do not suffice, or the body cannot be registered.
    """
    areas = SMALLEST_SHARE * found.area_px2, LARGEST_SHARE * found.area_px2
    time: list[float] = []
    regions: Backlog[list[Region]] = Backlog()
    for frame in film.frames():
        time.append(frame.time)
        image = frame.image
        regions.add(list if image is None else partial(find_regions, image, found.model, areas, found.opening_px))
    in_plane = [[region_in_plane(region, lens) for region in of_frame] for of_frame in regions.results()]
    track = follow_mark(in_plane, np.array(time), found)
    pivot = find_pivot(images, rig, track.circle, lens)[1]
    known = np.flatnonzero([status == OK for status in track.status])
    if track.circle is None or pivot is None or len(known) < FEWEST:
        return None
    marks = [region for k in known if (region := track.regions[k]) is not None]
    arm = np.array([mark.centre_px for mark in marks]) - pivot.centre_px
    turn = np.full(len(time), np.nan)
    turn[known] = np.unwrap(np.arctan2(-arm[:, 1], arm[:, 0]))
    if np.ptp(turn[known]) > LESS_THAN_A_TURN:
        return None
    wanted = spread_out(turn, known, film)
    views = [
        FrameView(frame.image, float(turn[frame.index]), pivot.centre_px, 0.0, 0.0)
        for frame in film.frames(brightness=film.coarse_colour, only=wanted)
        if frame.image is not None
    ]
    appearance = learn_from_frames(views, motion_plane(lens, film.size), pivot)
    if isinstance(appearance, str):
        return None
    return BodyAhead(
        appearance=appearance,
        pivot=pivot,
        path=MarkPath(
            track.circle.centre_px, track.circle.radius_px, float(np.median([mark.area_px2 for mark in marks])), lens
        ),
        middle=float(np.min(turn[known]) + np.max(turn[known])) / 2.0,
        poses=len(views),
    )


@dataclass(frozen=True)
class TurnsAhead:
    """The rotation of such a body in the frames of a film."""

    body: BodyAhead
    begun: Sequence[float]
    """Angle at which the search in each frame began, rad; NaN where there was none."""
    found: Sequence[TurnEstimate]
    """Of each frame."""

    def in_turns_of(self, turn: Floats) -> tuple[list[TurnEstimate], Flags, float]:
        """Return the rotations counted in whole turns as another measurement of the same film counts them.

        Parameters
        ----------
        turn : ndarray
            (n,) the direction of the mark by the whole film, from another reference, rad; NaN where it is unknown.

        Returns
        -------
        found : list of TurnEstimate
            An entry a frame.
        settled : ndarray
            (n,) frames in which the search began where the mark is by the whole film: nothing else would be found.
        reference : float
            What is to be added to ``turn`` for the reference of ``found``, rad.
        """
        apart = np.array(self.begun) - turn
        both = np.isfinite(apart)
        reference = float(np.angle(np.exp(1j * apart[both]).sum())) if both.any() else 0.0
        reference += float(np.median(_wrapped(apart[both] - reference))) if both.any() else 0.0
        lever = self.body.appearance.lever_px
        with np.errstate(invalid="ignore"):
            settled = np.abs(_wrapped(apart - reference)) * lever < _BASIN_PX
        whole = np.where(both, np.round((turn + reference - self.begun) / (2.0 * np.pi)), 0.0) * 2.0 * np.pi
        found = [
            replace(one, turn=one.turn + k) if ends_there else NO_TURN
            for one, k, ends_there in zip(self.found, whole.tolist(), settled, strict=True)
        ]
        return found, settled, reference


def turn_ahead(
    body: BodyAhead, film: Film, picture: Picture, before: Picture | None, begin: float, reach_px: float = 0.0
) -> TurnEstimate:
    """Find the rotation in a frame.

    Parameters
    ----------
    body : BodyAhead
        As it was learnt.
    film : Film
        The clip.
    picture : Picture
        The frame.
    before : Picture, optional
        The previous frame, from which a codec may have copied.
    begin : float
        Angle at which the search begins, rad, from `BodyAhead.begin`; NaN where there is none.
    reach_px : float
        Distance from there, px, within which other angles are tried first.

    Returns
    -------
    TurnEstimate
        With a rotation of NaN where the body is not seen.
    """
    if np.isnan(begin):
        return NO_TURN
    # other angles are tried in other parts of the picture
    part = None if reach_px else body.appearance.part_seen(begin, film.size)
    image = registered_planes(film, picture, part)
    if image is None:
        return NO_TURN
    view = FrameView(image, begin, body.appearance.pivot_px, 0.0, 0.0)
    copied = None if before is None or not picture.predicted else registered_planes(film, before, part)
    if reach_px:
        view = refine_doubtful_turn(body.appearance, view, reach_px)
    return find_turn(body.appearance, view, copied)


def registered_planes(film: Film, picture: Picture, part: tuple[slice, slice] | None = None) -> Image | None:
    """Return the planes by which a body is registered, (h, w, planes); ``None`` where a frame cannot be decoded.

    What is outside a part, if one is given, may have any values.
    """
    if film.coarse_colour:
        return picture.brightness
    return picture.colours if part is None else picture.colours_within(part)


def _wrapped(angle: Floats) -> Floats:
    """Return angles in [-π, π), rad."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
