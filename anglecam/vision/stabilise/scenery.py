"""Which parts of the picture are scenery, and how they move where the camera does not stand still.

Small windows with edges are followed from the first of a few frames into the others (`anglecam.vision.stabilise.windows`). The
scenery is the group of windows that keep their places among one another in all frames: one shift and one roll a frame
carry them all. A nodding head keeps its shape too; of such groups the one that turns less is the scenery.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.stabilise.windows import (
    TOLERANCE_PX,
    displacements,
    edge_metric,
    find_windows,
    fit_motion,
    follow_windows,
    squared_deviations,
    subtract_local_mean,
)

_FAR = 9.0
"""Squared gates from which on farther off is no worse."""
_SEEN = 0.7
"""Least share of the frames in which a window must go along: something may hide it in the others."""
_ENOUGH = 12
"""Windows; where so many go along in more of the frames, so must all, but for a few frames."""
_LESS = 0.05
"""Share of those few."""
_FEWEST = 5
"""Windows that make scenery."""
_SHARE = 0.25
"""Of the weight of the group that keeps its shape best, enough for one that turns less."""
_ALIKE, _ALIKE_ROLL = 1.5, 0.001
"""Groups turn alike whose rolls scatter by this ratio, or by so little, rad."""
_CELLS = 6
"""Squares across the picture, in each of which the best corner is tried as a seed."""
_BASELINE_PX = 60.0
"""Least distance of two windows that tell a roll."""
_STRETCH_PX = 0.5
"""Change of the distance of two windows that are not of one body."""
_MOST_ROLL = np.radians(4.0)
"""From the first frame to any other; a stand that sags more is a mechanism."""
_STILL_PX = 0.05
"""Root mean square displacement up to which a camera stands still."""
_SURE = 3.0
"""Standard uncertainties by which it must be more."""
_PICTURE_PX = 300.0
"""From the origin to where a centre of roll is looked for."""
_ROUNDS = 8
_HALF = 0.5
"""Of what the windows tell in any direction, to be seen in a frame: less may agree by chance."""
_STEPS = 3
"""Of weighted least squares, from the best guess."""


@dataclass(frozen=True)
class Scenery:
    """The windows that stand still but for the camera, and how it carries them."""

    centres_px: Floats
    """(windows, 2) in the first frame, px."""
    metric: Floats
    """(windows, 2, 2) with which a distance counts: 1 across the main edge, less or nothing along it."""
    information: Floats
    """(windows,) mean square slope of brightness across the main edge, (grey levels/px)²."""
    origin_px: Floats
    """(2,) about which the picture is taken to roll, px."""
    shifts_px: Floats
    """(frames, 2) of the origin, from the first frame, px; NaN where most of the scenery is hidden."""
    rolls: Floats
    """(frames,) counter-clockwise as seen, rad; NaN likewise."""
    scatter_px: float
    """Standard deviation of the windows about their places, px."""

    @property
    def shakes(self) -> bool:
        """Whether no point of the picture stays where it is: a mere roll about one does not count. In doubt, not."""
        seen = np.isfinite(self.rolls)
        shifts, rolls = self.shifts_px[seen], self.rolls[seen]
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        none, x, y = displacements(corners, np.zeros((1, 2)), rolls)
        lever = np.stack([x - none, y - none], axis=-1)
        lever, shifts = lever - lever.mean(axis=0), shifts - shifts.mean(axis=0)
        ridge = (_STILL_PX / _PICTURE_PX) ** 2 * len(shifts) * np.eye(2)
        centre = np.linalg.solve(np.einsum("kai,kaj->ij", lever, lever) + ridge, -np.einsum("kai,ka->i", lever, shifts))
        rms = np.sqrt(((shifts + lever @ centre) ** 2).mean(axis=0))
        place = self.scatter_px**2 * np.linalg.inv(self.metric.sum(axis=0))
        return bool((rms > _STILL_PX + _SURE * np.sqrt(np.diag(place))).any())


def find_scenery(pictures: Sequence[Image]) -> Scenery | None:
    """Find what keeps its shape and turns least.

    Parameters
    ----------
    pictures : sequence of ndarray
        (h, w) brightness of frames from all over a clip.

    Returns
    -------
    Scenery or None
        ``None`` where too little goes together.
    """
    if len(pictures) < 2:
        return None
    levelled = [subtract_local_mean(picture) for picture in pictures]
    centres, tensor = find_windows(pictures[0], pixel_noise(levelled))
    if len(centres) < _FEWEST:
        return None
    moved = np.stack([follow_windows(levelled[0], one, centres) for one in levelled], axis=1)
    metric, information = edge_metric(tensor)
    seeds = _seeds(centres, tensor, pictures[0].shape[1] / _CELLS)
    still = _best((moved[seed] for seed in seeds), moved, metric)
    turned = _best(_motions_of_two(centres, moved, seeds), moved, metric)
    origin, rolls, off = _quietest([_grow(centres, moved, metric, one) for one in (still, turned) if one is not None])
    weight = _along(off)
    open_frames = weight @ (off < 1.0) > _HALF * weight.sum()
    share = (off[:, open_frames] < 1.0).mean(axis=1) if open_frames.any() else np.zeros(len(off))
    group = share >= max(_SEEN, float(np.sort(share)[-min(_ENOUGH, len(share))]) - _LESS)
    if group.sum() < _FEWEST or np.linalg.eigvalsh(metric[group].sum(axis=0))[0] < 1.0:
        return None
    close = off[group][off[group] < 1.0]
    scatter = TOLERANCE_PX * float(np.sqrt(close.mean()))
    found = Scenery(centres[group], metric[group], information[group], origin, np.empty((0, 2)), rolls, scatter)
    each = [scenery_motion(found, moved[group, k]) for k in range(len(pictures))]
    found = replace(found, shifts_px=np.array([shift for shift, _ in each]), rolls=np.array([roll for _, roll in each]))
    seen = np.isfinite(found.rolls)
    return found if seen.mean() > _SEEN and np.abs(found.rolls[seen]).max() < _MOST_ROLL else None


def scenery_motion(scenery: Scenery, moved: Floats) -> tuple[Floats, float]:
    """Find one frame's motion from its windows' displacements, most of which are right.

    Parameters
    ----------
    scenery : Scenery
        Whose rolls are those to be expected.
    moved : ndarray
        (windows, 2) from `follow`, px.

    Returns
    -------
    tuple
        Shift (2,) of the origin, px, and roll, rad; NaN where not enough of the windows go along with any.
    """
    arms, moved = scenery.centres_px - scenery.origin_px, moved[:, None]
    low, high = float(np.nanmin(scenery.rolls)), float(np.nanmax(scenery.rolls))
    step = TOLERANCE_PX / float(np.hypot(*arms.T).max())
    tried = np.repeat(np.linspace(low, high, 1 + int((high - low) / step)), len(arms))
    shifts = np.tile(moved[:, 0], (len(tried) // len(arms), 1)) - np.concatenate(
        [displacements(arms, np.zeros((1, 2)), tried[k : k + 1])[:, 0] for k in range(0, len(tried), len(arms))]
    )
    off = squared_deviations(moved - displacements(arms, shifts, tried), scenery.metric)
    best = int(np.exp(-np.minimum(off, _FAR)).sum(axis=0).argmax())
    shift, roll = shifts[best : best + 1], tried[best : best + 1]
    for _ in range(_STEPS):
        off = squared_deviations(moved - displacements(arms, shift, roll), scenery.metric)
        shift, roll = fit_motion(arms, moved, scenery.metric, np.exp(-np.minimum(off, _FAR)), shift, roll)
    off = squared_deviations(moved - displacements(arms, shift, roll), scenery.metric)
    along = (off[:, 0] < 1.0)[:, None, None] * scenery.metric
    if np.linalg.eigvals(np.linalg.solve(scenery.metric.sum(axis=0), along.sum(axis=0))).min() < _HALF:
        return np.full(2, np.nan), float("nan")
    return shift[0], float(roll[0])


def _seeds(centres: Floats, tensor: Floats, cell_px: float) -> NDArray[np.intp]:
    """Pick the best corner of every cell of the picture: they are known in both directions."""
    corner = np.linalg.eigvalsh(tensor)[:, 0]
    order = np.argsort(-corner)
    _, first = np.unique((centres[order] // cell_px).astype(int), axis=0, return_index=True)
    return order[first]


def _motions_of_two(centres: Floats, moved: Floats, seeds: NDArray[np.intp]) -> Iterator[Floats]:
    """Yield the motion of the picture with every two seeds that keep their distance: (windows, frames, 2) px."""
    for a, b in itertools.combinations(seeds, 2):
        apart = centres[b] - centres[a]
        now = apart + moved[b] - moved[a]
        length = float(np.hypot(*apart))
        if length < _BASELINE_PX or np.mean(np.abs(np.hypot(*now.T) - length) < _STRETCH_PX) < _SEEN:
            continue
        rolls = np.arctan2(apart[1] * now[:, 0] - apart[0] * now[:, 1], now @ apart)
        if np.quantile(np.abs(rolls), _SEEN) < _MOST_ROLL:
            yield displacements(centres - (centres[a] + centres[b]) / 2.0, (moved[a] + moved[b]) / 2.0, rolls)


def _best(motions: Iterable[Floats], moved: Floats, metric: Floats) -> Floats | None:
    return max(motions, key=lambda motion: _along(squared_deviations(moved - motion, metric)).sum(), default=None)


def _quietest(groups: list[tuple[Floats, Floats, Floats]]) -> tuple[Floats, Floats, Floats]:
    """Choose of the groups that weigh enough the one that turns least; of those that turn alike the heaviest."""
    weights = [_along(off).sum() for _, _, off in groups]
    heavy = [(w, one) for w, one in zip(weights, groups, strict=True) if w >= _SHARE * max(weights)]
    least = min(float(np.std(rolls)) for _, (_, rolls, _) in heavy)
    quiet = [(w, one) for w, one in heavy if np.std(one[1]) <= _ALIKE * least + _ALIKE_ROLL]
    return max(quiet, key=lambda pair: pair[0])[1]


def _along(off: Floats) -> Floats:
    """Tell from its squared gates how well each window goes along: (windows,) between 0 and 1."""
    return np.exp(-np.minimum(off, _FAR).mean(axis=1))


def _grow(centres: Floats, moved: Floats, metric: Floats, start: Floats) -> tuple[Floats, Floats, Floats]:
    """Let all windows that go along tell the motion; return origin, rolls, and every window's squared gates."""
    start = np.broadcast_to(start, moved.shape)
    off = squared_deviations(moved - start, metric)
    weight = _along(off)
    origin = weight @ centres / weight.sum()
    arms = centres - origin
    shifts, rolls = np.einsum("n,nka->ka", weight, start) / weight.sum(), np.zeros(moved.shape[1])
    for _ in range(_ROUNDS):
        each = weight[:, None] * np.exp(-np.minimum(off, _FAR))
        shifts, rolls = fit_motion(arms, moved, metric, each, shifts, rolls)
        off = squared_deviations(moved - displacements(arms, shifts, rolls), metric)
        weight = _along(off)
    return origin, rolls, off
