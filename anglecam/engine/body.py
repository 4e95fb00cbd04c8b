"""A body by some of its pixels, and how probable its poses are in a frame.

The gain of a pose is the log likelihood of the frame with the body over that without it. It is summed up by parts of
the body: neighbouring pixels are off together, and how much parts contradict each other shows by how much.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.engine.likelihood import pose_gains
from anglecam.engine.target import Picture, Target, rotations

_MOST_PIXELS = 1500
"""Pixels of the body by which a pose is found; the information of the others is of the same kind."""
_LEAST_PIXELS = 6
_SECTORS = 6
PARTS = 2 * _SECTORS
"""Of a body: neighbouring pixels are off together, and how much parts contradict each other shows by how much."""
_SEARCH_PX = 2.0
"""Step of the search for a turn, px of the body's outer pixels."""
_MOST_TURNS = 720
_IN_PICTURE = 0.25
"""Share of a body that lies in the picture in a pose where it is sought."""
_BEYOND_PX = 20.0
"""By which it is sought beyond the poses in which it was seen, even outside of the picture."""
_OUTER = 0.95
"""Share of a body's pixels that are nearer to the centre than its outer ones."""
_FINE_PX = 0.5
"""Step of the last search, px."""
STANDS: Floats = np.zeros(2)
"""Shift, px, of a centre that nothing carries."""


@dataclass(frozen=True)
class Frame:
    """A picture in which a body is sought."""

    picture: Picture
    """(h, w) grey levels."""
    background: Picture
    """(h, w) what is behind the body, grey levels."""
    precision: Picture
    """(h, w) inverse variance of its pixels in this picture, 1/grey levels²."""
    excess: float
    """By how much the variance of a pixel is larger in it than usual, grey levels²."""


def frame_of(target: Target, picture: Picture, excess: float) -> Frame:
    """Return a picture, whose pixels have so much more variance than usual, as a body is sought in it."""
    precision = np.float32(1.0) / (target.background_variance + np.float32(excess))
    return Frame(picture, target.background, precision, excess)


@dataclass(frozen=True)
class Body:
    """The pixels by which a body is located."""

    places: Picture
    """(2, n) in the coordinates of the body, px, one part after the other."""
    values: Picture
    """(4, n) mean, grey levels, variance, grey levels², and what cosine and sine of the turn add to the mean."""
    middle: Floats
    """(2,) mean of the places, px."""
    reach: float
    """Root mean square distance of the places from it, px."""
    stands_for: float
    """Pixels of the body for each of them."""
    ends: NDArray[np.int64]
    """(`PARTS`,) number of pixels of each part, by direction and distance from the middle, and of those before it."""

    @property
    def count(self) -> int:
        """Number of its pixels here."""
        return self.places.shape[1]

    def gains(self, frame: Frame, poses: Floats) -> Floats:
        """Return the gains of poses (m, 2, 3), for each of the body's parts (m, `PARTS`)."""
        of_parts = pose_gains(
            frame.picture,
            frame.background,
            frame.precision,
            np.float32(frame.excess),
            self.places,
            self.values,
            self.ends,
            poses,
        )
        return np.asarray(of_parts) * self.stands_for

    def arm(self, centre: Floats) -> float:
        """Return how far the body's outer pixels move for each rad of a turn about a centre, px."""
        return max(self.reach, float(np.quantile(np.hypot(*(self.places.T - centre).T), _OUTER)))

    def thinned(self, every: int) -> Body:
        """Return every so many-th pixel."""
        return replace(
            self,
            places=self.places[:, ::every].copy(),
            values=self.values[:, ::every].copy(),
            ends=-(-self.ends // every),
            stands_for=self.stands_for * every,
        )


def body_of(target: Target, most: int = _MOST_PIXELS) -> Body | None:
    """Return evenly drawn pixels of a target; ``None`` where it has hardly any."""
    rows, columns = np.nonzero(target.visibility > 0.5)
    if len(rows) < _LEAST_PIXELS:
        return None
    middle, count = np.array([columns.mean(), rows.mean()]) - target.pad, len(rows)
    if count > most:
        chosen = np.sort(np.random.default_rng(0).permutation(count)[:most])
        rows, columns = rows[chosen], columns[chosen]
    places = np.stack([columns, rows]) - float(target.pad)
    off = places - middle[:, None]
    away = np.hypot(*off)
    reach = max(2.0, float(np.sqrt((away**2).mean())))
    sector = ((np.arctan2(*off) / (2.0 * np.pi) + 0.5) * _SECTORS).astype(np.int64)
    part = np.minimum(sector, _SECTORS - 1) + _SECTORS * (away > np.median(away))
    by_part = np.argsort(part, kind="stable")
    values = np.stack([one[rows, columns][by_part] for one in (target.appearance, target.variance, *target.shading)])
    ends = np.searchsorted(part[by_part], np.arange(PARTS), side="right")
    places = np.ascontiguousarray(places[:, by_part], np.float32)
    return Body(places, values.astype(np.float32), middle, reach, count / len(rows), ends)


def gains_about(frame: Frame, body: Body, centre: Floats, turns: Floats, shift: Floats = STANDS) -> Floats:
    """Return the gains of turns (m,) about a centre that is shifted, for each of the body's parts (m, `PARTS`)."""
    return body.gains(frame, poses_about(centre, turns, shift))


def poses_about(centre: Floats, turns: Floats, shift: Floats = STANDS) -> Floats:
    """Return the (m, 2, 3) maps of a body that is turned about a centre (2,), px, by angles (m,), rad, and shifted.

    The shift is (2,) or (m, 2), px.
    """
    poses = np.empty((len(turns), 2, 3))
    poses[:, :, :2] = rotations(turns)[0]
    poses[:, :, 2] = centre + shift - poses[:, :, :2] @ centre
    return poses


def turns_to_try(body: Body, centre: Floats, size: tuple[int, int], known: Floats) -> Floats:
    """Return the turns at which a body may be in a picture.

    Parameters
    ----------
    body : Body
        The body.
    centre : ndarray
        (2,) px.
    size : tuple of int
        Height and width of the picture, px.
    known : ndarray
        Turns at which it was seen, rad.

    Returns
    -------
    ndarray
        (m,) rad, evenly spaced: where a part of the body is in the picture, and near the known ones.
    """
    arm = body.arm(centre)
    count = max(36, int(2.0 * np.pi * arm / _SEARCH_PX))
    turns = np.pi * (np.arange(count) * 2.0 / count - 1.0)
    few = body.thinned(max(1, body.count // 50))
    poses = poses_about(centre, turns)
    x, y = (poses[:, :, :2] @ few.places + poses[:, :, 2:]).swapaxes(0, 1)
    inside = ((x >= 0) & (y >= 0) & (x < size[1] - 1) & (y < size[0] - 1)).mean(axis=1) >= _IN_PICTURE
    reach, middle = np.ptp(known) / 2.0 + _BEYOND_PX / arm, np.min(known) + np.ptp(known) / 2.0
    turns = turns[inside | (np.abs(np.angle(np.exp(1j * (turns - middle)))) < reach)]
    return turns[:: max(1, -(-len(turns) // _MOST_TURNS))]


@dataclass(frozen=True)
class Turn:
    """Turn of a body about its centre in one frame."""

    turn: float
    """Rad."""
    sigma: float
    """Standard uncertainty if all pixels were independent, rad."""
    ratio: float
    """Variance by which the body's parts contradict each other, over that of independent pixels."""
    gain: float
    """Nats."""


NOT_SEEN = Turn(float("nan"), float("nan"), float("nan"), 0.0)


def turn_near(frame: Frame, body: Body, centre: Floats, arm: float, guess: float, shift: Floats = STANDS) -> Turn:
    """Return the turn of most likelihood within some pixels of a guess, about a centre that is shifted.

    ``arm`` is that of the body (`Body.arm`), px.
    """
    step = _FINE_PX / arm
    tried: Floats = guess + step * np.arange(-6.0, 7.0)
    of_parts = gains_about(frame, body, centre, tried, shift)
    gains = of_parts.sum(axis=1)
    at, along, curvature = highest(gains)
    if curvature >= 0.0:
        return NOT_SEEN
    # the slopes of the parts add up to zero at the maximum; how far they scatter shows by how much it is off
    bends = of_parts[at + 1] + of_parts[at - 1] - 2.0 * of_parts[at]
    slopes = 0.5 * (of_parts[at + 1] - of_parts[at - 1]) + along * bends
    ratio = float((slopes**2).sum()) / -curvature * PARTS / (PARTS - 1)
    return Turn(tried[at] + step * along, step / np.sqrt(-curvature), ratio, float(gains.max()))


def highest(gains: Floats) -> tuple[int, float, float]:
    """Return where evenly spaced gains (m,) are highest, by the parabola through the best inner one and its neighbours.

    Returns
    -------
    at : int
        Number of the best one.
    along : float
        By how many steps the maximum of the parabola lies beyond it, at most one; 0 where there is none.
    curvature : float
        Of the parabola, nats per step squared.
    """
    at = int(np.clip(np.argmax(gains), 1, len(gains) - 2))
    curvature = float(gains[at - 1] + gains[at + 1] - 2.0 * gains[at])
    slope = 0.5 * float(gains[at - 1] - gains[at + 1])
    return at, float(np.clip(slope / curvature, -1.0, 1.0)) if curvature < 0.0 else 0.0, curvature


def with_ratio(sigma: Floats, ratio: Floats) -> Floats:
    """Return standard uncertainties that contain what the parts of the body contradict each other.

    A frame's ratio rests on few parts, so that it counts half, and the usual one of all frames half.
    """
    usual = float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 1.0
    return np.asarray(sigma * np.sqrt(np.maximum(1.0, 0.5 * (usual + ratio))))
