"""The body's angle in one frame from all that is rigid on it: many small tiles, each learnt from the clip itself.

Coarse angles, accurate to a few hundredths of a pixel at the tiles, allow the frames to be rotated back onto one
another. Whatever then stands still is the body, and its edges carry the information. The best tiles are learnt
(`anglecam.vision.registration.appearance`). Each frame's angle is the one at which they fit best, found by Gauss-Newton
steps and weighted by the tiles' noise.

The tiles' estimates of one angle scatter more than their pixels' noise alone would cause: codecs err in blocks, and the
change of light is not exactly a slowly varying gain. This scatter between tiles, the Birge ratio (Birge 1932),
multiplies the uncertainty. It does not show an error that is common to the whole body: where a codec copies pixels from
the frame before, the copy hides a rotation too small for its quantiser.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import rotation
from anglecam.vision.registration.appearance import HIDDEN_MISFIT, TileAppearance, TileFit
from anglecam.vision.registration.centre_equations import fitted_terms, group_scatter
from anglecam.vision.registration.tile_weights import copied_share, weigh_tiles
from anglecam.vision.registration.tiles import TILE_SIDE_PX, FrameView, MotionPlane, tile_middles, tile_reach
from anglecam.vision.registration.turn_kernel import frame_equations

_MAX_STEPS = 3
"""Gauss-Newton steps."""
_SETTLED = 5.0
"""Step below which the iteration ends, in standard uncertainties. A step leaves about a hundredth of itself (0.6 % in
the median over a film's frames), so 0.05 of an uncertainty at most."""
_NO_GROUND = np.zeros((0, 0, 2))
"""For pictures whose pixels need not be mapped to the plane of motion."""
_NO_IMAGE = np.zeros((0, 0, 1), np.uint8)
_SOME = 3
"""The first step is made by every so many-th tile: it needs no accuracy."""
_APPROACH_PX = 1.0
"""Largest first step that is trusted, px at the tiles' middle: hidden tiles can cause any."""
_CLIP_FREEDOM = 3.0
"""Weight of the whole clip's scatter between groups against a single frame's, in degrees of freedom."""
_MAX_LIGHT_CHANGE = 0.5
"""Relative change of a view's contrast that no light causes."""
_MIN_IMPROVEMENT = 0.6
"""Misfit of another angle relative to that of the guess, below which the guess is replaced."""
_COPY = 0.13
"""Standard uncertainty caused by a codec's copies, as a share of the rotation whose change of the picture equals the
tiles' misfit. Films with known angles, encoded by x264 at crf 18, have 0.11 to 0.17. At crf 28 the share is up to 0.24,
more than is allowed for here."""


@dataclass(frozen=True)
class BodyAppearance:
    """The body as learnt from a clip."""

    tiles: TileAppearance
    heights: Floats
    """(tiles,) towards the camera, px."""
    plane: MotionPlane
    pivot_px: Floats
    """(2,) centre of rotation in the reference frame, px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    centre_covariance_px2: Floats
    """(2, 2) covariance of the tiles' effective common centre, through which the angles depend on all centres, px²."""
    variance: Floats
    """(tiles,) mean squared residual of each tile, grey levels squared."""
    excess: Floats
    """(tiles,) mean square of a tile's displacements in units of its noise; at least 1. A tile whose shape or light the
    model does not describe counts less."""
    groups: NDArray[np.intp]
    """(tiles,) group of neighbours to which each tile belongs."""
    birge: float
    """Birge ratio: scatter between groups over that expected from the pixels' noise; at least 1."""
    wander_px: float
    """Standard deviation of a frame's pivot along each axis, px, where the camera is taken to be at rest; 0 where it
    is, too."""
    absorbed_share: float
    """Share of an error of the angles, proportional to the angle itself, that the appearance would absorb. It is well
    below 1 where the body was seen in many poses between its extremes."""
    middle_px: Floats
    """(2,) mean place of the tiles, weighted by their information, in the reference frame, px."""
    extent_px: float
    """Root mean square distance of the tiles from that place, weighted likewise, px."""

    @cached_property
    def parallax_px(self) -> Floats:
        """(tiles, 2) displacement of the tiles' centres of rotation from the pivot, px."""
        return self.heights[:, None] * self.plane.axis.parallax

    @cached_property
    def splines(self) -> NDArray[np.float32]:
        """(tiles, planes, n, n) the tiles' coefficients in single precision."""
        return self.tiles.coefficients.astype(np.float32)

    @cached_property
    def some_tiles(self) -> BodyAppearance:
        """The body by every `_SOME`-th tile."""
        tiles = self.tiles
        some = replace(
            tiles,
            corners=_some(tiles.corners),
            coefficients=_some(tiles.coefficients),
            gains=_some(tiles.gains),
            leans=_some(tiles.leans),
        )
        return replace(
            self,
            tiles=some,
            heights=_some(self.heights),
            variance=_some(self.variance),
            excess=_some(self.excess),
            groups=_some(self.groups),
        )

    @property
    def lever_px(self) -> float:
        """Distance of the tiles' middle from the pivot, px."""
        return float(np.hypot(*(self.middle_px - self.pivot_px)))

    def middles_in(self, view: FrameView) -> Floats:
        """Return (tiles, 2) places of the tiles' middles in the picture of a frame, px."""
        return tile_middles(self.tiles.corners, self.parallax_px, view, self.plane, self.pivot_px)

    def part_seen(self, turn: float, size: tuple[int, int]) -> tuple[slice, slice]:
        """Return the part of the picture in which `find_turn` looks at pixels, for a camera at rest.

        Parameters
        ----------
        turn : float
            Angle at which the search begins, rad.
        size : tuple of int
            Width and height of the picture, px.

        Returns
        -------
        tuple of slice
            Rows and columns.
        """
        middles = self.middles_in(FrameView(_NO_IMAGE, turn, self.pivot_px))
        reach = max(tile_reach(self.plane), float(TILE_SIDE_PX))
        left, top = np.clip(middles.min(axis=0) - reach, 0, size).astype(int).tolist()
        right, bottom = np.clip(middles.max(axis=0) + reach + 2, 0, size).astype(int).tolist()
        return slice(top, bottom), slice(left, right)

    def compare(self, view: FrameView, turn: float, middles_px: Floats) -> TileFit:
        """Compare the tiles with a frame at an assumed angle.

        Parameters
        ----------
        view : FrameView
            The frame.
        turn : float
            rad.
        middles_px : ndarray
            (tiles, 2) from `middles_in`, for about that angle.

        Returns
        -------
        TileFit
            A row for each tile.
        """
        return TileFit(
            *frame_equations(
                view.image,
                _NO_GROUND if self.plane.lens.is_identity else self.plane.ground,
                middles_px,
                tile_reach(self.plane),
                turn,
                view.turn_per_row,
                view.row,
                view.pivot_px + self.parallax_px,
                self.pivot_px + self.parallax_px,
                self.tiles.corners,
                self.tiles.side,
                self.splines,
                self.tiles.gains,
                self.tiles.parallax,
                self.tiles.leans,
            )
        )

    def row_of_middle(self, view: FrameView) -> float:
        """Return the row of the picture in which a frame shows the middle."""
        arm = (self.middle_px - self.pivot_px) @ rotation(view.turn)
        return float(self.plane.lens.distort(view.pivot_px + arm)[1])


@dataclass(frozen=True)
class TurnEstimate:
    """The body's angle in one frame."""

    turn: float
    """rad; NaN where too little of the body is visible."""
    noise: float
    """Standard uncertainty caused by the pixels' noise, rad; independent from frame to frame."""
    pose: float
    """Standard uncertainty that depends on the place on the pixel grid (codec, light), rad; common to frames in which
    the body is at the same place."""
    pivot_sensitivity: Floats
    """(2,) change of the angle with an error of the pivot, rad/px."""
    misfit: float
    """Median over the tiles of their mean squared residual, relative to the usual one."""
    clear: NDArray[np.bool_]
    """(tiles,) which tiles are visible; none where ``turn`` is NaN."""


NO_TURN = TurnEstimate(np.nan, np.nan, np.nan, np.full(2, np.nan), np.inf, np.zeros(0, bool))
"""For a frame in which the body is not visible."""


def find_turn(body: BodyAppearance, view: FrameView, before: Image | None = None) -> TurnEstimate:
    """Estimate the body's angle in one frame.

    Parameters
    ----------
    body : BodyAppearance
        From `anglecam.vision.registration.learn.learn_appearance`.
    view : FrameView
        The frame with its coarse angle, and its pivot in the plane of ``body.pivot_px``.
    before : ndarray, optional
        The previous frame, where the codec may have copied from it.

    Returns
    -------
    TurnEstimate
        With the uncertainty caused by noise, scatter between tiles, and copies.
    """
    turn = view.turn
    middles = body.middles_in(view)
    approach = _step(body.some_tiles, view, turn, _some(middles))
    if approach is not None and abs(approach.step) * body.lever_px < _APPROACH_PX:
        turn += approach.step
    for _ in range(_MAX_STEPS):
        last = _step(body, view, turn, middles)
        if last is None:
            return NO_TURN
        turn += last.step
        if abs(last.step) < _SETTLED / np.sqrt(last.normal[0, 0]):
            break
    assert last is not None
    normal, clear, pivot = last.normal, last.clear, last.pivot
    information = last.normals[:, 0, 0]
    pivot_sensitivity = -normal[0, 1:] @ (np.eye(2) - rotation(turn)) / normal[0, 0]
    whole = 1 / float(np.sqrt(normal[0, 0]))
    # of this, the part of the pixels' noise: the tiles are weighted by more than their noise
    noise = whole * float(np.sqrt((information / body.excess).sum() / information.sum()))
    # A frame that a codec distorts more than others scatters more between its tiles. So few tiles estimate this only
    # roughly, hence the weighted mean.
    moved = np.array([last.step, *pivot.displacement_px])
    left = last.gradients - last.normals @ moved  # after the last step
    total, count = group_scatter(last.normals[:, None], left[:, None], body.groups)
    freedom = count - fitted_terms(last.normals, body.groups, pivot.covariance)
    total, freedom = total + pivot.squares, freedom + pivot.freedom
    birge2 = (_CLIP_FREEDOM * body.birge**2 + total) / (_CLIP_FREEDOM + max(freedom, 0.0))
    pose2 = pivot.noise_share * max(birge2 * whole**2 - noise**2, 0.0)
    if before is not None:
        misfit = noise * np.sqrt(pivot.noise_share * last.count)
        share = copied_share(view.image, before, middles[clear].round().astype(np.int64), TILE_SIDE_PX // 2)
        pose2 += (_COPY * share * misfit) ** 2
    return TurnEstimate(float(turn), noise, float(np.sqrt(pose2)), pivot_sensitivity, last.usual, clear)


def _some(of_tiles: NDArray[Any]) -> NDArray[Any]:
    """Return every `_SOME`-th row, one after the other in memory, as the compiled functions require."""
    return np.ascontiguousarray(of_tiles[::_SOME])


@dataclass(frozen=True)
class _Step:
    """A Gauss-Newton step."""

    step: float
    """rad."""
    usual: float
    """Median misfit of the tiles."""
    count: int
    """Values in the visible tiles."""
    clear: NDArray[np.bool_]
    """(tiles,) which are visible."""
    normals: Floats
    """(tiles, 3, 3) normal matrices for turn and place, divided by the variances; zero where a tile is not visible."""
    gradients: Floats
    """(tiles, 3) of the same."""
    normal: Floats
    """(3, 3) of all tiles."""
    pivot: _FramePivot
    """Displacement of the frame's pivot."""


@dataclass(frozen=True)
class _FramePivot:
    """What a frame shows of the displacement of its pivot."""

    displacement_px: Floats
    """(2,) most probable after the step; zero where the pivot is known."""
    covariance: Floats
    """(3, 3) of turn and displacement, both unknown, if only the pixels' noise were at work; rad, px."""
    noise_share: float
    """Share of the angle's variance that is caused by the pixels' noise and not by the pivot."""
    squares: float
    """Square of the displacement in units of its prior standard deviation."""
    freedom: float
    """Expected value of that: what of the prior is no information of this frame; between 0 and 2."""


def _step(body: BodyAppearance, view: FrameView, turn: float, middles_px: Floats) -> _Step | None:
    """Return the Gauss-Newton step from an angle, ``None`` where the visible tiles do not determine it."""
    fit = body.compare(view, turn, middles_px)
    usual, clear, normals, gradients = weigh_tiles(
        fit.normal,
        fit.gradient,
        fit.squares,
        fit.count,
        fit.light,
        body.variance,
        body.excess,
        HIDDEN_MISFIT,
        _MAX_LIGHT_CHANGE,
    )
    if not clear.any() or not np.isfinite(usual):
        return None
    normal, gradient = normals.sum(axis=0), gradients.sum(axis=0)
    if not normal[0, 0] > 0.0:  # the body has left the picture
        return None
    known = np.diag([1.0 / float(normal[0, 0]), 0.0, 0.0])
    pivot = _FramePivot(np.zeros(2), known, 1.0, 0.0, 0.0)
    covariance = view.pivot_covariance_px2
    if covariance is None and body.wander_px > 0.0:
        covariance = body.wander_px**2 * np.eye(2)
    if covariance is not None:
        normal, gradient, pivot = _eliminate_pivot(normal, gradient, covariance)
    step = float(gradient[0] / normal[0, 0])
    count = int(fit.count[clear].sum())
    return _Step(step, usual, count, clear, normals, gradients, normal, pivot)


def _eliminate_pivot(normal: Floats, gradient: Floats, covariance_px2: Floats) -> tuple[Floats, Floats, _FramePivot]:
    """Eliminate the displacement of the frame's pivot, whose prior covariance is given, from the normal equations.

    The covariance is taken to be isotropic, so that the body's angle does not matter.

    Returns
    -------
    normal, gradient : ndarray
        (3, 3) and (3,).
    pivot : _FramePivot
        What was eliminated.
    """
    prior = 1.0 / max(float(np.trace(covariance_px2)) / 2.0, 1e-9)
    place = normal[1:, 1:] + prior * np.eye(2)
    solved = np.linalg.solve(place, np.column_stack([normal[1:, :1], gradient[1:]]))
    reduced = normal.copy()
    reduced[0, 0] -= normal[0, 1:] @ solved[:, 0]
    reduced[0, 1:] = prior * solved[:, 0]
    reduced_gradient = gradient.copy()
    reduced_gradient[0] -= normal[0, 1:] @ solved[:, 1]
    noise_share = 1.0 - prior * float(solved[:, 0] @ solved[:, 0]) / float(reduced[0, 0])
    moved = np.asarray(solved[:, 1] - solved[:, 0] * reduced_gradient[0] / reduced[0, 0], float)
    joint = np.asarray(np.linalg.inv(normal + np.diag([0.0, prior, prior])), float)
    freedom = 2.0 - prior * float(np.trace(joint[1:, 1:]))
    return reduced, reduced_gradient, _FramePivot(moved, joint, noise_share, prior * float(moved @ moved), freedom)


def refine_doubtful_turn(body: BodyAppearance, view: FrameView, reach_px: float) -> FrameView:
    """Try angles around a doubtful one, a pixel apart at the tiles' middle, and return the view at the best of them.

    Parameters
    ----------
    body : BodyAppearance
        From `anglecam.vision.registration.learn.learn_appearance`.
    view : FrameView
        With an angle that may be wrong.
    reach_px : float
        Distance to either side that is tried, px.

    Returns
    -------
    FrameView
        With the angle that fits best, or unchanged where no other fits distinctly better.
    """
    step = 1.0 / body.lever_px
    tries = [replace(view, turn=view.turn + k * step) for k in range(-int(reach_px), int(reach_px) + 1)]

    def misfit(tried: FrameView) -> float:
        fit = body.compare(tried, tried.turn, body.middles_in(tried))
        seen = fit.count > 0
        return float(np.median(fit.squares[seen] / fit.count[seen] / body.variance[seen])) if seen.any() else np.inf

    misfits = [misfit(tried) for tried in tries]
    best = int(np.argmin(misfits))
    # A smeared body fits well at no angle: the guess is then kept.
    return tries[best] if misfits[best] < _MIN_IMPROVEMENT * misfits[len(tries) // 2] else view


def covered_views(fits: TileFit) -> NDArray[np.bool_]:
    """Return which views show something else: their contrast departs too far from the tile's.

    The misfit alone does not exclude a featureless object, because it fits any tile that is dimmed to nothing.
    """
    return np.asarray((np.abs(fits.light[..., 0]) > _MAX_LIGHT_CHANGE).any(axis=-1))
