"""Follow a learnt body through all frames of a film: where it may be in each, and the steadiest way through them.

In every frame the turn is sought in the whole circle; the likeliest poses are refined. Poses in which the body looks
the same, as a wheel does from spoke to spoke, and frames in which it is hidden are told apart by its motion through
all frames: the path of least cost (Viterbi, IEEE Transactions on Information Theory 13, 1967).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from anglecam.data.typing import Flags, Floats
from anglecam.engine.body import (
    STANDS,
    Body,
    Turn,
    body_of,
    frame_of,
    gains_about,
    turn_near,
    turns_to_try,
    with_ratio,
)
from anglecam.engine.path import most_from_motion, steadiest_path, wrapped
from anglecam.engine.refine import Fit
from anglecam.engine.sample import Sample
from anglecam.engine.score import carried_by
from anglecam.engine.target import Picture
from anglecam.engine.target_learning import learn_target

_STEP_PX = 2.0
"""Of the search for a turn."""
_FEW_PIXELS = 250
"""By which the whole circle is searched."""
_PEAKS, _CANDIDATES = 48, 24
"""Poses of a frame of which the likelihood is computed, and of those the ones that are refined, at most."""
_HOPELESS = 0.1
"""Share of the best pose's gain below which another one is not considered. A look-alike has more, unless another body
is before it."""
APART_PX = 6.0
"""Least distance of poses that count as two."""
_LIKE, _BESIDE_PX = 0.7, 25.0
"""Share of the better pose's gain from which on a pose so near to it may be a look-alike, as of a gear's next tooth."""
_FEWEST_ALIKE = 4
"""Poses that were found at the same turn from the right one, from which on that turn has odds of its own."""
_MAD = 1.4826
"""Standard deviation of normal values over the median of their magnitudes."""
_LEAST_SPREAD = 0.01
"""Standard deviation of such a share: few frames may agree by chance."""


@dataclass(frozen=True)
class Track:
    """A body in all n frames of a film."""

    turn: Floats
    """(n,) rad; NaN where it is not seen."""
    sigma: Floats
    """(n,) standard uncertainty about a known centre, rad."""
    ambiguous: Flags
    """(n,) frames in which another pose is nearly as probable."""


@dataclass(frozen=True)
class Search:
    """A body, and the turns at which it is sought in a frame."""

    sample: Sample
    fit: Fit
    body: Body
    few: Body
    centre: Floats
    """(2,) of the sample, px."""
    arm: float
    """Pixels of the sample by which the body moves for each rad."""
    turns: Floats
    """(m,) rad."""
    temper: float
    """Independent pixels for which one counts: neighbours are off together."""
    wrong: Floats
    """(n, 2) of poses that were found beside the right ones: turn from the right one, rad, and by which share of its
    gain it gained less."""


def search_for(sample: Sample, fit: Fit) -> Search:
    """Prepare the search for a body that was fitted to a sample."""
    body = body_of(fit.target)
    assert body is not None
    centre = sample.place(fit.proposal.centre_px)
    arm = body.arm(centre)
    few = body.thinned(max(1, body.count // _FEW_PIXELS))
    turns = turns_to_try(body, centre, sample.median.shape, fit.proposal.turn[fit.seen])
    search = Search(sample, fit, body, few, centre, arm, turns, max(1.0, fit.ratio), np.empty((0, 2)))
    return replace(search, wrong=_wrong_poses(search))


def _wrong_poses(search: Search) -> Floats:
    """Return the other poses that are found in the frames of the sample, by the body as the other half shows it.

    Returns
    -------
    ndarray
        (n, 2) turn from the right pose, rad, and by which share of its gain they gained less.
    """
    sample, proposal = search.sample, search.fit.proposal
    shifts = carried_by(proposal.carriers(sample), search.centre)
    count, poses = len(sample.pictures), proposal.poses(sample)
    wrong = list[tuple[float, float]]()
    for half in range(2):
        target = learn_target(sample, poses, np.arange(half, count, 2), lit=True)
        body = body_of(target)
        if body is None:
            continue
        few = body.thinned(max(1, body.count // _FEW_PIXELS))
        learnt = replace(search, fit=replace(search.fit, target=target), body=body, few=few)
        for k in (k for k in range(1 - half, count, 2) if search.fit.seen[k]):
            right, picture = proposal.turn[k], sample.pictures[k]
            frame = frame_of(target, picture, float(sample.excesses[k]))
            gain = float(gains_about(frame, body, search.centre, np.array([right]), shifts[k]).sum())
            found = [(float(wrapped(one.turn - right)), one.gain) for one in candidates(learnt, picture, shifts[k])]
            if gain > 0.0:
                wrong += [(turn, 1.0 - less / gain) for turn, less in found if abs(turn) * search.arm > APART_PX]
    return np.array(wrong).reshape(-1, 2)


def log_odds(search: Search, turn: Floats, gain: Floats) -> Floats:
    """Return the log odds (m,) of the poses that were found in a frame, over that nothing is there.

    How much it says that a pose gains less than the best one depends on the turn between the two: a gear looks the
    same a tooth further. The share by which it gains less has a mean and a variance over frames. Of two normal
    distributions with these means of either sign, the log odds of a share s are 2·mean·s/variance; they are no more
    than those of the pixels.

    Parameters
    ----------
    search : Search
        For the body.
    turn, gain : ndarray
        (m,) rad and nats.
    """
    odds = gain / search.temper
    if len(odds) < 2:
        return np.asarray(odds)
    best, near = int(gain.argmax()), APART_PX / search.arm
    away = np.abs(wrapped(search.wrong[:, 0] - (turn - turn[best])[:, None])) < near
    for i in np.flatnonzero(away.sum(axis=1) >= _FEWEST_ALIKE):
        shares = search.wrong[away[i], 1].tolist()
        usual = median(shares)  # of a list this short NumPy's takes thirty times as long
        spread = max(_LEAST_SPREAD, _MAD * median(abs(share - usual) for share in shares))
        learnt = 2.0 * max(0.0, usual) * (1.0 - gain[i] / gain[best]) / spread**2
        odds[i] = max(odds[i], odds[best] - learnt)
    return np.asarray(odds)


def candidates(search: Search, picture: Picture, shift: Floats = STANDS) -> list[Turn]:
    """Return the turns at which a body may be in a picture, those of most likelihood.

    The body's centre is shifted by (2,) px of the sample where another body carries it.
    """
    frame = frame_of(search.fit.target, picture, search.sample.excess(picture))
    gains = gains_about(frame, search.few, search.centre, search.turns, shift).sum(axis=1)
    around = _peaks(search, gains)[:, None] + np.array([-1.0, 0.0, 1.0]) * 0.5 * _STEP_PX / search.arm
    whole = gains_about(frame, search.body, search.centre, around.ravel(), shift).sum(axis=1).reshape(-1, 3)
    most = whole.max(axis=1)
    best = float(most.max(initial=0.0))
    floor = max(_HOPELESS * best, float(np.log(len(search.turns))) * search.fit.ratio)
    order = np.argsort(-most)
    order = order[most[order] > floor][:_CANDIDATES]
    near = around[order, whole[order].argmax(axis=1)]
    found = [
        turn_near(frame, search.body, search.centre, search.arm, turn, shift)
        for turn in near[_may_be(search, near, most[order])]
    ]
    apart: list[Turn] = []
    for one in sorted((one for one in found if np.isfinite(one.turn)), key=lambda one: -one.gain):
        if all(_another(search, one, other) for other in apart):
            apart.append(one)
    return apart


def _peaks(search: Search, gains: Floats) -> Floats:
    """Return the turns of most gain that are apart from each other.

    Of a wrong pose the gain is far below zero, as a rule, by few pixels as by all.
    """
    left, peaks = gains.copy(), list[float]()
    least = -_HOPELESS * float(left.max(initial=0.0))
    while len(peaks) < _PEAKS and (left >= least).any():
        peaks.append(float(search.turns[int(left.argmax())]))
        left[np.abs(wrapped(search.turns - peaks[-1])) * search.arm <= APART_PX] = -np.inf
    return np.array(peaks)


def _may_be(search: Search, turn: Floats, gain: Floats) -> Flags:
    """Return which of some turns (m,) can be right, the likeliest first: for the others no motion can say enough.

    Their gains are off by some share before they are refined.
    """
    odds = log_odds(search, turn, gain)
    return (gain > _LIKE * gain[:1]) | (odds > odds[:1] - most_from_motion(1.0 / search.arm))


def _another(search: Search, one: Turn, better: Turn) -> bool:
    """Return whether a pose is another one than a better one: not a lower peak beside it."""
    away = abs(float(wrapped(one.turn - better.turn))) * search.arm
    return away > (APART_PX if one.gain > _LIKE * better.gain else _BESIDE_PX)


def chosen(found: Sequence[Sequence[Turn]], times: Floats, search: Search) -> Track:
    """Return the most probable way through the turns that were found in n frames."""
    path, margin = steadiest_path(
        [np.array([one.turn for one in of_frame]) for of_frame in found],
        [
            log_odds(search, np.array([one.turn for one in of_frame]), np.array([one.gain for one in of_frame]))
            for of_frame in found
        ],
        times,
        1.0 / search.arm,
    )
    picked = [None if k < 0 else of_frame[k] for k, of_frame in zip(path, found, strict=True)]
    nan = float("nan")
    turn = np.array([nan if one is None else one.turn for one in picked])
    sigma = np.array([nan if one is None else one.sigma for one in picked])
    ratio = np.array([nan if one is None else one.ratio for one in picked])
    seen = np.isfinite(turn)
    turn[seen] = np.unwrap(turn[seen])
    return Track(turn, with_ratio(sigma, ratio), margin < np.log(19.0))
