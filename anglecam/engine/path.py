"""The most probable way through the turns that a body may have in each frame, if it goes on as it went before.

The change of its speed from frame to frame has a distribution with long tails (Cauchy): mostly small, and sometimes
sudden. So have its steps: most are no longer than most others of the film. The cost of a way is found by dynamic
programming over the turns of two neighbouring frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import special

from anglecam.data.typing import Flags, Floats

_TURN = 2.0 * np.pi
_FAST = np.pi / 3.0
"""Standard deviation of a step between frames, rad: of steps that look alike, as of a wheel's spokes, the shorter."""
_MOST = 0.9
"""Share of the steps that are no longer than the scale of their distribution."""
_SAME = 6.0
"""Multiple of the resolution by which two steps are other ones."""
_ROUNDS = 3
"""Of the way and of the usual change along it."""
_SEEN = float(special.logit(0.95))
"""Logarithm of the odds that a body is seen in a frame, before anything is known of it."""


def steadiest_path(
    turns: Sequence[Floats], gains: Sequence[Floats], times: Floats, resolution: float
) -> tuple[NDArray[np.int64], Floats]:
    """Choose one turn in each frame that has any.

    Parameters
    ----------
    turns, gains : sequence of ndarray
        For each of n frames (m,) turns, rad, and their log likelihoods, nats; any number of them.
    times : ndarray
        (n,) s.
    resolution : float
        Change of a turn that counts as none, rad.

    Returns
    -------
    path : ndarray
        (n,) index of the turn; -1 in a frame without any, or where the body is more probably hidden.
    margin : ndarray
        (n,) nats by which the best way with another step to that frame, or from it, is less probable; infinite without
        another. A way that leads through the look-alikes of all its turns has the same steps.
    """
    path, margin = np.full(len(turns), -1), np.full(len(turns), np.inf)
    used = [k for k, of_frame in enumerate(turns) if len(of_frame)]
    if len(used) < 3:
        for k in used:
            path[k] = int(np.argmax(gains[k]))
        return path, margin
    angle, gain, time = [turns[k] for k in used], [gains[k] for k in used], times[used]
    steps = [wrapped(b[None, :] - a[:, None]) for a, b in pairwise(angle)]
    scale, longest = resolution, _FAST
    for _ in range(_ROUNDS):
        order, apart = _least_cost(steps, gain, time, (scale, longest), resolution)
        way = np.array([a[k] for a, k in zip(angle, order, strict=True)])
        scale = max(resolution, _usual_change(way, time))
        longest = max(resolution, float(np.quantile(np.abs(wrapped(np.diff(way))), _MOST)))
    chosen = np.array([g[k] for g, k in zip(gain, order, strict=True)])
    hidden = _hidden(way, chosen, time, (scale, longest), resolution)
    path[used], margin[used] = np.where(hidden, -1, order), np.where(hidden, np.inf, apart)
    return path, margin


def unsteadiness(turn: Floats, time: Floats, resolution: float) -> float:
    """Return the mean cost of the changes along a way (n,), rad, NaN where it is unknown, at times (n,), s."""
    seen = np.isfinite(turn)
    if seen.sum() < 3:
        return np.inf
    change, ratio = changes(turn[seen], time[seen])
    return float(np.log1p((change / (resolution * np.maximum(1.0, ratio))) ** 2).mean())


def changes(turn: Floats, time: Floats) -> tuple[Floats, Floats]:
    """Return how much the steps of a way (n,), rad, change, and how long each lasts, as multiples of the one before it.

    A step changes from what the speed before it would give. Both are (n - 2,); the first in rad, within half a turn.
    """
    step, lasts = wrapped(np.diff(turn)), np.diff(time)
    ratio = lasts[1:] / lasts[:-1]
    return wrapped(step[1:] - step[:-1] * ratio), np.asarray(ratio)


def most_from_motion(resolution: float) -> float:
    """Return how many nats the motion can say for one turn in a frame and against another one, at most.

    A turn has a part in three changes of the speed and in two steps.
    """
    longest = float(np.log1p((np.pi / resolution) ** 2))
    return 3.0 * longest + 2.0 * (longest + 0.5 * (np.pi / _FAST) ** 2)


def _hidden(turn: Floats, gain: Floats, time: Floats, scales: tuple[float, float], resolution: float) -> Flags:
    """Return (n,) frames in which the body is more probably hidden than where the way leads.

    The way there and back again costs more than it gains: something else looks a little like the body.
    """
    seen = np.ones(len(turn), bool)
    while seen.sum() > 4:
        at = np.flatnonzero(seen)
        jumps = np.flatnonzero(np.abs(wrapped(np.diff(turn[at]))) > _SAME * resolution) + 1
        runs = [run for run in np.split(np.arange(len(at)), jumps) if len(run) < len(at) - 2]
        costs = [_cost_without(run, turn[at], gain[at], time[at], scales) for run in runs]
        best = int(np.argmin(costs)) if costs else 0
        if not costs or costs[best] >= 0.0:
            break
        seen[at[runs[best]]] = False
    return ~seen


def _cost_without(
    run: NDArray[np.int64], turn: Floats, gain: Floats, time: Floats, scales: tuple[float, float]
) -> float:
    """Return how much more the way costs if the body is hidden in a run of frames; less than 0 if it is."""
    around = np.arange(max(0, run[0] - 2), min(len(turn), run[-1] + 3))
    without = np.setdiff1d(around, run)
    motion = _motion_cost(turn[without], time[without], scales) - _motion_cost(turn[around], time[around], scales)
    return motion + float((gain[run] + _SEEN).sum())


def _motion_cost(turn: Floats, time: Floats, scales: tuple[float, float]) -> float:
    step = wrapped(np.diff(turn))[:, None, None]
    triples = zip(step[:-1], step[1:], range(len(step) - 1), strict=True)
    return float(sum(_change_cost(a, b, time[k : k + 3], *scales).sum() for a, b, k in triples))


def _least_cost(
    steps: list[Floats], gain: list[Floats], time: Floats, scales: tuple[float, float], resolution: float
) -> tuple[list[int], Floats]:
    """Return the turns of the way of least cost, and for each by how much the best way with another step costs more."""
    n = len(gain)
    # the cost of ways that end with a pair of turns in frames k and k + 1, and that begin with it
    until = [-gain[0][:, None] - gain[1][None, :]]
    arrived: list[NDArray[np.int64]] = []
    for k in range(1, n - 1):
        cost = until[-1][:, :, None] + _change_cost(steps[k - 1], steps[k], time[k - 1 : k + 2], *scales)
        arrived.append(cost.argmin(axis=0))
        until.append(cost.min(axis=0) - gain[k + 1][None, :])
    since = [np.zeros((len(gain[-2]), len(gain[-1])))]
    for k in range(n - 2, 0, -1):
        change = _change_cost(steps[k - 1], steps[k], time[k - 1 : k + 2], *scales)
        since.append((change + (since[-1] - gain[k + 1][None, :])[None]).min(axis=2))
    since.reverse()
    a, b = np.unravel_index(int(until[-1].argmin()), until[-1].shape)
    order = [int(b), int(a)]
    for k in range(n - 3, -1, -1):
        order.append(int(arrived[k][order[-1], order[-2]]))
    order.reverse()
    apart = np.full(n, np.inf)
    for k, step in enumerate(steps):
        other = np.abs(wrapped(step - step[order[k], order[k + 1]])) > _SAME * resolution
        if other.any():
            cost = until[k] + since[k]
            more = float(cost[other].min() - cost[order[k], order[k + 1]])
            apart[k : k + 2] = np.minimum(apart[k : k + 2], more)
    return order, apart


def wrapped(turn: Floats | float) -> Floats:
    """Return angles, rad, within half a turn of zero."""
    return np.asarray((turn + np.pi) % _TURN - np.pi)


def middle(turn: Floats) -> float:
    """Return the median of angles (n,), rad, which may lie around a circle: of their distances from their direction."""
    around = float(np.arctan2(np.median(np.sin(turn)), np.median(np.cos(turn))))
    return around + float(np.median(wrapped(turn - around)))


def _change_cost(before: Floats, after: Floats, time: Floats, scale: float, longest: float) -> Floats:
    """Return (a, b, c) cost of the step (b, c) after the step (a, b); a step may lead around either way."""
    first, second = time[1] - time[0], time[2] - time[1]
    expected = before[:, :, None] * (second / first)
    change = wrapped(after[None] - expected) / (scale * max(1.0, second / first))
    step = np.log1p((after / longest) ** 2) + 0.5 * (after / _FAST) ** 2
    return np.asarray(np.log1p(change**2) + step[None])


def _usual_change(angle: Floats, time: Floats) -> float:
    """Return the median change of the steps between turns, rad."""
    step = wrapped(np.diff(angle)) / np.diff(time)
    return float(np.median(np.abs(wrapped(np.diff(step) * np.diff(time)[1:]))))
