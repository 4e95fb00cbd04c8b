"""The head's turn from all that is rigid on it: many small patches, each learnt from the clip itself.

A coarse angle, good to a few hundredths of a pixel, lets the frames be turned back onto one another. What then stands
still is the head; where it has edges, it has information. The best tiles are learnt (`anglecam.vision.registration.appearance`), and each
frame's turn is the one at which they fit best, by Gauss and Newton, weighted by their noise.

What the tiles say of one turn scatters more than their pixels' noise alone would make it: codecs err in blocks, light
is not quite a slow gain. That scatter between tiles, the Birge ratio (Birge 1932), multiplies the uncertainty. It does
not show what errs alike on the whole head: where a codec copies pixels from the frame before, the copy hides a turn
that is too small for its quantiser.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import rotation
from anglecam.vision.registration.appearance import HIDDEN_MISFIT, TileAppearance, TileFit, compare_tiles
from anglecam.vision.registration.tiles import TILE_SIDE_PX, FrameView, MotionPlane, view_tiles

_STEPS = 3
"""Of Gauss and Newton, at most."""
_SETTLED = 1e-6
"""A step below this ends them, rad."""
_TRUST = 3.0
"""Degrees of freedom that the whole clip's scatter has against a single frame's."""
_DIMMED = 0.5
"""Departure of a view's contrast from the look's that no light makes."""
_BETTER = 0.6
"""Misfit of another turn over that of the guess below which the guess is wrong."""
_COPY = 0.13
"""What a codec's copy hides, as a share of the turn whose change of the picture equals the tiles' misfit: films with
known angles, encoded by x264 at crf 18, have 0.11 to 0.17; at crf 28 up to 0.24, more than this tells of."""


@dataclass(frozen=True)
class BodyAppearance:
    """The head as it was learnt."""

    patches: TileAppearance
    heights: Floats
    """(tiles,) px."""
    plane: MotionPlane
    pivot_px: Floats
    """(2,) centre of rotation in the reference frame, px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    variance: Floats
    """(tiles,) mean square of what each tile leaves over, grey levels squared."""
    groups: NDArray[np.intp]
    """(tiles,) which of them lie together."""
    birge: float
    """Scatter between groups over what the pixels' noise would make it; at least 1."""
    absorbed_share: float
    """Share of an error of the turns, one that goes with the turn itself, that the looks would have adapted to: well
    below 1 where the head was seen in many poses between its extremes."""
    middle_px: Floats
    """(2,) of the tiles, each by its information, in the reference frame, px."""

    def row_of_middle(self, glimpse: FrameView) -> float:
        """Return the row of the picture in which a frame shows the middle."""
        arm = (self.middle_px - self.pivot_px) @ rotation(glimpse.turn)
        return float(self.plane.lens.distort(glimpse.pivot_px + arm)[1])


@dataclass(frozen=True)
class TurnEstimate:
    """One frame's turn."""

    turn: float
    """rad; NaN where too little of the head is to be seen."""
    noise: float
    """Standard uncertainty from the pixels' noise, rad; another frame's is its own."""
    pose: float
    """Standard uncertainty from what goes with the place on the pixel grid, rad: codec, light; the same at the same."""
    pivot_sensitivity: Floats
    """(2,) change of the turn with an error of the pivot, rad/px."""


NO_TURN = TurnEstimate(np.nan, np.nan, np.nan, np.full(2, np.nan))


def find_turn(look: BodyAppearance, glimpse: FrameView, before: Image | None = None) -> TurnEstimate:
    """Find one frame's turn.

    Parameters
    ----------
    look : Look
        From `anglecam.vision.registration.learn.learn`.
    glimpse : Glimpse
        With the coarse turn, and the pivot on the same ground as ``look.pivot_px``.
    before : ndarray, optional
        The frame before it, where the codec may have copied from there.

    Returns
    -------
    Turn
        With the uncertainty that its own noise, the scatter between tiles, and copies give it.
    """
    views, places = view_tiles(look.patches.corners, look.heights, [glimpse], look.plane, look.pivot_px)
    centres = look.pivot_px + look.heights[:, None] * look.plane.lens.parallax
    turn = glimpse.turn
    for _ in range(_STEPS):
        fit = compare_tiles(look.patches, views, np.full(len(look.patches), turn), centres)
        mean_square = np.where(fit.count > 0, fit.squares / np.maximum(fit.count, 1), np.inf)
        # motion blur and the like spoil all tiles alike, a hand or a hair only some
        usual = float(np.median(mean_square / look.variance))
        clear = (mean_square < HIDDEN_MISFIT * max(usual, 1.0) * look.variance) & ~covered_views(fit)
        if not clear.any() or not np.isfinite(usual):
            return NO_TURN
        each = fit.weighted(np.where(clear, look.variance * max(usual, 1.0), np.inf))
        normal, gradient = each[0].sum(axis=0), each[1].sum(axis=0)
        by_pixels = 1.0
        if glimpse.wander_px2 is not None:
            normal, gradient, by_pixels = _wandering(normal, gradient, glimpse.wander_px2)
        if not normal[0, 0] > 0.0:  # nothing of what is clear tells a turn: it has left the picture
            return NO_TURN
        step = gradient[0] / normal[0, 0]
        turn += step
        if abs(step) < _SETTLED:
            break
    pull = -normal[0, 1:] @ (np.eye(2) - rotation(turn)) / normal[0, 0]
    noise = 1 / float(np.sqrt(normal[0, 0]))
    # a frame that a codec spoils more than others shows it in its own tiles, as far as so few can tell
    total, freedom = group_scatter(each[0][:, None], each[1][:, None], look.groups)
    birge2 = (_TRUST * look.birge**2 + total) / (_TRUST + max(freedom - 1, 0))
    pose2 = by_pixels * noise**2 * max(birge2 - 1, 0.0)
    if before is not None:
        misfit = noise * np.sqrt(by_pixels * fit.count[clear].sum())
        pose2 += (_COPY * _copied(glimpse.image, before, places[clear]) * misfit) ** 2
    return TurnEstimate(float(turn), noise, float(np.sqrt(pose2)), pull)


def _wandering(normal: Floats, gradient: Floats, covariance_px2: Floats) -> tuple[Floats, Floats, float]:
    """Let the pivot lie where the frame wants it, as far as is known where it is: eliminate its displacement.

    Its covariance is taken to be the same in all directions, so that the head's turn does not matter. Tell too which
    share of the turn's variance is the pixels' and not the pivot's.
    """
    known = 1.0 / max(float(np.trace(covariance_px2)) / 2.0, 1e-9)
    free = normal[1:, 1:] + known * np.eye(2)
    taken = np.linalg.solve(free, np.column_stack([normal[1:, :1], gradient[1:]]))
    told = normal.copy()
    told[0, 0] -= normal[0, 1:] @ taken[:, 0]
    told[0, 1:] = known * taken[:, 0]
    pulled = gradient.copy()
    pulled[0] -= normal[0, 1:] @ taken[:, 1]
    by_pixels = 1.0 - known * float(taken[:, 0] @ taken[:, 0]) / float(told[0, 0])
    return told, pulled, by_pixels


def refine_doubtful_turn(look: BodyAppearance, glimpse: FrameView, reach_px: float) -> FrameView:
    """Try turns about a doubtful one, a pixel apart at the tiles' middle, and start from the one that fits best.

    Parameters
    ----------
    look : Look
        From `anglecam.vision.registration.learn.learn`.
    glimpse : Glimpse
        With a turn that may be wrong.
    reach_px : float
        How far to try to either side, px.

    Returns
    -------
    Glimpse
        With another turn.
    """
    centres = look.pivot_px + look.heights[:, None] * look.plane.lens.parallax
    step = 1.0 / float(np.hypot(*(look.middle_px - look.pivot_px)))
    tries = [replace(glimpse, turn=glimpse.turn + k * step) for k in range(-int(reach_px), int(reach_px) + 1)]

    def misfit(one: FrameView) -> float:
        views, _ = view_tiles(look.patches.corners, look.heights, [one], look.plane, look.pivot_px)
        fit = compare_tiles(look.patches, views, np.full(len(look.patches), one.turn), centres)
        seen = fit.count > 0
        return float(np.median(fit.squares[seen] / fit.count[seen] / look.variance[seen])) if seen.any() else np.inf

    misfits = [misfit(one) for one in tries]
    best = int(np.argmin(misfits))
    # a smeared head fits nowhere well: there the guess is not overruled
    return tries[best] if misfits[best] < _BETTER * misfits[len(tries) // 2] else glimpse


def covered_views(fits: TileFit) -> NDArray[np.bool_]:
    """Tell which views show something else, however flat: it fits any look that is dimmed to nothing."""
    return np.asarray((np.abs(fits.light[..., 0]) > _DIMMED).any(axis=-1))


def group_scatter(normal: Floats, gradient: Floats, groups: NDArray[np.intp]) -> tuple[float, int]:
    """Sum the squares of what groups of tiles say against the common turn, in units of their noise; and count them.

    Neighbours share a codec's blocks and err together: only what lies apart tells.
    """
    total, count = 0.0, 0
    for group in np.unique(groups):
        known, pull = normal[groups == group, :, 0, 0].sum(axis=0), gradient[groups == group, :, 0].sum(axis=0)
        seen = known > 0
        total += float((pull[seen] ** 2 / known[seen]).sum())
        count += int(seen.sum())
    return total, count


def _copied(image: Image, before: Image, centres_px: Floats) -> float:
    """Return the share of the tiles' pixels that are what they were a frame before."""
    half = TILE_SIDE_PX // 2
    shares = []
    for x, y in centres_px.round().astype(int):
        part = np.s_[max(y - half, 0) : y + half, max(x - half, 0) : x + half]
        if image[part].size:
            shares.append(float((image[part] == before[part]).mean()))
    return float(np.mean(shares)) if shares else 0.0
