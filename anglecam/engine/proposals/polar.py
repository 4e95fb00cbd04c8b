"""Turning bodies about centres on a grid: the frames in polar coordinates, where a turn is a shift (see `polar_fit`).

Centres are judged by how much better the others of the frames predict each frame when something turns about them. For
a wheel or gear the right centre stands out only within a few pixels, less than a grid can afford; but what turns all
around changes the picture in rings, and their centre is found without following anything (`round_centres`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.engine.proposals.polar_fit import Array, fit, roundness, steady_path, to_polar
from anglecam.engine.sample import Sample
from anglecam.engine.score import Proposal

MOST = 12
"""Proposals, at most."""
_COARSE = (60, 16, 128)
"""Longer side, px, frames and angles for the search over centres."""
_FINE = (80, 48, 192)
"""The same for the best of them; a bin of 2° is 4 px at the rim, and the peak is interpolated."""
_STEP = 6.0
"""Between centres of the grid, px of the coarse pictures; the search continues between them."""
_BROAD = 0.06
"""Of the longer side: what is broader, such as a shadow, is left out in one of two runs."""
_STEADY = 0.8
"""Of a match: what a turn by one radian from frame to frame has to gain, halved in each round. At first the slowest of
several turns that look alike is taken; what looks different all around may turn by a radian all the same."""
_ROUND = 3
"""Centres of rings, at most."""


@dataclass(frozen=True)
class _Stack:
    """Frames less their median, reduced."""

    off: Array = field(repr=False)
    """(h, w, K) grey levels."""
    usual: Array = field(repr=False)
    """(h, w, 1) median where something changes, less its mean there; in a small swing it shows the body."""
    window: Array = field(repr=False)
    """(h, w, 1) between 0 and 1, where something changes."""
    scale: float
    """Pixels for each pixel of the sample."""
    variance: float
    """Of the noise, grey levels²."""
    angles: int

    @property
    def changed(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of what changes."""
        rows, columns = np.nonzero(self.window[..., 0] > 0.5)
        return rows, columns


@dataclass(frozen=True)
class _Rings:
    """A stack about one centre, as Fourier series over the angle."""

    re: Array = field(repr=False)
    """(M, R, K)."""
    im: Array = field(repr=False)
    usual: tuple[Array, Array] = field(repr=False)
    """(M, R, 1) each."""
    most: NDArray[np.int64]
    """(R,) highest order that the pixels of a ring resolve."""
    pixels: Array
    """(R, 1) of each ring in which something changes."""
    per_pixel: Array
    """(R, 1) turns Σ_m |X|² into the mean square over these pixels."""
    angles: int


@dataclass(frozen=True)
class _Followed:
    """A body that turns about a centre."""

    centre: Floats
    """(2,) px of the stack."""
    turn: Array
    """(K,) clockwise as seen, rad."""
    gain: float
    """By how much the frames are better predicted than without a turn, nats."""


def proposals(sample: Sample, near_px: Sequence[Floats] = ()) -> list[Proposal]:
    """Return what may turn in a sample, at most `MOST`, likely ones first.

    With places (2,) of the film, px, it is sought about these alone.
    """
    runs = []
    for sharp in (False, True):
        coarse, fine = _stack(sample, *_COARSE, sharp), _stack(sample, *_FINE, sharp)
        near = [(sample.place(at) + 0.5) * coarse.scale - 0.5 for at in near_px]
        change = min(len(coarse.changed[0]), len(fine.changed[0])) > 0
        runs.append([(fine.scale, one) for one in _search(coarse, fine, near)] if change else [])
    mixed = [one for pair in itertools.zip_longest(*runs) for one in pair if one is not None]
    return [
        Proposal(
            f"polar {n}",
            ((found.centre + 0.5) / (scale * sample.scale)) - 0.5 + sample.corner_px,
            -found.turn.astype(float),
        )
        for n, (scale, found) in enumerate(mixed)
    ]


def _search(coarse: _Stack, fine: _Stack, near: Sequence[Floats]) -> list[_Followed]:
    """Return the bodies that are best followed, half of `MOST`."""
    grid = [_best(coarse, centre, 1, 2) for centre in near or _centres(coarse)]
    starts: list[_Followed] = []
    for one in sorted(grid, key=lambda one: -one.gain):
        if len(starts) < MOST // 2 and all(np.hypot(*(one.centre - c.centre)) > 1.5 * _STEP for c in starts):
            starts.append(one)
    found = [
        _climb(coarse, _best(coarse, centre, 2, 2), (0.5, 0.25), 0)
        for centre in ([] if near else round_centres(coarse))
    ]
    found += [_climb(coarse, one, (_STEP / 2, _STEP / 4, _STEP / 8), 0) for one in starts]
    result: list[_Followed] = []
    for one in found:
        centre = (one.centre + 0.5) * (fine.scale / coarse.scale) - 0.5
        if all(np.hypot(*(centre - c.centre)) > 1.0 for c in result):
            result.append(_best(fine, centre, 2, 3))
    improved = {0, max(range(len(result)), key=lambda i: result[i].gain)}  # the roundest, and the best
    for i in improved:
        result[i] = _climb(fine, result[i], (1.0, 1.0, 0.5, 0.5), 1)
    result = sorted(result, key=lambda one: -one.gain)[: MOST // 2]
    return [_follow(_rings(fine, one.centre), one, fine.variance, 4, _STEADY) for one in result]


def _stack(sample: Sample, longest: int, frames: int, angles: int, sharp: bool) -> _Stack:
    """Return frames less their median; if ``sharp``, without what is `_BROAD`."""
    count = len(sample.pictures)
    use = np.linspace(0, count - 1, min(frames, count)).round().astype(int)
    scale = min(1.0, longest / max(sample.pictures.shape[1:]))
    shrunk = [cv2.resize(p, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for p in sample.pictures[use]]
    median = np.median(shrunk, axis=0)
    off = np.stack(shrunk, axis=-1) - median[..., None]
    if sharp:
        off = off - cv2.GaussianBlur(off, (0, 0), _BROAD * longest)
    changes = cv2.GaussianBlur(np.sqrt(np.mean(off**2, axis=-1)), (0, 0), 1.0)
    window = np.clip(changes / max(4.0 * sample.noise, 0.1 * float(changes.max())), 0.0, 1.0)
    usual = window * (median - (window * median).sum() / max(float(window.sum()), 1e-6))
    return _Stack(
        off.astype(np.float32),
        usual[..., None].astype(np.float32),
        window[..., None].astype(np.float32),
        scale,
        sample.noise**2,
        angles,
    )


def _centres(stack: _Stack) -> list[Floats]:
    """Return a grid of centres over what changes, and one twice as wide around it."""
    rows, columns = stack.changed
    low, high = np.array([columns.min(), rows.min()], float), np.array([columns.max(), rows.max()], float)
    wide = 0.6 * float((high - low).max())

    def mesh(reach: float, step: float) -> list[Floats]:
        along = (np.arange(a - reach, b + reach + 0.5 * step, step) for a, b in zip(low, high, strict=True))
        return [np.array(at) for at in itertools.product(*along)]

    outside = [at for at in mesh(wide, 2.0 * _STEP) if (at < low - _STEP).any() or (at > high + _STEP).any()]
    return mesh(_STEP, _STEP) + outside


def round_centres(stack: _Stack) -> list[Floats]:
    """Return centres (2,) about which the changes lie in rings, the best first."""
    rows, columns = stack.changed
    spread = np.sqrt(np.mean(stack.off[rows, columns] ** 2, axis=-1))
    height, width = stack.window.shape[:2]
    margin = max(height, width) // 3
    x, y = np.meshgrid(np.arange(-margin, width + margin, 1.0), np.arange(-margin, height + margin, 1.0))
    at = np.column_stack([x.ravel(), y.ravel()])
    share = roundness(columns.astype(np.float32), rows.astype(np.float32), spread, at).reshape(x.shape)
    peaks = np.nonzero((share == cv2.dilate(share, np.ones((7, 7)))).ravel())[0]
    return list(at[peaks[np.argsort(share.ravel()[peaks])[::-1][:_ROUND]]])


def _rings(stack: _Stack, centre: Floats) -> _Rings:
    """Return a stack about a centre."""
    rows, columns = stack.changed
    far = np.hypot(columns - centre[0], rows - centre[1])
    radii = np.arange(max(1.0, float(far.min())), float(far.max()) + 1.0, dtype=np.float32)
    at = np.asarray(centre, np.float32)
    share = (to_polar(stack.window, at, radii, stack.angles)[..., 0] > 0.5).mean(axis=0)
    radii, share = radii[share > 0], share[share > 0]
    cos, sin = _waves(stack.angles)
    most = np.clip(np.pi * radii, 3, len(cos)).astype(int)

    def series(values: Array) -> tuple[Array, Array]:
        flat = to_polar(values, at, radii, stack.angles).reshape(stack.angles, -1)
        shape = (len(cos), len(radii), values.shape[2])
        return (cos @ flat).reshape(shape), -(sin @ flat).reshape(shape)

    re, im = series(stack.off)
    unresolved = np.arange(1, len(cos) + 1)[:, None] > most
    re[unresolved] = im[unresolved] = 0.0
    pixels = np.minimum(2.0 * np.pi * radii, 2.0 * most) * share
    per_pixel = 2.0 / (stack.angles**2 * share)
    wide = [values[:, None].astype(np.float32) for values in (pixels, per_pixel)]
    return _Rings(re, im, series(stack.usual), most, wide[0], wide[1], stack.angles)


@cache
def _waves(angles: int) -> tuple[Array, Array]:
    """Return the cosines and sines (M, angles) of all orders that are used."""
    phase = 2.0 * np.pi / angles * np.outer(np.arange(1, angles * 3 // 8 + 1), np.arange(angles))
    return np.cos(phase).astype(np.float32), np.sin(phase).astype(np.float32)


def _best(stack: _Stack, centre: Floats, references: int, rounds: int) -> _Followed:
    """Return what turns about a centre; the first template is the median, or one of some frames."""
    rings = _rings(stack, centre)
    power = (rings.re**2 + rings.im**2).sum(axis=0).mean(axis=-1, keepdims=True) * rings.per_pixel
    weight = rings.pixels / (power + stack.variance)
    at = np.linspace(0, rings.re.shape[2] - 1, references + 2).round().astype(int)[1:-1]
    usual_re, usual_im = rings.usual
    firsts = [(usual_re, usual_im, rings.re + usual_re, rings.im + usual_im)]
    firsts += [(rings.re[..., k, None], rings.im[..., k, None], rings.re, rings.im) for k in at]
    results = []
    for t_re, t_im, x, y in firsts:
        match = (weight * (t_re * x + t_im * y)).sum(axis=1), (weight * (t_re * y - t_im * x)).sum(axis=1)
        start = _Followed(centre, _peak(rings, *match), -np.inf)
        results.append(_follow(rings, start, stack.variance, rounds))
    return max(results, key=lambda one: one.gain)


def _follow(rings: _Rings, start: _Followed, variance: float, rounds: int, steady: float = 0.0) -> _Followed:
    """Learn and follow in turn, each ring of each frame weighted by how well it was predicted.

    The result is the round with the highest gain; with ``steady`` it is the last one, as a body that looks alike after
    a part of a turn may gain by jumps.
    """
    count = rings.re.shape[2]
    as_mean, as_median = np.zeros(rings.re.shape[1:], np.float32), np.zeros(rings.re.shape[1:], np.float32)
    for part in (rings.re, rings.im):
        as_mean += ((part - part.mean(axis=-1, keepdims=True)) ** 2).sum(axis=0) * (count / (count - 1.0)) ** 2
        as_median += (part**2).sum(axis=0)
    # S is learnt with weights, and may be either; a picture without a turn must not do worse for lack of them
    still = np.minimum(as_mean, as_median) * rings.per_pixel + variance
    worth = rings.pixels * rings.per_pixel
    best, turn, left = start, start.turn, still
    for n in range(rounds):
        error, match_re, match_im = fit(rings.re, rings.im, rings.most, turn, (worth / left).astype(np.float32))
        left = error * rings.per_pixel + variance
        gain = float((0.5 * rings.pixels * np.log(still / left)).sum())
        if gain > best.gain or steady > 0.0:
            best = _Followed(start.centre, turn, gain)
        turn = _peak(rings, match_re, match_im, steady * 0.5**n)
    return best


def _peak(rings: _Rings, match_re: Array, match_im: Array, steady: float = 0.0) -> Array:
    """Return the turn (K,) at which each frame matches best, rad; ``steady`` as `_STEADY`."""
    cos, sin = _waves(rings.angles)
    match = cos.T @ match_re - sin.T @ match_im
    best = match.argmax(axis=0)
    if steady > 0.0:
        rises = float(np.median(match.max(axis=0) - np.median(match, axis=0)))
        best = steady_path(match, steady * rises * 2.0 * np.pi / rings.angles)
    k = np.arange(match.shape[1])
    before, here, after = match[best - 1, k], match[best, k], match[(best + 1) % rings.angles, k]
    aside = 0.5 * (before - after) / np.minimum(before - 2.0 * here + after, -1e-9)
    return np.asarray(2.0 * np.pi / rings.angles * (best + np.clip(aside, -0.5, 0.5)), np.float32)


def _climb(stack: _Stack, found: _Followed, steps: tuple[float, ...], references: int) -> _Followed:
    """Move the centre by one of the steps after the other; with references, look afresh for the turn."""
    for step in steps:
        here = found.centre
        for move in ((-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)):
            at = here + step * np.array(move)
            if references > 0:
                tried = _best(stack, at, references, 2)
            else:
                tried = _follow(_rings(stack, at), _Followed(at, found.turn, -np.inf), stack.variance, 2)
            found = max(found, tried, key=lambda one: one.gain)
    return found
