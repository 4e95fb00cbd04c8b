"""Whether what was followed as a mark is one rigid thing in all frames.

Another thing that is alike may be taken for it in some frames, a part of it may be covered, and what looks like one
thing may be two links. Then neither the line to its middle nor its outline has the angle of a mechanism.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.typing import Flags, Floats
from anglecam.measurement.angles import Angles
from anglecam.measurement.detections import Detections
from anglecam.measurement.what_is_seen import DECLARE_MARK, place_of
from anglecam.vision.mark.outline_turn import outline_bend, outline_turn
from anglecam.vision.mark.segment import Region
from anglecam.vision.status import AMBIGUOUS

MAX_OFF_CIRCLE = 0.02
"""Largest systematic variation of the distance from the pivot, as a share of the mark's travel. An error along the
lever has a like error across it, so the angle is then wrong by 2 % of its range. A wheel seen from 16° aside has as
much."""
FLOOR_PX = 0.25
"""Variation that shows nothing, px: codecs and the pixel grid shift a centroid by up to this much, evenly in time."""
PIVOT_SIGMAS = 3.0
"""Standard uncertainties of the pivot that may add to the variation."""
_SHORTEST = 0.05
"""Share of the frames in which a mark may be shorter."""
_LEAST_LENGTH, _LENGTH_PX = 0.75, 4.0
"""Least length of a mark in the others, relative to its usual one, and the change that shows nothing, px. Motion blur
lengthens a mark, and noise changes a small one."""
_OTHER_TURN = 0.25
"""Excess of the mark's own rotation over that of the line to it, as a share, from which on the line is not its own. A
view from 37° aside has as much."""
_WITH_ANOTHER = 0.2
"""Share of the frames in which another thing may be the mark, from which on it turns with the mark. A thing that the
mark passes, or that crosses its path, is taken for it in fewer."""


def why_not_one_mark(detections: Detections, ok: Flags, angles: Angles) -> str | None:
    """Return a message where a mark is two things in turn, bends, or turns by another angle than the line to it.

    Parameters
    ----------
    detections : Detections
        The coarse pass, of a mark.
    ok : ndarray
        (frames,) the measured frames.
    angles : Angles
        Of these frames, by the mark alone.

    Returns
    -------
    str or None
        With the figures that show it.
    """
    return (
        why_two_alike(detections.status)
        or _why_another_later(detections, ok, angles)
        or _why_not_its_line(detections, ok, angles)
    )


def why_two_alike(status: Sequence[str]) -> str | None:
    """Return a message where two things that are alike turn together, so that either may be the measured one.

    The two blades of a propeller are such things: after frames in which both are seen, the other one may be followed.

    Parameters
    ----------
    status : sequence of str
        Of every frame.

    Returns
    -------
    str or None
        With the number of frames in which both are seen.
    """
    both = sum(s == AMBIGUOUS for s in status)
    if both < _WITH_ANOTHER * len(status):
        return None
    return (
        f"in {both} of {len(status)} frames two things may be the mark, and after them either may be followed; point"
        " at a part that only one of them has: mark: {at: [x, y], frame: k} in rig.yaml"
    )


def _why_another_later(detections: Detections, ok: Flags, angles: Angles) -> str | None:
    """Return a message where a mark with a rival is seen elsewhere after frames in which it was lost.

    It is elsewhere if it turned faster meanwhile than it ever turns while it is seen, and is beside its former place.
    The rival is a thing whose motion is nearly as convincing, such as the other arm of a balance, or that is seen
    together with the mark and may be it.
    """
    frames, regions = np.flatnonzero(ok), [region for region in detections.regions if region is not None]
    rival = not detections.clear or AMBIGUOUS in detections.status
    if not rival or not regions or len(frames) < 3:
        return None
    turned = np.abs((np.diff(angles.line) + np.pi) % (2.0 * np.pi) - np.pi)
    gap = np.diff(frames)
    fastest = float(turned[gap == 1].max(initial=0.0))
    apart = np.hypot(*np.diff(angles.mark_px, axis=0).T)
    jumps = np.flatnonzero((gap > 1) & (turned > gap * fastest) & (apart > _usual_length(regions)[0]))
    if not len(jumps):
        return None
    k = int(jumps[0])
    return (
        f"from frame {frames[k]} to {frames[k + 1]} the mark, {place_of(detections)}, turns by"
        f" {np.degrees(turned[k]):.0f}°, faster than it is ever seen to turn, and another thing may be the mark;"
        f" {DECLARE_MARK}"
    )


def reaches_over_pivot(detections: Detections, ok: Flags, angles: Angles) -> bool:
    """Return whether a mark is longer than its distance from the pivot, as a servo's horn is.

    Parameters
    ----------
    detections : Detections
        The coarse pass.
    ok : ndarray
        (frames,) the measured frames.
    angles : Angles
        Of these frames.

    Returns
    -------
    bool
        False for a body without a mark.
    """
    regions, arm = _seen(detections, ok, angles)
    return bool(regions) and float(np.median(np.hypot(*arm.T))) < _usual_length(regions)[0]


def _why_not_its_line(detections: Detections, ok: Flags, angles: Angles) -> str | None:
    """Return a message where a mark that reaches over its pivot turns by another angle than the line to its middle.

    That middle is some pixels from the pivot. Where a part of the mark is not seen, it moves on another circle, and
    where the mark bends, neither its axis nor the line to its middle is the angle of one of its parts.
    """
    regions, arm = _seen(detections, ok, angles)
    line = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    found, bend = outline_turn(regions, line), outline_bend(regions, line)
    if found is None or bend is None or not reaches_over_pivot(detections, ok, angles):
        return None
    turned = float(np.std(line))
    if bend > max(MAX_OFF_CIRCLE * turned, FLOOR_PX / (_usual_length(regions)[0] / 2.0)):
        return (
            f"the mark {place_of(detections)} bends: its outline turns by {np.degrees(bend):.2g}° RMS otherwise than"
            f" the line to its middle, which turns by {np.degrees(turned):.2g}°; {DECLARE_MARK}"
        )
    if abs(found[0]) < _OTHER_TURN + PIVOT_SIGMAS * found[1]:
        return None
    return (
        f"the mark {place_of(detections)} reaches over its pivot and turns by another angle than the line to its"
        f" middle, {1.0 + found[0]:.2g} times as far; to measure its rotation, hint at its pivot:"
        " pivot: {near: [x, y]} in rig.yaml"
    )


def _seen(detections: Detections, ok: Flags, angles: Angles) -> tuple[list[Region], Floats]:
    """Return the mark where it is seen, and the lines (n, 2) from the pivot to its middle, px."""
    pairs = [(detections.regions[i], place) for i, place in zip(np.flatnonzero(ok), angles.mark_px, strict=True)]
    regions = [region for region, _ in pairs if region is not None]
    places = [place for region, place in pairs if region is not None]
    return regions, np.array(places).reshape(-1, 2) - angles.pivot.centre_px


def why_not_rigid(detections: Detections, ok: Flags) -> str | None:
    """Return a message where what was followed as a mark is seen whole in some frames and in part in others.

    Parameters
    ----------
    detections : Detections
        The coarse pass.
    ok : ndarray
        (frames,) the measured frames.

    Returns
    -------
    str or None
        With its least length; ``None`` for a mark of constant length, and for a body without a mark.
    """
    whole = [r for r, seen in zip(detections.regions, ok, strict=True) if seen and r is not None]
    if not whole:
        return None
    usual, least = _usual_length(whole)
    if least > min(_LEAST_LENGTH * usual, usual - _LENGTH_PX):
        return None
    return (
        f"the mark {place_of(detections)} is {usual:.0f} px long, but only {least:.0f} px are seen of it in some"
        f" frames; {DECLARE_MARK}"
    )


def _usual_length(regions: Sequence[Region]) -> tuple[float, float]:
    """Return the median and the least length of a mark, px."""
    longest = [float(np.linalg.eigvalsh(region.moments_px2)[1]) for region in regions]
    # a homogeneous bar is √12 times as long as its standard deviation
    usual, least = np.sqrt(12.0 * np.quantile(longest, (0.5, _SHORTEST)))
    return float(usual), float(least)
