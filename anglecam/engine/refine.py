"""Make a proposal as good as its idea: poses of most likelihood in the sampled frames, and the centre that they share.

The common centre is a weighted least-squares solution from free poses. The turns about that centre follow by a search
in one dimension.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from anglecam.data.typing import Flags, Floats
from anglecam.engine.body import (
    NOT_SEEN,
    Body,
    Frame,
    Turn,
    body_of,
    frame_of,
    gains_about,
    turn_near,
    turns_to_try,
    with_ratio,
)
from anglecam.engine.free_pose import free_pose
from anglecam.engine.rotation_centre import common_centre
from anglecam.engine.sample import Sample
from anglecam.engine.score import Proposal, carried_by
from anglecam.engine.target import Target, rotations, turned
from anglecam.engine.target_learning import learn_target

_ODDS = float(special.logit(0.95))
"""Logarithm of the odds at which a body counts as seen."""


@dataclass(frozen=True)
class Fit:
    """A body that was fitted to a sample."""

    proposal: Proposal
    target: Target = field(repr=False)
    gain: Floats
    """(K,) log likelihood of each frame with the body over that without it, nats."""
    sigma: Floats
    """(K,) standard uncertainty of each turn about a known centre, rad."""
    covariance_px2: Floats
    """(2, 2) of the centre, in the film, px²."""
    off_centre: float
    """Usual distance of the body's poses from turns about one centre, as a share of its travel."""
    off_px: float
    """The same distance, px of the film: the centre wanders by so much, or the body bends."""
    ratio: float
    """Usual variance by which the body's parts contradict each other, over that of independent pixels."""
    information: Floats
    """(3, 3) usual inverse covariance of a free pose in the coordinates of the body, if pixels were independent: turn,
    rad, and shift of the middle, px of the sample."""

    @property
    def seen(self) -> Flags:
        """(K,) frames in which the body is seen."""
        return np.isfinite(self.proposal.turn)


def refine(
    sample: Sample,
    proposal: Proposal,
    rounds: int = 2,
    *,
    surest: NDArray[np.int64] | None = None,
    lit: bool = True,
) -> Fit | None:
    """Fit a body to a sample, starting from a proposal.

    Parameters
    ----------
    sample : Sample
        K frames.
    proposal : Proposal
        Off by some pixels at most.
    rounds : int
        Of learning and locating in turn.
    surest : (m,) ndarray of int, optional
        Frames of which the turns are known best: a round before learns from them alone. Where the turns of some frames
        are off from those of the others, the body would be learnt twice, beside itself, and the turns stay off.
    lit : bool
        Whether the body is learnt with what changes before the light.

    Returns
    -------
    Fit or None
        ``None`` where nothing follows the proposal.
    """
    # a body that changes with the light is much like one that is displaced: its centre is found without
    fit = _fitted(sample, proposal, rounds, surest)
    if fit is None or not lit:
        return fit
    poses = fit.proposal.poses(sample)
    target = learn_target(sample, poses, np.arange(len(poses)), lit=True)
    return fit if body_of(target) is None else replace(fit, target=target)


def _fitted(sample: Sample, proposal: Proposal, rounds: int, surest: NDArray[np.int64] | None) -> Fit | None:
    fit, every = None, np.arange(len(sample.pictures))
    for use in [*([] if surest is None else [surest]), *[every] * rounds]:
        target = learn_target(sample, proposal.poses(sample), use)
        body = body_of(target)
        if body is None:
            return fit
        frames = [
            frame_of(target, picture, float(excess))
            for picture, excess in zip(sample.pictures, sample.excesses, strict=True)
        ]
        centre, carriers = sample.place(proposal.centre_px), proposal.carriers(sample)
        shifts = carried_by(carriers, centre)
        turn = _searched(frames, body, centre, proposal.turn, shifts)
        seen = np.isfinite(turn)
        if seen.sum() < 4:
            return fit
        free = [free_pose(frames[k], body, turned(centre, turn[k], shifts[k])) for k in np.flatnonzero(seen)]
        shared = common_centre(free, centre, body.middle, carriers[seen])
        centre, turn[seen] = shared.centre, shared.turn
        q = np.array([one.q for one in free])
        travel = float(np.hypot(np.std(q[:, 1:], axis=0).sum(), body.reach * np.std(q[:, 0])))
        usual = _usual_information(turn[seen], np.array([one.information for one in free]))
        near = _about(frames, body, centre, turn, carried_by(carriers, centre))
        turn, gain = np.array([one.turn for one in near]), np.array([one.gain for one in near])
        ratios = np.array([one.ratio for one in near])
        sigma = with_ratio(np.array([one.sigma for one in near]), ratios)
        if np.isfinite(turn).sum() < 4:
            return fit
        turn = turn - np.nanmedian(turn)
        proposal = replace(proposal, centre_px=sample.in_film(centre), turn=turn)
        fit = Fit(
            proposal=proposal,
            target=target,
            gain=gain,
            sigma=sigma,
            covariance_px2=shared.covariance / sample.scale**2,
            off_centre=shared.off_px / max(travel, 1e-9),
            off_px=shared.off_px / sample.scale,
            ratio=float(np.nanmedian(ratios)),
            information=usual,
        )
    return fit


def _usual_information(turn: Floats, information: Floats) -> Floats:
    """Return the median of (n, 3, 3) information matrices of poses, in the coordinates of the body."""
    back = np.tile(np.eye(3), (len(turn), 1, 1))
    back[:, 1:, 1:] = rotations(turn)[0]
    return np.asarray(np.median(back.swapaxes(1, 2) @ information @ back, axis=0))


def sensitivities(
    sample: Sample, fit: Fit, body: Body, turn: Floats, carrier_turn: Floats | float = 0.0
) -> tuple[Floats, Floats]:
    """Return how much turns (n,) change with an error of the centre, and with a shift of the body.

    ``carrier_turn`` are those of what carries the centre, rad.

    Returns
    -------
    centre, shift : ndarray
        (n, 2) rad/px of the film.
    """
    rotation, slope = rotations(turn)
    arm = body.middle - sample.place(fit.proposal.centre_px)
    turned_by = np.tile(np.eye(3), (len(turn), 1, 1))
    turned_by[:, 1:, 1:] = rotation
    information = turned_by @ fit.information @ turned_by.swapaxes(1, 2)
    tangent = np.concatenate([np.ones((len(turn), 1)), slope @ arm], axis=1)
    along = np.einsum("ni,nij->nj", tangent, information)
    carried = rotations(np.broadcast_to(carrier_turn, turn.shape))[0]
    moved = np.einsum("ni,nij->nj", along[:, 1:], carried - rotation)
    scale = sample.scale / np.einsum("ni,ni->n", along, tangent)[:, None]
    return -moved * scale, along[:, 1:] * scale


def _searched(frames: list[Frame], body: Body, centre: Floats, turn: Floats, shifts: Floats) -> Floats:
    """Return the turns with those that are unknown sought wherever the body may be."""
    tried = turns_to_try(body, centre, frames[0].picture.shape, turn[np.isfinite(turn)])
    few = body.thinned(max(1, body.count // 250))
    found = turn.copy()
    for k in np.flatnonzero(~np.isfinite(turn) & np.isfinite(shifts).all(axis=1)):
        gains = gains_about(frames[k], few, centre, tried, shifts[k]).sum(axis=1)
        best = int(np.argmax(gains))
        if gains[best] > np.log(len(tried)) + _ODDS:
            found[k] = tried[best]
    return found


def _about(frames: list[Frame], body: Body, centre: Floats, turn: Floats, shifts: Floats) -> list[Turn]:
    """Return the turns about a centre near first guesses; not seen where the body gains nothing."""
    arm = body.arm(centre)
    found = [
        turn_near(frames[k], body, centre, arm, guess, shifts[k]) if np.isfinite(guess) else NOT_SEEN
        for k, guess in enumerate(turn)
    ]
    return [one if one.gain > _ODDS else NOT_SEEN for one in found]
