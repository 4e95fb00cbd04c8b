"""Frames that show the one before again: a camera or a converter that had no new picture repeats the last one.

Bit for bit equal pictures are no proof, because a codec repeats what does not change. Nor are different pictures proof
of the contrary: a converter encodes the repeated picture anew, and a filter adds new noise to it. So the motion
decides: the angle stands still, within its noise, between frames in which it moves. A mechanism that pauses for one
frame only is taken for a repeated frame as well, because no picture can tell the two apart; nothing is then stated for
the frame.
"""

from __future__ import annotations

import numpy as np

from anglecam.data.typing import Flags, Floats

_MOVING = 5.0
"""Change of the angle from frame to frame, in standard deviations of its noise, that is motion."""
_STILL = 4.2
"""The same up to which the angle stands still: three standard deviations of a difference of two."""
_CATCH_UP = 0.6
"""Share of the missed way that the first new frame must show to tell a longer stop of the film from one of the
mechanism, which goes on as it began."""


def duplicate_frames(line: Floats, noise: Floats, repeated: Flags) -> list[int]:
    """List the frames that repeat the one before while the mechanism moves.

    Parameters
    ----------
    line : ndarray
        (n,) direction of the line in each frame, rad; NaN where it is not measured.
    noise : ndarray
        (n,) standard deviation of the part of its error that differs from frame to frame, rad.
    repeated : ndarray
        (n,) frames that equal the previous one bit for bit.

    Returns
    -------
    list of int
        Frame numbers.

    Examples
    --------
    >>> line = np.array([0.0, 1.0, 2.0, 2.01, 4.0, 5.0, 5.0, 5.0, 5.0])
    >>> duplicate_frames(line, np.full(9, 0.01), np.zeros(9, bool))
    [3]
    """
    step = np.diff(line, prepend=np.nan)
    with np.errstate(invalid="ignore"):
        still = repeated | (np.abs(step) <= _STILL * noise)
        moving = np.abs(step) > _MOVING * noise
    rows: list[int] = []
    for first, last in _runs(still):
        if first < 2 or last + 1 >= len(line):
            continue
        before, after = bool(moving[first - 1]), bool(moving[last + 1])
        count, all_repeated = last - first + 1, bool(repeated[first : last + 1].all())
        missed = count * abs(step[first - 1])
        caught_up = before and after and abs(step[last + 1]) - abs(step[first - 1]) > _CATCH_UP * missed
        # an even acceleration would give the mean of the steps before and after, which is small at a turning point
        expected = abs(step[first - 1] + step[last + 1]) / 2.0
        skipped = count == 1 and before and after and expected > _MOVING * noise[first]
        # a single equal picture at the end of a motion, or at its turning point, is a repeated one
        if skipped or caught_up or (all_repeated and (before or after if count == 1 else before and after)):
            rows.extend(range(first, last + 1))
    return rows


def _runs(flags: Flags) -> list[tuple[int, int]]:
    """Return the first and last index of each run of flagged frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]
