"""All bodies of a film: what one explains is taken out, and the competition runs on the rest until nothing more moves.

A pixel that a known body covers is unknown there. It speaks neither for another body nor against it, so that a second
body is learnt from where the first does not cover it, and what is left of the first has to predict better than the
first moved on.

A body may hang on another one, as the second link of a double pendulum. Its centre then stands still in pictures that
are turned back with the body that carries it, and there the finders propose it as they propose any body. It competes in
the pictures as they are, with all that turn about a centre at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from scipy import special
from threadpoolctl import threadpool_limits

from anglecam.data.typing import Floats
from anglecam.engine.competition import LEAST_TURN, SURE, Explanation, compete
from anglecam.engine.learn import CLOSER, FINDERS, Learnt, swept
from anglecam.engine.refine import Fit
from anglecam.engine.sample import Sample, Stills, changed_boxes, sample_part
from anglecam.engine.score import NOTHING, Proposal, Score, score
from anglecam.engine.sliding import slide_of
from anglecam.engine.target import Picture, Target
from anglecam.engine.target_learning import learn_target
from anglecam.threads import one_opencv_thread

MOST = 6
"""Bodies of a film, at most."""
_EDGE_PX = 2
"""Of the sample: so far from a body its edge may still show, by its blur and by what its pose is off."""
_GREY = 128.0
"""Level of pictures less their background."""


@dataclass(frozen=True)
class Moving:
    """A body of a film that moves."""

    motion: Proposal
    """Its poses in the frames of ``sample``."""
    sample: Sample = field(repr=False)
    """Without the pixels that bodies before it cover: these are NaN."""
    fit: Fit
    """Of the body as one that turns; of a body that turns, ``motion`` is its proposal."""
    lead: float
    """By how much it predicts a frame better than its rivals, in standard errors."""
    moves: str
    """``turns``, ``translates`` or ``otherwise``."""
    joint_to: int | None = None
    """Index of the body that carries its centre, 0 for the first; ``None`` for a centre at rest."""
    before: tuple[Target, ...] = field(default=(), repr=False)
    """The bodies that are taken out of ``sample``."""

    @property
    def posterior(self) -> float:
        """Probability that it predicts better than its rivals (`probability`)."""
        return probability(self.lead)


def probability(lead: float) -> float:
    """Return the probability that an explanation predicts better than its best rival.

    The share of what it would gain if it were right is normal, with the standard error of a ratio of sums. Its lead is
    that share over the standard error, and the probability that the share is positive is Φ(lead).
    """
    return float(special.ndtr(lead))


def further_bodies(stills: Stills, first: Proposal, most: int = MOST) -> list[Moving]:
    """Find what moves in a film besides a body that is known.

    Parameters
    ----------
    stills : Stills
        K frames of the film.
    first : Proposal
        The known body's poses in these frames; its pixels are learnt from them.
    most : int
        Bodies, the first included.

    Returns
    -------
    list of Moving
        In the order in which they were found, which is that of how surely.
    """
    height, width = stills.images[0].shape[:2]
    whole = sample_part(stills, np.array([0.0, 0.0, width, height]))
    found: list[Moving] = []
    if whole is None:
        return found
    known = [first.in_frames(stills.frames, whole.frames)]
    with one_opencv_thread(), threadpool_limits(1, "blas"):  # as `anglecam.engine.learn.learn`
        while len(known) < most:
            one = _next(stills, whole, known)
            if one is None:
                break
            found.append(one)
            known.append(one.motion.in_frames(one.sample.frames, whole.frames))
    return found


def elsewhere(learnt: Learnt) -> list[Moving]:
    """Return what else turns by the explanations that lost to the first, if they predict better where they are.

    Parameters
    ----------
    learnt : Learnt
        Its first explanation is a body that turns.

    Returns
    -------
    list of Moving
        Not fitted anew; `further_bodies` looks for others, too.
    """
    first, *others = learnt.explanations
    others = [one for one in others if one.turns]
    if not others:
        return []
    sample, proposal = learnt.sample, first.fit.proposal
    known = [first.score]
    if learnt.wider is not None:
        sample, proposal = learnt.wider, proposal.in_frames(sample.frames, learnt.wider.frames)
        known = [score(sample, proposal.name, proposal.poses(sample))]
    found: list[Moving] = []
    for one in others:
        lead = min(one.lead, *(one.score.lead(other) for other in known))
        if lead >= SURE:
            known.append(one.score)
            found.append(Moving(one.fit.proposal, sample, one.fit, lead, "turns"))
    return found


def _rivals(masked: Sample, known: Sequence[Proposal]) -> list[Score]:
    still = score(masked, NOTHING, [None] * len(masked.pictures))
    return [still, *(score(masked, "moves with a known body", one.poses(masked)) for one in known)]


@dataclass(frozen=True)
class Rest:
    """A sample without the pixels that known bodies cover."""

    masked: Sample
    """With NaN in their place."""
    erased: Sample
    """With what is seen behind them in other frames."""
    targets: tuple[Target, ...]
    """The known bodies."""


def taken_out(sample: Sample, known: Sequence[Proposal]) -> Rest:
    """Return a sample without the pixels that bodies cover.

    Parameters
    ----------
    sample : Sample
        K frames.
    known : sequence of Proposal
        Poses of the bodies in these frames; where those of one are unknown, all pixels are.

    Returns
    -------
    Rest
        Of the sample.
    """
    masked, background, targets = sample, sample.median, list[Target]()
    for one in known:
        poses = one.poses(sample)
        target = learn_target(masked, poses, np.arange(len(poses)))
        pictures = [without(picture, [target], [pose]) for picture, pose in zip(masked.pictures, poses, strict=True)]
        masked = replace(masked, pictures=np.stack(pictures))
        background = np.where(np.isfinite(target.background), target.background, background)
        targets.append(target)
    erased = np.where(np.isfinite(masked.pictures), masked.pictures, background)
    return Rest(masked, replace(sample, pictures=erased), tuple(targets))


def without(picture: Picture, targets: Sequence[Target], poses: Sequence[Floats | None]) -> Picture:
    """Return a picture with NaN where bodies in their poses (2, 3) cover it; all NaN where a pose is unknown."""
    around = np.ones((2 * _EDGE_PX + 1,) * 2, np.uint8)
    covered = np.zeros(picture.shape, np.uint8)
    for target, pose in zip(targets, poses, strict=True):
        covered |= np.uint8(1) if pose is None else target.covers(pose).astype(np.uint8)
    return np.where(cv2.dilate(covered, around) > 0, np.float32(np.nan), picture)


def _next(stills: Stills, whole: Sample, known: Sequence[Proposal]) -> Moving | None:
    """Return what moves besides known bodies, the surest; ``None`` for nothing."""
    for box in changed_boxes(taken_out(whole, known).erased.pictures):
        part = sample_part(stills, box / whole.scale)
        if part is None:
            continue
        placed = [one.in_frames(whole.frames, part.frames) for one in known]
        rest = taken_out(part, placed)
        proposals = [one for find in FINDERS for one in find(rest.erased)]
        for carrier in placed:
            proposals += _hinged(rest.erased, carrier)
        found = _surest(rest, compete(rest.masked, proposals), placed)
        if found is not None:
            return _closer(stills, found, placed)
    return None


def _hinged(erased: Sample, carrier: Proposal) -> list[Proposal]:
    """Return what may turn about a point that a known body carries."""
    background = np.median(erased.pictures, axis=0)
    pad = max(background.shape) // 3
    height, width = (side + 2 * pad for side in background.shape)
    turned_back = []
    for picture, pose in zip(erased.pictures, carrier.poses(erased), strict=True):
        back = np.full((height, width), _GREY, np.float32)
        if pose is not None:
            onto = np.column_stack([pose[:, :2], pose[:, 2] - pose[:, :2] @ np.full(2, float(pad))])
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            back = cv2.warpAffine(picture - background + _GREY, onto, (width, height), flags=flags, borderValue=_GREY)
        turned_back.append(back)
    pictures = np.stack(turned_back)
    found: list[Proposal] = []
    poses = carrier.in_film()
    for box in changed_boxes(pictures)[:1]:
        left, top, right, bottom = np.round(box).astype(int).tolist()
        cut = np.ascontiguousarray(pictures[:, top:bottom, left:right])
        corner = erased.corner_px + (np.array([left, top]) - pad) / erased.scale
        seen = replace(erased, pictures=cut, corner_px=corner, median=np.median(cut, axis=0))
        for find in FINDERS:
            found += [replace(one, turn=one.turn + carrier.turn, carrier=poses) for one in find(seen)]
    return found


def _surest(rest: Rest, found: Sequence[Explanation], known: Sequence[Proposal]) -> Moving | None:
    """Return the best explanation that predicts better than all its rivals; ``None`` where none does."""
    masked, rivals = rest.masked, _rivals(rest.masked, known)
    for one in found:
        lead = min([one.lead, *(one.score.lead(rival) for rival in rivals)])
        if one.turns and lead >= SURE:
            proposal = one.fit.proposal
            joint = next((k for k, body in enumerate(known) if _carries(body, proposal)), None)
            if joint is None or turns_relative(known[joint], proposal):
                return Moving(proposal, masked, one.fit, lead, "turns", joint, rest.targets)
    others: list[Moving] = []
    for one in found:
        slide = slide_of(masked, one.fit)
        motions = [("translates", slide.score, _as_translation(masked, slide.poses))]
        if one.lead >= SURE:  # over a translation
            motions.append(("otherwise", one.score, one.fit.proposal))
        for how, mine, motion in motions:
            lead = min(mine.lead(rival) for rival in rivals)
            others.append(Moving(motion, masked, one.fit, lead, how, before=rest.targets))
    best = max(others, key=lambda one: one.lead, default=None)
    return None if best is None or best.lead < SURE else best


def _carries(body: Proposal, other: Proposal) -> bool:
    return other.carrier is not None and np.array_equal(body.in_film(), other.carrier, equal_nan=True)


def turns_relative(body: Proposal, other: Proposal) -> bool:
    """Return whether two bodies are seen to turn relative to each other."""
    relative = other.turn - body.turn
    return bool(np.isfinite(relative).any()) and float(np.nanmax(relative) - np.nanmin(relative)) >= LEAST_TURN


def _as_translation(sample: Sample, poses: Sequence[Floats | None]) -> Proposal:
    """Return the poses (2, 3) of a body that does not turn as a proposal whose centre is carried."""
    unknown = np.full(2, np.nan)
    shift = np.array([unknown if pose is None else pose[:, 2] for pose in poses]) / sample.scale
    carrier = np.concatenate([np.tile(np.eye(2), (len(shift), 1, 1)), shift[:, :, None]], axis=2)
    return Proposal("slides", sample.corner_px, np.where(np.isfinite(shift[:, 0]), 0.0, np.nan), carrier)


def _closer(stills: Stills, found: Moving, known: Sequence[Proposal]) -> Moving:
    """Return a body that turns as it is found in pictures of where it moves, if these show more of it."""
    sample = found.sample
    part = sample_part(stills, swept(sample, found.fit))
    if found.moves != "turns" or part is None or part.scale <= CLOSER * sample.scale:
        return found
    placed = [one.in_frames(sample.frames, part.frames) for one in known]
    rest = taken_out(part, placed)
    again = compete(rest.masked, [found.motion.in_frames(sample.frames, part.frames)])
    return _surest(rest, again, placed) or found
