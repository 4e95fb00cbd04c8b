"""Frames that show the one before again: a camera or a converter that had no new picture repeats the last one.

Bit for bit equal pictures are no proof, because a codec repeats what does not change. Nor are different pictures proof
of the contrary: a converter encodes the repeated picture anew, and a filter adds new noise to it. So the motion
decides: the angle stands still, within its noise, between frames in which it moves, and a smooth curve through the
frames around passes elsewhere. A mechanism that pauses for one frame only is taken for a repeated frame as well,
because no picture can tell the two apart; nothing is then stated for the frame.
"""

from __future__ import annotations

import numpy as np

from anglecam.data.typing import Flags, Floats

_MOVING = 5.0
"""Change of the angle from frame to frame, in standard deviations of its noise, that is motion."""
_STILL = 4.2
"""The same up to which the angle stands still: three standard deviations of a difference of two."""
_APART = 5.0
"""Distance of a still frame from the smooth curve through the frames around, in their own distances from it (root mean
square), from which it is no part of that motion. Of 300 servos and 300 swings drawn at random (seeds 0 to 299), 90
frames each, with noise of 0.0002° to 0.2°, no frame was flagged wrongly; of 600 others of each (seeds 5000 to 5599),
one frame of 54,000 each."""
_AROUND = 3
"""Frames on either side through which the curve is laid, a cubic polynomial."""
_CATCH_UP = (0.6, 1.6)
"""Share of the missed way that the first new frame must show to tell a longer stop of the film from one of the
mechanism, which goes on as it began, or starts anew."""
_EVEN = 2.0
"""Factor within which the motion is even: a mechanism that comes to rest slows down by more from frame to frame, and
one that starts anew gets faster."""


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
    >>> line = np.array([0.0, 1.0, 2.0, 2.01, 4.0, 5.0, 5.01, 7.0, 8.0, 8.0, 8.0, 8.0])
    >>> duplicate_frames(line, np.full(12, 0.01), np.zeros(12, bool))
    [3, 6]
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
        if count > 1:
            found = before and after and (all_repeated or _caught_up(step, first, last))
        else:
            # an equal picture at the end of a motion, or at its turning point, is a repeated one
            found = all_repeated and (before or after)
            found = found or (before and after and _apart(line, still, first, _MOVING * float(noise[first])))
        if found:
            rows.extend(range(first, last + 1))
    return rows


def _caught_up(step: Floats, first: int, last: int) -> bool:
    """Return whether the first step after a stop makes good for it, and the motion then goes on as before the stop."""
    before, after = step[first - 1], step[last + 1]
    missed = (last - first + 1) * before
    earlier, later = step[first - 2], step[min(last + 2, len(step) - 1)]
    even = abs(earlier) < _EVEN * abs(before) and _EVEN * abs(later) < abs(after)
    return bool(even and _CATCH_UP[0] < (after - before) / missed < _CATCH_UP[1])


def _apart(line: Floats, still: Flags, frame: int, least: float) -> bool:
    """Return whether a frame is no part of the smooth motion through the others around it."""
    others = np.flatnonzero(~still & np.isfinite(line))
    place = int(np.searchsorted(others, frame))
    around = others[max(place - _AROUND, 0) : place + _AROUND]
    terms = np.vander(around - float(frame), 4)
    freedom = len(around) - terms.shape[1]
    if freedom < 1:
        return False
    curve = np.linalg.lstsq(terms, line[around], rcond=None)[0]
    rest = np.sqrt(((line[around] - terms @ curve) ** 2).sum() / freedom)
    return bool(abs(line[frame] - curve[-1]) > max(least, _APART * rest))


def _runs(flags: Flags) -> list[tuple[int, int]]:
    """Return the first and last index of each run of flagged frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]
