"""Find the scenery in the picture, and how it moves where the camera moves.

Small windows with edges are tracked from the first of a few frames into the others
(`anglecam.vision.stabilise.windows`). The scenery is the group of windows that keep their relative places in all
frames: one shift and one roll for each frame displace all of them. A rotating body keeps its shape too. Of such groups,
the one that rotates less is the scenery.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
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

_MAX_DEVIATION = 9.0
"""Squared deviation, in tolerances, beyond which a larger one counts no more."""
_MIN_SEEN = 0.7
"""Least share of the frames in which a window must follow the motion; something may hide it in the others."""
_ENOUGH = 12
"""Number of windows. Where so many follow the motion in a larger share of the frames, that share is required of all."""
_SHARE_MARGIN = 0.05
"""Margin by which a window may fall short of that larger share."""
_MIN_WINDOWS = 5
"""Fewest windows that form scenery."""
_MIN_WEIGHT = 0.25
"""Weight, relative to the heaviest group, from which on a group that rotates less may be the scenery."""
_ALIKE, _ALIKE_ROLL = 1.5, 0.001
"""Ratio, and absolute margin in rad, by which the scatter of two groups' rolls may differ to count as equal."""
_CELLS = 6
"""Squares across the picture; the best corner in each is tried as a seed."""
_BASELINE_PX = 60.0
"""Least distance of two windows from which a roll is computed, px."""
_STRETCH_PX = 0.5
"""Change of the distance between two windows, px, that excludes that they belong to one body."""
_MAX_ROLL = np.radians(4.0)
"""Largest roll from the first frame to any other, rad; whatever rolls more is a mechanism and not the scenery."""
_STILL_PX = 0.05
"""RMS displacement up to which the camera counts as standing still, px."""
_SIGNIFICANT = 3.0
"""Standard uncertainties by which the displacement must exceed it."""
_PICTURE_PX = 300.0
"""Distance from the origin within which a centre of roll is expected, px."""
_SURROUNDING_AREA, _SURROUNDING_SHARE = 0.4, 0.6
"""Least share of the picture that the windows' hull covers, and of all windows that belong to them, for the group to
be scenery even if it only rolls around a fixed point. A body that turns leaves scenery beside it, which has the
windows."""
_ENCLOSED_SHARE = 0.5
"""Least share of the other windows inside the hull for a smaller group to be scenery that rolls, where hardly any
window stands still: a large body has the others."""
_ROUNDS = 8
_MIN_INFORMATION = 0.5
"""Least share of the windows' information, in every direction, that a frame must show; less may agree by chance."""
_STEPS = 3
"""Weighted least-squares steps from the best guess."""


@dataclass(frozen=True)
class Scenery:
    """The windows that move only with the camera, and the camera's motion."""

    centres_px: Floats
    """(windows, 2) in the first frame, px."""
    metric: Floats
    """(windows, 2, 2) by which a distance counts: 1 across the main edge, less or nothing along it."""
    information: Floats
    """(windows,) mean square slope of brightness across the main edge, (grey levels/px)²."""
    origin_px: Floats
    """(2,) point around which the picture is taken to roll, px."""
    shifts_px: Floats
    """(frames, 2) of the origin, from the first frame, px; NaN where most of the scenery is hidden."""
    rolls: Floats
    """(frames,) counter-clockwise as seen, rad; NaN where the shift is."""
    scatter_px: float
    """Standard deviation of the windows from their expected places, px."""
    surrounds: bool
    """Whether the windows are most of those in the picture, and all around, or enclose those of a body."""

    @property
    def shakes(self) -> bool:
        """Whether the picture moves significantly.

        A mere roll around a fixed point counts only where the scenery surrounds whatever else moves: a body that turns
        looks the same.
        """
        if self.surrounds:
            arms = self.centres_px - self.origin_px
            swept = float(np.nanstd(self.rolls) * np.sqrt((arms**2).sum(axis=1).mean()))
            if swept > _STILL_PX + _SIGNIFICANT * self.scatter_px / np.sqrt(len(arms)):
                return True
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
        return bool((rms > _STILL_PX + _SIGNIFICANT * np.sqrt(np.diag(place))).any())


def find_scenery(pictures: Sequence[Image]) -> Scenery | None:
    """Find the group of windows that keeps its shape and rotates least.

    Parameters
    ----------
    pictures : sequence of ndarray
        (h, w) brightness of frames spread over a clip.

    Returns
    -------
    Scenery or None
        ``None`` where too few windows move together.
    """
    if len(pictures) < 2:
        return None
    levelled = [subtract_local_mean(picture) for picture in pictures]
    centres, tensor = find_windows(pictures[0], pixel_noise(levelled))
    if len(centres) < _MIN_WINDOWS:
        return None
    moved = np.stack([follow_windows(levelled[0], picture, centres) for picture in levelled], axis=1)
    metric, information = edge_metric(tensor)
    seeds = _seeds(centres, tensor, pictures[0].shape[1] / _CELLS)
    shifted = _best((moved[seed] for seed in seeds), moved, metric)
    rolled = _best(_motions_of_pairs(centres, moved, seeds), moved, metric)
    starts = (motion for motion in (shifted, rolled) if motion is not None)
    origin, rolls, off = _least_rotating([_grow(centres, moved, metric, start) for start in starts])
    weight = _weight(off)
    open_frames = weight @ (off < 1.0) > _MIN_INFORMATION * weight.sum()
    share = (off[:, open_frames] < 1.0).mean(axis=1) if open_frames.any() else np.zeros(len(off))
    group = share >= max(_MIN_SEEN, float(np.sort(share)[-min(_ENOUGH, len(share))]) - _SHARE_MARGIN)
    if group.sum() < _MIN_WINDOWS or np.linalg.eigvalsh(metric[group].sum(axis=0))[0] < 1.0:
        return None
    close = off[group][off[group] < 1.0]
    scatter = TOLERANCE_PX * float(np.sqrt(close.mean()))
    still = (squared_deviations(moved, metric) < 1.0).mean(axis=1) >= _MIN_SEEN
    surrounds = _surrounds(centres[group], centres[~group], int(still.sum()), pictures[0].size)
    nowhere = np.empty((0, 2))
    found = Scenery(centres[group], metric[group], information[group], origin, nowhere, rolls, scatter, surrounds)
    each = [scenery_motion(found, moved[group, k]) for k in range(len(pictures))]
    found = replace(found, shifts_px=np.array([shift for shift, _ in each]), rolls=np.array([roll for _, roll in each]))
    seen = np.isfinite(found.rolls)
    return found if seen.mean() > _MIN_SEEN and np.abs(found.rolls[seen]).max() < _MAX_ROLL else None


def scenery_motion(scenery: Scenery, moved: Floats) -> tuple[Floats, float]:
    """Find one frame's motion from its windows' displacements, most of which are correct.

    Parameters
    ----------
    scenery : Scenery
        Its rolls give the range in which the frame's roll is searched for.
    moved : ndarray
        (windows, 2) from `follow_windows`, px.

    Returns
    -------
    tuple
        Shift (2,) of the origin, px, and roll, rad; NaN where too few of the windows follow any motion.
    """
    arms, moved = scenery.centres_px - scenery.origin_px, moved[:, None]
    low, high = float(np.nanmin(scenery.rolls)), float(np.nanmax(scenery.rolls))
    step = TOLERANCE_PX / float(np.hypot(*arms.T).max())
    tried = np.repeat(np.linspace(low, high, 1 + int((high - low) / step)), len(arms))
    shifts = np.tile(moved[:, 0], (len(tried) // len(arms), 1)) - np.concatenate(
        [displacements(arms, np.zeros((1, 2)), tried[k : k + 1])[:, 0] for k in range(0, len(tried), len(arms))]
    )
    off = squared_deviations(moved - displacements(arms, shifts, tried), scenery.metric)
    best = int(np.exp(-np.minimum(off, _MAX_DEVIATION)).sum(axis=0).argmax())
    shift, roll = shifts[best : best + 1], tried[best : best + 1]
    for _ in range(_STEPS):
        off = squared_deviations(moved - displacements(arms, shift, roll), scenery.metric)
        shift, roll = fit_motion(arms, moved, scenery.metric, np.exp(-np.minimum(off, _MAX_DEVIATION)), shift, roll)
    off = squared_deviations(moved - displacements(arms, shift, roll), scenery.metric)
    following = (off[:, 0] < 1.0)[:, None, None] * scenery.metric
    shares = np.linalg.eigvals(np.linalg.solve(scenery.metric.sum(axis=0), following.sum(axis=0)))
    if shares.min() < _MIN_INFORMATION:
        return np.full(2, np.nan), float("nan")
    return shift[0], float(roll[0])


def _surrounds(centres: Floats, others: Floats, still: int, area_px2: int) -> bool:
    """Return whether scenery is all around: most of all windows, or around those of a body where few stand still."""
    hull = cv2.convexHull(centres.astype(np.float32))
    if len(centres) >= _SURROUNDING_SHARE * (len(centres) + len(others)):
        return bool(cv2.contourArea(hull) >= _SURROUNDING_AREA * area_px2)
    enclosed = [cv2.pointPolygonTest(hull, (float(x), float(y)), False) >= 0.0 for x, y in others]
    return still < _MIN_WINDOWS and len(centres) < len(others) and float(np.mean(enclosed)) >= _ENCLOSED_SHARE


def _seeds(centres: Floats, tensor: Floats, cell_px: float) -> NDArray[np.intp]:
    """Return the best corner of every cell of the picture; a corner determines the motion in both directions."""
    corner = np.linalg.eigvalsh(tensor)[:, 0]
    order = np.argsort(-corner)
    _, first = np.unique((centres[order] // cell_px).astype(int), axis=0, return_index=True)
    return order[first]


def _motions_of_pairs(centres: Floats, moved: Floats, seeds: NDArray[np.intp]) -> Iterator[Floats]:
    """Yield the picture's motion (windows, frames, 2), px, from every pair of seeds that keep their distance."""
    for a, b in itertools.combinations(seeds, 2):
        apart = centres[b] - centres[a]
        now = apart + moved[b] - moved[a]
        length = float(np.hypot(*apart))
        if length < _BASELINE_PX or np.mean(np.abs(np.hypot(*now.T) - length) < _STRETCH_PX) < _MIN_SEEN:
            continue
        rolls = np.arctan2(apart[1] * now[:, 0] - apart[0] * now[:, 1], now @ apart)
        if np.quantile(np.abs(rolls), _MIN_SEEN) < _MAX_ROLL:
            yield displacements(centres - (centres[a] + centres[b]) / 2.0, (moved[a] + moved[b]) / 2.0, rolls)


def _best(motions: Iterable[Floats], moved: Floats, metric: Floats) -> Floats | None:
    """Return the motion that the largest weight of windows follows."""
    return max(motions, key=lambda motion: _weight(squared_deviations(moved - motion, metric)).sum(), default=None)


def _least_rotating(groups: list[tuple[Floats, Floats, Floats]]) -> tuple[Floats, Floats, Floats]:
    """Return the group that rotates least of those with enough weight; of equal ones the heaviest."""
    weights = [_weight(off).sum() for _, _, off in groups]
    heavy = [(w, group) for w, group in zip(weights, groups, strict=True) if w >= _MIN_WEIGHT * max(weights)]
    least = min(float(np.std(rolls)) for _, (_, rolls, _) in heavy)
    quiet = [(w, group) for w, group in heavy if np.std(group[1]) <= _ALIKE * least + _ALIKE_ROLL]
    return max(quiet, key=lambda pair: pair[0])[1]


def _weight(off: Floats) -> Floats:
    """Return each window's weight (windows,) between 0 and 1 from its squared deviations (windows, frames)."""
    return np.exp(-np.minimum(off, _MAX_DEVIATION).mean(axis=1))


def _grow(centres: Floats, moved: Floats, metric: Floats, start: Floats) -> tuple[Floats, Floats, Floats]:
    """Refit the motion to all windows that follow it; return origin, rolls, and every window's squared deviations."""
    start = np.broadcast_to(start, moved.shape)
    off = squared_deviations(moved - start, metric)
    weight = _weight(off)
    origin = weight @ centres / weight.sum()
    arms = centres - origin
    shifts, rolls = np.einsum("n,nka->ka", weight, start) / weight.sum(), np.zeros(moved.shape[1])
    for _ in range(_ROUNDS):
        each = weight[:, None] * np.exp(-np.minimum(off, _MAX_DEVIATION))
        shifts, rolls = fit_motion(arms, moved, metric, each, shifts, rolls)
        off = squared_deviations(moved - displacements(arms, shifts, rolls), metric)
        weight = _weight(off)
    return origin, rolls, off
