"""Follow the outline of what moves before a still background, where the moving thing has too few features.

In a stretch of the clip the edges of one frame that move are followed from frame to frame. Those that keep to one rigid
motion are the outline; a shadow's edges and stains that shine through do not. The poses of that stretch say where the
outline is sought in the whole clip, where it was not seen in the frame before.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.series import OK
from anglecam.data.typing import Floats, Image
from anglecam.video.film import Frame
from anglecam.vision.image.median import still_background
from anglecam.vision.image.transforms import inverse_motion, rotation, turn_of, turned_about
from anglecam.vision.rigid_body.centre_of_rotation import FramePose, RigidMotion, fit_common_centre
from anglecam.vision.rigid_body.outline import (
    MIN_OUTLINE_POINTS,
    Outline,
    OutlineMatch,
    Slopes,
    find_outline,
    match_outline,
    slopes,
)
from anglecam.vision.rigid_body.rough_centre import Centre, with_pose
from anglecam.vision.status import NO_MARK, UNDECODABLE

_CLEAR = 6.0
"""Least slope of an outline, in usual slopes of the difference from the background, which are those of noise."""
_STEEPEST, _STEEP_SHARE = 0.999, 0.2
"""Quantile of the slopes that counts as the steepest, and its share from which on an edge is no soft shadow's."""
_TYPICAL = 0.9
"""Quantile of the lengths of outlines in the samples at which the reference is: in more there may be a second thing."""
_STRETCH, _STRETCH_BYTES = 100, 300_000_000
"""Frames from which the outline is learnt, and their memory, at most."""
_DAMPING = 0.8
"""Share of the displacement since the frame before that is expected to the next one."""
_FOLLOWED_SHARE = 0.5
"""Share of the frames in which an edge must follow to belong to the outline."""
_ROUNDS = 4
"""Times that edges which do not follow are left out, at most; without them, more of the others are recognised."""
_OWN = 0.5
"""Slope of the background, as a share of an edge's, up to which the edge is the moving thing's own."""
_RIGID_SHARE = 0.5
"""Least share of these edges that must follow one rotation. A rigid thing and its sharp shadow have equal shares; 0.55
to 1 of single things followed, at most 0.46 of two hinged links that were followed wrongly."""
_MIN_ANGULARITY = 0.02
"""Least angularity of an outline. A disc has that of its normals' errors, 0.0025 for errors of 3°."""
_SEEN_SHARE = 0.3
"""Share of the outline that must be seen for a frame to be measured."""
_PLACE_PX = 0.1
"""Standard uncertainty of an outline's place that varies with its angle, px: light, shade and stains behind it."""
_KNOWN = 24
"""Known poses that are tried where the outline was not seen in the frame before."""
_ALIKE = 0.7
"""Share of the best match's points that another pose has if the outline repeats itself. A tooth of a gear is as good as
the next but for the wall behind it, which displaces some edges: of a drawn gear, other teeth had 0.8."""
_ALL_ROUND = 0.1
"""Angle between the poses at which an outline that was found again is sought once more, rad: from half of it a match
converges (`anglecam.vision.rigid_body.outline`). The known poses are those of one stretch, and may miss a tooth."""
_SAME_TURN = 0.05
"""Difference of two matches of one pose, rad: less than half the pitch of sixty teeth."""


@dataclass(frozen=True)
class MovingOutline:
    """What is known of the outline before the clip is measured."""

    background: Image
    """(h, w, planes) the still background."""
    level: float
    """Slope of the difference from it from which on a pixel belongs to an edge of what moves, grey levels/px."""
    outline: Outline
    centre: Centre
    """Of its rotation."""
    known: tuple[Floats, ...]
    """(3, 3) poses in which it was seen, at different angles."""


def learn_outline(samples: Sequence[Frame], frames: Iterator[Frame]) -> MovingOutline | str:
    """Learn the outline of what moves, from the frames around one of the samples.

    Parameters
    ----------
    samples : sequence of Frame
        Spread over the clip.
    frames : iterator of Frame
        The clip from its start, with as many planes.

    Returns
    -------
    MovingOutline or str
        The cause in a few words where nothing moves as a rigid body.
    """
    images = [frame.image for frame in samples if frame.image is not None]
    background = still_background(images)
    steep = np.stack([slopes(image, background).steepness for image in images])
    level = max(_CLEAR * float(np.median(steep)), _STEEP_SHARE * float(np.quantile(steep, _STEEPEST)))
    lengths = (steep > level).sum(axis=(1, 2))
    typical = int(np.argsort(lengths)[int(_TYPICAL * (len(lengths) - 1))])
    stretch, start = _frames_around(frames, samples[typical].index, images[0].nbytes)
    outline = edges = _own(find_outline(slopes(stretch[start], background), level), background)
    if len(edges.points) < MIN_OUTLINE_POINTS:
        return "nothing moves before the background"
    for _ in range(_ROUNDS):
        centre = _anywhere(background)
        back, centre = _follow(outline, background, stretch[start::-1], centre)
        on, centre = _follow(outline, background, stretch[start:], centre)
        seen = [match for match in (*back[:0:-1], *on) if match is not None]
        if not seen or len(seen) < _FOLLOWED_SHARE * len(stretch):
            return "what moves before the background is not rigid"
        follows = np.mean([match.follows for match in seen], axis=0) > _FOLLOWED_SHARE
        if follows.sum() < MIN_OUTLINE_POINTS:
            return "what moves before the background is not rigid"
        if follows.all():
            break
        outline = outline.part(follows)
    if len(outline.points) < _RIGID_SHARE * len(edges.points):
        return "most of what moves before the background does not follow one rotation"
    if np.median([match.angularity for match in seen]) < _MIN_ANGULARITY:
        return "what moves before the background is round, and its rotation is not seen"
    by_turn = sorted((match.pose for match in seen), key=turn_of)
    spread = np.unique(np.linspace(0, len(by_turn) - 1, _KNOWN).round().astype(int))
    return MovingOutline(background, level, outline, centre, tuple(by_turn[i] for i in spread))


def follow_outline(frames: Iterator[Frame], moving: MovingOutline) -> RigidMotion | str:
    """Measure the rotation of a moving outline in every frame.

    Parameters
    ----------
    frames : iterator of Frame
        The whole clip; it is read once, one frame at a time.
    moving : MovingOutline
        From `learn_outline`.

    Returns
    -------
    RigidMotion or str
        The cause in a few words where nothing rotates.
    """
    poses: list[FramePose] = []
    recent: list[Floats] = []
    last, since, fastest, repetition = None, 0, 0.0, np.inf
    for frame in frames:
        since += 1
        if frame.image is None:
            poses.append(FramePose(UNDECODABLE))
            continue
        seen = slopes(frame.image, moving.background)
        match = max(_matches(moving, seen, [_going_on(recent)] if recent else []), key=_followers, default=None)
        may_be_any = since > 1 and since * fastest >= repetition / 2.0
        if match is None and not may_be_any and (seen.steepness > moving.level).sum() >= MIN_OUTLINE_POINTS:
            again = _matches(moving, seen, moving.known)
            if again and last is not None:
                again += _matches(moving, seen, _all_round(max(again, key=_followers).pose, moving.centre))
            match, least = _found_again(again, last, since, fastest)
            repetition = min(repetition, least)
        recent = [] if match is None else [*recent[-1:], match.pose]
        if match is not None:
            if last is not None and since == 1:
                fastest = max(fastest, abs(turn_of(match.pose @ inverse_motion(last))))
            last, since = match.pose, 0
        poses.append(FramePose(NO_MARK) if match is None else _as_frame_pose(match))
    return fit_common_centre(poses, moving.outline.middle, 0.0, _PLACE_PX)


def _frames_around(frames: Iterator[Frame], index: int, picture_bytes: int) -> tuple[list[Image], int]:
    """Return the decodable pictures around a frame, and which of them is its own."""
    half = int(min(_STRETCH, max(_STRETCH_BYTES // picture_bytes, 2))) // 2
    near = [frame for frame in frames if abs(frame.index - index) <= half and frame.image is not None]
    return [frame.image for frame in near if frame.image is not None], [frame.index for frame in near].index(index)


def _own(outline: Outline, background: Image) -> Outline:
    """Return the edges where the background has none. Elsewhere they may be the background's, which is covered."""
    behind = slopes(background, np.zeros_like(background)).steepness
    x, y = np.minimum(outline.points.round().astype(int), np.array(behind.shape[::-1]) - 1).T
    return outline.part(behind[y, x] < _OWN * outline.steepness)


def _anywhere(picture: Image) -> Centre:
    """Return a centre of rotation of which nothing is known but that it is within some pictures' sizes."""
    size = np.array(picture.shape[1::-1], dtype=float)
    return Centre(size / 2.0, np.eye(2) / float(size @ size))


def _follow(
    outline: Outline, background: Image, images: Sequence[Image], centre: Centre
) -> tuple[list[OutlineMatch | None], Centre]:
    """Follow an outline from picture to picture, and its centre of rotation; the first picture is the reference."""
    matches: list[OutlineMatch | None] = []
    recent = [np.eye(3)]
    for image in images:
        match = match_outline(outline, slopes(image, background), _going_on(recent), centre)
        if match is not None:
            recent = [*recent[-1:], match.pose]
            centre = with_pose(centre, match.free_pose, match.information, match.group_ratio, outline.middle)
        matches.append(match)
    return matches, centre


def _going_on(recent: Sequence[Floats]) -> Floats:
    """Return the pose in which a motion goes on, a little slower, from its last two poses."""
    if len(recent) < 2:
        return recent[-1]
    step = recent[-1] @ inverse_motion(recent[-2])
    turn, shift = _DAMPING * turn_of(step), _DAMPING * step[:2, 2]
    damped = np.eye(3)
    damped[:2, :2], damped[:2, 2] = rotation(turn).T, shift
    return damped @ recent[-1]


def _matches(moving: MovingOutline, seen: Slopes, guesses: Sequence[Floats]) -> list[OutlineMatch]:
    """Return the matches from several guesses in which enough of the outline is seen."""
    tried = (match_outline(moving.outline, seen, guess, moving.centre) for guess in guesses)
    return [match for match in tried if match is not None and match.follows.mean() >= _SEEN_SHARE]


def _all_round(pose: Floats, centre: Centre) -> list[Floats]:
    """Return a pose turned about a centre, all the way round."""
    return [turned_about(centre.place_px, turn) @ pose for turn in np.arange(_ALL_ROUND, 2.0 * np.pi, _ALL_ROUND)]


def _followers(match: OutlineMatch) -> int:
    return int(match.follows.sum())


def _found_again(
    matches: Sequence[OutlineMatch], last: Floats | None, since: int, fastest: float
) -> tuple[OutlineMatch | None, float]:
    """Return which of several matches goes on from the last pose, and after which least rotation the outline is alike.

    An outline that repeats itself, as a gear's does from tooth to tooth, is seen in several poses alike. The nearest to
    the last one is the right one if the body cannot have turned by half the repetition since: it turns no faster than
    before, and from a frame to the next one by less than that half.

    Parameters
    ----------
    matches : sequence of OutlineMatch
        From all known poses, and from the best of them, turned all the way round.
    last : ndarray, optional
        (3, 3) the pose when the outline was last seen; the first pose may be any of those alike.
    since : int
        Frames since then.
    fastest : float
        Largest rotation from one frame to the next one so far, rad.

    Returns
    -------
    match : OutlineMatch or None
        ``None`` where it cannot be known.
    repetition : float
        Rad; infinite for an outline that is seen in one pose only.
    """
    best = max(matches, key=_followers, default=None)
    if best is None or last is None:
        return best, np.inf
    alike = [match for match in matches if _followers(match) >= _ALIKE * _followers(best)]
    turned = np.array([turn_of(match.pose @ inverse_motion(last)) for match in alike])
    nearest = int(np.argmin(np.abs(turned)))
    apart = np.abs((turned - turned[nearest] + np.pi) % (2.0 * np.pi) - np.pi)
    others = apart[apart > _SAME_TURN]
    if not len(others):
        return best, np.inf
    repetition = float(others.min())
    return alike[nearest] if since == 1 or since * fastest < repetition / 2.0 else None, repetition


def _as_frame_pose(match: OutlineMatch) -> FramePose:
    return FramePose(OK, match.free_pose, match.information, match.group_ratio)
