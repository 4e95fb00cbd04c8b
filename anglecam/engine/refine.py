"""Make a proposal as good as its idea: poses of most likelihood in the sampled frames, and the centre that they share.

A free pose has three numbers, the turn and the shift of the body's middle. Where its likelihood is greatest, the
curvature is its information matrix, so that the common centre is a weighted least-squares solution, also for a ball
that shows no turn of its own, or for a stick that may slide along itself. The turns about that centre follow by a
search in one dimension.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from anglecam.data.typing import Flags, Floats
from anglecam.engine.likelihood import pose_gains
from anglecam.engine.sample import Sample
from anglecam.engine.score import Proposal, carried_by
from anglecam.engine.target import Picture, Target, learn_target, turned

_STEPS_PX = (2.0, 1.0, 0.5)
"""Steps of the difference quotients: a pose may begin some pixels off."""
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
_LEAST_INFORMATION = 1e-4
"""1/px²: a place that nothing shows is uncertain by 100 px."""
STANDS: Floats = np.zeros(2)
"""Shift, px, of a centre that nothing carries."""
_ODDS = float(special.logit(0.95))
"""Logarithm of the odds at which a body counts as seen."""


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


def frame_of(sample: Sample, target: Target, picture: Picture) -> Frame:
    """Return a picture as a body is sought in it."""
    excess = sample.excess(picture)
    precision = np.float32(1.0) / (target.background_variance + np.float32(excess))
    return Frame(picture, target.background, precision, excess)


@dataclass(frozen=True)
class Body:
    """The pixels by which a body is located."""

    places: Picture
    """(n, 2) in the coordinates of the body, px."""
    values: Picture
    """(n, 2) mean, grey levels, and variance, grey levels²."""
    middle: Floats
    """(2,) mean of the places, px."""
    reach: float
    """Root mean square distance of the places from it, px."""
    stands_for: float
    """Pixels of the body for each of them."""
    part: NDArray[np.int64]
    """(n,) part of the body to which each belongs, by direction and distance from the middle."""

    def gains(self, frame: Frame, poses: Floats) -> Floats:
        """Return the gains of poses (m, 2, 3), for each of the body's parts (m, `PARTS`)."""
        of_parts = pose_gains(
            frame.picture,
            frame.background,
            frame.precision,
            np.float32(frame.excess),
            self.places,
            self.values,
            self.part,
            PARTS,
            poses,
        )
        return np.asarray(of_parts) * self.stands_for

    def arm(self, centre: Floats) -> float:
        """Return how far the body's outer pixels move for each rad of a turn about a centre, px."""
        return max(self.reach, float(np.quantile(np.hypot(*(self.places - centre).T), _OUTER)))

    def thinned(self, every: int) -> Body:
        """Return every so many-th pixel."""
        return replace(
            self,
            places=self.places[::every].copy(),
            values=self.values[::every].copy(),
            part=self.part[::every].copy(),
            stands_for=self.stands_for * every,
        )


@dataclass(frozen=True)
class Fit:
    """A body that was fitted to a sample."""

    proposal: Proposal
    target: Target = field(repr=False)
    gain: Floats
    """(K,) log likelihood of each frame with the body over that without it, nats."""
    sigma: Floats
    """(K,) standard uncertainty of each turn about a known centre, rad."""
    covariance_px2: Floats
    """(2, 2) of the centre, in the film, px²."""
    off_centre: float
    """Usual distance of the body's poses from turns about one centre, as a share of its travel."""
    off_px: float
    """The same distance, px of the film: the centre wanders by so much, or the body bends."""
    ratio: float
    """Usual variance by which the body's parts contradict each other, over that of independent pixels."""
    information: Floats
    """(3, 3) usual inverse covariance of a free pose in the coordinates of the body, if pixels were independent: turn,
    rad, and shift of the middle, px of the sample."""

    @property
    def seen(self) -> Flags:
        """(K,) frames in which the body is seen."""
        return np.isfinite(self.proposal.turn)


def body_of(target: Target, most: int = _MOST_PIXELS) -> Body | None:
    """Return evenly drawn pixels of a target; ``None`` where it has hardly any."""
    rows, columns = np.nonzero(target.visibility > 0.5)
    if len(rows) < _LEAST_PIXELS:
        return None
    chosen = np.random.default_rng(0).permutation(len(rows))[:most] if len(rows) > most else np.arange(len(rows))
    rows_of, columns_of = rows[chosen], columns[chosen]
    places = np.column_stack([columns_of, rows_of]) - float(target.pad)
    values = np.column_stack([target.appearance[rows_of, columns_of], target.variance[rows_of, columns_of]])
    middle = np.array([columns.mean(), rows.mean()]) - target.pad
    reach = max(2.0, float(np.sqrt(((places - middle) ** 2).sum(axis=1).mean())))
    away = np.hypot(*(places - middle).T)
    sector = (np.arctan2(*(places - middle).T) / (2.0 * np.pi) + 0.5) * _SECTORS
    part = np.minimum(sector.astype(np.int64), _SECTORS - 1) + _SECTORS * (away > np.median(away))
    values = values.astype(np.float32)
    return Body(places.astype(np.float32), values, middle, reach, len(rows) / len(chosen), part)


def refine(sample: Sample, proposal: Proposal, rounds: int = 2) -> Fit | None:
    """Fit a body to a sample, starting from a proposal.

    Parameters
    ----------
    sample : Sample
        K frames.
    proposal : Proposal
        Off by some pixels at most.
    rounds : int
        Of learning and locating in turn.

    Returns
    -------
    Fit or None
        ``None`` where nothing follows the proposal.
    """
    fit = None
    for _ in range(rounds):
        target = learn_target(sample, proposal.poses(sample), np.arange(len(sample.pictures)))
        body = body_of(target)
        if body is None:
            return fit
        frames = [frame_of(sample, target, picture) for picture in sample.pictures]
        centre, carriers = sample.place(proposal.centre_px), proposal.carriers(sample)
        shifts = carried_by(carriers, centre)
        turn = _searched(frames, body, centre, proposal.turn, shifts)
        seen = np.isfinite(turn)
        if seen.sum() < 4:
            return fit
        free = [
            _free_pose(frames[k], body, _as_parameters(turned(centre, turn[k], shifts[k]), body))
            for k in np.flatnonzero(seen)
        ]
        q, information = np.array([one[0] for one in free]), np.array([one[1] for one in free])
        centre, covariance, turn[seen], off_px = common_centre(q, information, centre, body.middle, carriers[seen])
        travel = float(np.hypot(np.std(q[:, 1:], axis=0).sum(), body.reach * np.std(q[:, 0])))
        usual = _usual_information(turn[seen], information)
        near = _about(frames, body, centre, turn, carried_by(carriers, centre))
        turn, gain = np.array([one.turn for one in near]), np.array([one.gain for one in near])
        ratios = np.array([one.ratio for one in near])
        sigma = with_ratio(np.array([one.sigma for one in near]), ratios)
        if np.isfinite(turn).sum() < 4:
            return fit
        turn = turn - np.nanmedian(turn)
        proposal = replace(proposal, centre_px=sample.in_film(centre), turn=turn)
        fit = Fit(
            proposal=proposal,
            target=target,
            gain=gain,
            sigma=sigma,
            covariance_px2=covariance / sample.scale**2,
            off_centre=off_px / max(travel, 1e-9),
            off_px=off_px / sample.scale,
            ratio=float(np.nanmedian(ratios)),
            information=usual,
        )
    return fit


def _usual_information(turn: Floats, information: Floats) -> Floats:
    """Return the median of (n, 3, 3) information matrices of poses, in the coordinates of the body."""
    back = np.tile(np.eye(3), (len(turn), 1, 1))
    back[:, 1:, 1:] = _rotations(turn)[0]
    return np.asarray(np.median(back.swapaxes(1, 2) @ information @ back, axis=0))


def sensitivities(
    sample: Sample, fit: Fit, body: Body, turn: Floats, carrier_turn: Floats | float = 0.0
) -> tuple[Floats, Floats]:
    """Return how much turns (n,) change with an error of the centre, and with a shift of the body.

    ``carrier_turn`` are those of what carries the centre, rad.

    Returns
    -------
    centre, shift : ndarray
        (n, 2) rad/px of the film.
    """
    rotation, slope = _rotations(turn)
    arm = body.middle - sample.place(fit.proposal.centre_px)
    turned_by = np.tile(np.eye(3), (len(turn), 1, 1))
    turned_by[:, 1:, 1:] = rotation
    information = turned_by @ fit.information @ turned_by.swapaxes(1, 2)
    tangent = np.concatenate([np.ones((len(turn), 1)), slope @ arm], axis=1)
    along = np.einsum("ni,nij->nj", tangent, information)
    carried = _rotations(np.broadcast_to(carrier_turn, turn.shape))[0]
    moved = np.einsum("ni,nij->nj", along[:, 1:], carried - rotation)
    scale = sample.scale / np.einsum("ni,ni->n", along, tangent)[:, None]
    return -moved * scale, along[:, 1:] * scale


def gains_about(frame: Frame, body: Body, centre: Floats, turns: Floats, shift: Floats = STANDS) -> Floats:
    """Return the gains of turns (m,) about a centre that is shifted, for each of the body's parts (m, `PARTS`)."""
    return body.gains(frame, poses_about(centre, turns, shift))


def poses_about(centre: Floats, turns: Floats, shift: Floats = STANDS) -> Floats:
    """Return the (m, 2, 3) maps of a body that is turned about a centre (2,), px, by angles (m,), rad, and shifted."""
    rotation = _rotations(turns)[0]
    return np.concatenate([rotation, (centre + shift - rotation @ centre)[:, :, None]], axis=2)


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
    few = body.thinned(max(1, len(body.places) // 50))
    poses = poses_about(centre, turns)
    x, y = np.moveaxis(few.places @ poses[:, :, :2].swapaxes(1, 2) + poses[:, None, :, 2], -1, 0)
    inside = ((x >= 0) & (y >= 0) & (x < size[1] - 1) & (y < size[0] - 1)).mean(axis=1) >= _IN_PICTURE
    reach, middle = np.ptp(known) / 2.0 + _BEYOND_PX / arm, np.min(known) + np.ptp(known) / 2.0
    turns = turns[inside | (np.abs(np.angle(np.exp(1j * (turns - middle)))) < reach)]
    return turns[:: max(1, -(-len(turns) // _MOST_TURNS))]


def _searched(frames: list[Frame], body: Body, centre: Floats, turn: Floats, shifts: Floats) -> Floats:
    """Return the turns with those that are unknown sought wherever the body may be."""
    tried = turns_to_try(body, centre, frames[0].picture.shape, turn[np.isfinite(turn)])
    few = body.thinned(max(1, len(body.places) // 250))
    found = turn.copy()
    for k in np.flatnonzero(~np.isfinite(turn) & np.isfinite(shifts).all(axis=1)):
        gains = gains_about(frames[k], few, centre, tried, shifts[k]).sum(axis=1)
        best = int(np.argmax(gains))
        if gains[best] > np.log(len(tried)) + _ODDS:
            found[k] = tried[best]
    return found


def _free_pose(frame: Frame, body: Body, start: Floats) -> tuple[Floats, Floats, float]:
    """Return the pose of most likelihood near a first guess, its information and its gain.

    The pose is the turn, rad, and the shift of the middle, px. The gain is approximated by a quadratic function.
    """
    units = np.array([1.0 / body.reach, 1.0, 1.0])
    q, best, curvature = start.copy(), -np.inf, np.zeros((3, 3))
    for h in _STEPS_PX:
        for _ in range(2):
            points = q + h * _STENCIL * units
            gains = body.gains(frame, _poses(points, body)).sum(axis=1)
            best = gains[0]
            slope, curvature = _quadratic(gains, h)
            values, axes = np.linalg.eigh(curvature)
            along = axes.T @ slope
            steps = np.where(values < 0.0, along / np.maximum(-values, 1e-9), 2.0 * h * np.sign(along))
            steps = axes @ np.clip(steps, -2.0 * h, 2.0 * h)
            trial = q + steps * units
            reached = float(body.gains(frame, _poses(trial[None], body)).sum())
            top = int(np.argmax(gains))
            if reached > gains[top]:
                moved, q, best = float(np.abs(steps).max()), trial, reached
            else:
                moved, q, best = (h if top else 0.0), points[top], gains[top]
            if moved < 0.5 * h:
                break
    values, axes = np.linalg.eigh(-curvature)
    information = (axes * np.maximum(values, _LEAST_INFORMATION)) @ axes.T
    return q, information / np.outer(units, units), best


_PAIRS = ((0, 1), (0, 2), (1, 2))
_STENCIL = np.array(
    [
        [0, 0, 0],
        *(sign * np.eye(3)[i] for i in range(3) for sign in (1, -1)),
        *(sign * (np.eye(3)[i] + np.eye(3)[j]) for i, j in _PAIRS for sign in (1, -1)),
    ],
    float,
)
"""(13, 3) points by which a quadratic function of three variables is found."""


def _quadratic(gains: Floats, h: float) -> tuple[Floats, Floats]:
    """Return gradient and curvature from the gains at the stencil's points."""
    above, below = gains[1:7:2], gains[2:7:2]
    slope = (above - below) / (2.0 * h)
    curvature = np.diag((above + below - 2.0 * gains[0]) / h**2)
    for (i, j), both, neither in zip(_PAIRS, gains[7::2], gains[8::2], strict=True):
        mixed = both + neither - above[i] - below[i] - above[j] - below[j] + 2.0 * gains[0]
        curvature[i, j] = curvature[j, i] = mixed / (2.0 * h**2)
    return slope, curvature


def _poses(q: Floats, body: Body) -> Floats:
    return np.stack([turned(body.middle, float(one[0]), one[1:]) for one in q])


def _as_parameters(pose: Floats, body: Body) -> Floats:
    turn = np.arctan2(pose[0, 1], pose[0, 0])
    return np.array([turn, *(pose[:, :2] @ body.middle + pose[:, 2] - body.middle)])


def common_centre(
    q: Floats, information: Floats, start: Floats, middle: Floats, carriers: Floats
) -> tuple[Floats, Floats, Floats, float]:
    """Fit one centre of rotation to free poses: one that stands still, or one that another body carries.

    What carries the centre C maps a place x to R₁x + t₁; what stands still, to x. A body that turns by θ about C, and
    that was taken for s₀ off, displaces its middle m by s = R₁(C + s₀) + t₁ + R(θ)(m − C) − m.

    Parameters
    ----------
    q : ndarray
        (n, 3) turn, rad, and shift of the middle, px.
    information : ndarray
        (n, 3, 3) inverse covariances.
    start, middle : ndarray
        (2,) first guess of the centre, and middle of the body, px.
    carriers : ndarray
        (n, 2, 3) poses of what carries the centre: the unit matrix and no shift where it stands still.

    Returns
    -------
    centre : ndarray
        (2,) px, in the coordinates of what carries it.
    covariance : ndarray
        (2, 2) px²; scaled by how far the poses are from turns about it.
    turn : ndarray
        (n,) turns about it that are nearest to the poses.
    off_px : float
        Usual distance of the poses from such turns, as far as they show it, px.
    """
    pivot, shift = np.asarray(start, float), np.zeros(2)  # the pivot in the coordinates of the body
    arm_px = max(1.0, float(np.hypot(*(middle - pivot))))
    turn = q[:, 0].copy()
    normal, scale = np.eye(4), 1.0
    for step in range(12):
        place = carried_by(carriers, pivot) + carriers[:, :, :2] @ shift
        turn = _nearest(q, information, turn, pivot, place, middle)
        rotation, slope = _rotations(turn)
        arm = middle - pivot
        off = q - np.column_stack([turn, place + rotation @ arm - arm])
        chi2 = np.einsum("ni,nij,nj->n", off, information, off)
        scale = max(1.0, float(np.median(chi2)))
        weighted = information * np.minimum(1.0, 3.0 / np.sqrt(np.maximum(chi2 / scale, 1e-9)))[:, None, None]
        by_turn = np.concatenate([np.ones((len(q), 1)), slope @ arm], axis=1)
        by_rest = np.zeros((len(q), 3, 4))
        by_rest[:, 1:, :2] = carriers[:, :, :2]
        by_rest[:, 1:, 2:] = carriers[:, :, :2] - rotation
        of_turn = np.einsum("ni,nij,nj->n", by_turn, weighted, by_turn)
        mixed = np.einsum("ni,nij,njk->nk", by_turn, weighted, by_rest)
        force_turn = np.einsum("ni,nij,nj->n", by_turn, weighted, off) / of_turn
        normal = np.einsum("nji,njk,nkl->il", by_rest, weighted, by_rest) - (mixed / of_turn[:, None]).T @ mixed
        force = np.einsum("nji,njk,nk->i", by_rest, weighted, off) - mixed.T @ force_turn
        ridge = 1e-9 * np.trace(normal) * np.eye(4)
        change = np.linalg.solve(normal + ridge, force)
        length = float(np.hypot(*change[2:]))
        change *= min(1.0, 0.5 * arm_px / max(length, 1e-9))
        shift, pivot = shift + change[:2], pivot + change[2:]
        if step > 2 and length < 0.01:
            break
    to_centre = np.hstack([np.eye(2), np.eye(2)])
    covariance = scale * to_centre @ np.linalg.pinv(normal) @ to_centre.T
    place = carried_by(carriers, pivot) + carriers[:, :, :2] @ shift
    turn = _nearest(q, information, turn, pivot, place, middle)
    arm = middle - pivot
    off = q - np.column_stack([turn, place + _rotations(turn)[0] @ arm - arm])
    # what a pose does not show, as a ball its own turn, does not count
    seen = np.einsum("ni,nij,nj->n", off, information, off) / np.trace(information[:, 1:, 1:], axis1=1, axis2=2)
    # the median squared distance in the plane is 2 ln 2 times the variance of either coordinate
    off_px = float(np.sqrt(2.0 * np.median(seen) / np.log(2.0)))
    return pivot + shift, covariance, turn, off_px


def _nearest(q: Floats, information: Floats, turn: Floats, pivot: Floats, shifts: Floats, middle: Floats) -> Floats:
    """Return the turns about a pivot, shifted by (n, 2), that are nearest to free poses in the metric of these."""
    arm = middle - pivot
    for _ in range(3):
        rotation, slope = _rotations(turn)
        off = q - np.column_stack([turn, shifts + rotation @ arm - arm])
        tangent = np.concatenate([np.ones((len(q), 1)), slope @ arm], axis=1)
        along = np.einsum("ni,nij->nj", tangent, information)
        step = np.einsum("ni,ni->n", along, off) / np.maximum(np.einsum("ni,ni->n", along, tangent), 1e-12)
        turn = turn + np.clip(step, -0.5, 0.5)
    return turn


def _rotations(turn: Floats) -> tuple[Floats, Floats]:
    """Return the (n, 2, 2) matrices of `turned`, and their derivatives."""
    cos, sin = np.cos(turn), np.sin(turn)
    return (
        np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], 1),
        np.stack([np.stack([-sin, cos], -1), np.stack([-cos, -sin], -1)], 1),
    )


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


def turn_near(frame: Frame, body: Body, centre: Floats, guess: float, shift: Floats = STANDS) -> Turn:
    """Return the turn of most likelihood within some pixels of a guess, about a centre that is shifted."""
    arm = body.arm(centre)
    step = _FINE_PX / arm
    tried: Floats = guess + step * np.arange(-6.0, 7.0)
    of_parts = gains_about(frame, body, centre, tried, shift)
    gains = of_parts.sum(axis=1)
    at = int(np.clip(np.argmax(gains), 1, len(tried) - 2))
    curvature = float(gains[at - 1] + gains[at + 1] - 2.0 * gains[at])
    if curvature >= 0.0:
        return NOT_SEEN
    along = float(np.clip(0.5 * (gains[at - 1] - gains[at + 1]) / curvature, -1.0, 1.0))
    # the slopes of the parts add up to zero at the maximum; how far they scatter shows by how much it is off
    bends = of_parts[at + 1] + of_parts[at - 1] - 2.0 * of_parts[at]
    slopes = 0.5 * (of_parts[at + 1] - of_parts[at - 1]) + along * bends
    ratio = float((slopes**2).sum()) / -curvature * PARTS / (PARTS - 1)
    return Turn(tried[at] + step * along, step / np.sqrt(-curvature), ratio, float(gains.max()))


def _about(frames: list[Frame], body: Body, centre: Floats, turn: Floats, shifts: Floats) -> list[Turn]:
    """Return the turns about a centre near first guesses; not seen where the body gains nothing."""
    found = [
        turn_near(frames[k], body, centre, guess, shifts[k]) if np.isfinite(guess) else NOT_SEEN
        for k, guess in enumerate(turn)
    ]
    return [one if one.gain > _ODDS else NOT_SEEN for one in found]


def with_ratio(sigma: Floats, ratio: Floats) -> Floats:
    """Return standard uncertainties that contain what the parts of the body contradict each other.

    A frame's ratio rests on few parts, so that it counts half, and the usual one of all frames half.
    """
    usual = float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 1.0
    return np.asarray(sigma * np.sqrt(np.maximum(1.0, 0.5 * (usual + ratio))))
