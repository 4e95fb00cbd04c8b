"""Learn a body again from a steadier motion than the one it was learnt from.

A body is first learnt from a few frames, in which look-alike poses are not told apart. Its motion through all frames
says which of them are right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.engine.body import Turn
from anglecam.engine.kept_picture import in_grey_levels
from anglecam.engine.path import changes, middle, wrapped
from anglecam.engine.refine import refine
from anglecam.engine.score import NOTHING, score
from anglecam.engine.tracking import APART_PX, Search, candidates, chosen, search_for

_FEWEST = 8
"""Frames of the sample from which a body is learnt again."""
_JUMP = 20.0
"""Usual changes of a step from frame to frame from which on a change may be a jump to a look-alike pose."""
_AS_WELL = 0.9
"""Share of the gain of the body as it was learnt that a steadier motion has to have. Of two look-alikes in each frame
the better one was learnt, by chance, which gains some per cent."""


def steadier(
    search: Search, found: Sequence[Sequence[Turn]], times: Floats, pictures: Sequence[Image | None]
) -> Search | None:
    """Return a search for the body that is learnt from a steadier motion, if it explains the sample as well.

    Frames far apart may show a body of like parts now in one pose and now in a look-alike one, and what is learnt from
    them then looks like both. The motion through all frames tells them apart: the steadiest one alone, or the one by
    the body as it looks in a stretch of frames through which it turns without a jump.

    Parameters
    ----------
    search : Search
        For the body as it was learnt.
    found : sequence of sequence of Turn
        Where it may be in each of n frames.
    times : ndarray
        (n,) s.
    pictures : sequence of ndarray or None
        n pictures as `Sample.seen` returns them, `in_bytes`; empty where they are not at hand.

    Returns
    -------
    Search or None
        ``None`` where the motion is steady as it is, or no other one explains the sample.
    """
    steadiest = _as_well(search, chosen(found, times, replace(search, temper=np.inf, wrong=np.empty((0, 2)))).turn)
    if steadiest is not None:
        return steadiest
    turn = _by_stretch(search, chosen(found, times, search).turn, times, pictures)
    return None if turn is None else _as_well(search, turn)


def _as_well(search: Search, turn: Floats) -> Search | None:
    """Return a search for the body of a motion (n,), rad, if it is another one and explains the sample as well."""
    sample, known = search.sample, search.fit.proposal
    at_sample = turn[sample.frames]
    both = np.isfinite(at_sample) & np.isfinite(known.turn)
    if both.sum() < _FEWEST:
        return None
    off = (at_sample - known.turn)[both]
    if np.abs(wrapped(off - middle(off))).max() * search.arm < APART_PX:
        return None
    fit = refine(sample, replace(known, name="steady motion", turn=at_sample))
    if fit is None:
        return None
    nothing, before, after = (
        score(sample, name, poses, lit=True)
        for name, poses in (
            (NOTHING, [None] * len(sample.pictures)),
            (known.name, known.poses(sample)),
            (fit.proposal.name, fit.proposal.poses(sample)),
        )
    )
    gained, gains = before.total - nothing.total, after.total - nothing.total
    return search_for(sample, fit) if gains > _AS_WELL * gained else None


def _by_stretch(search: Search, turn: Floats, times: Floats, pictures: Sequence[Image | None]) -> Floats | None:
    """Return the motion (n,) of the body as it looks in frames through which it turns without a jump.

    ``None`` where it never jumps, or the pictures are not at hand.
    """
    seen = np.flatnonzero(np.isfinite(turn))
    if not pictures or len(seen) < _FEWEST:
        return None
    change = np.abs(np.append(0.0, changes(turn[seen], times[seen])[0]))
    jumps = np.flatnonzero(change > max(_JUMP * float(np.median(change)), APART_PX / search.arm))
    runs = [run for run in np.split(seen, jumps + 1) if len(run) >= _FEWEST]
    if len(jumps) == 0 or not runs:
        return None
    longest = max(runs, key=lambda run: float(np.ptp(np.unwrap(turn[run]))))
    some = longest[np.unique(np.linspace(0, len(longest) - 1, len(search.sample.frames)).round().astype(int))]
    near = _learnt_from(some, search, turn, pictures)
    if near is None:
        return None
    again = [[] if p is None else candidates(near, in_grey_levels(p)) for p in pictures]
    return chosen(again, times, near).turn


def _learnt_from(
    some: NDArray[np.int64], search: Search, turn: Floats, pictures: Sequence[Image | None]
) -> Search | None:
    """Return a search for the body as some frames show it, if it moves in them as all turns (n,) say."""
    shown = [in_grey_levels(picture) for k in some if (picture := pictures[k]) is not None]
    sample = replace(search.sample, pictures=np.stack(shown), frames=some)
    fit = refine(sample, replace(search.fit.proposal, turn=turn[some]))
    return None if fit is None else search_for(sample, fit)
