"""Proposals from what is declared: where the marked patch is in each frame, and what turns about the hinted pivot.

The patch around the mark is the template. It is sought in every frame and at every orientation, and the places in which
it is found most alike vote for circles through the declared one (RANSAC, as in `blobs`). Nothing here has to be right:
the proposals compete with all others.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.engine.hints import Hints
from anglecam.engine.proposals import polar
from anglecam.engine.proposals.common_centre import fit_centre, proposal_of, same_path, turn_about, up
from anglecam.engine.sample import Sample
from anglecam.engine.score import Proposal

_HALF_PX = (4, 8)
"""Half the side of a template about a place, px of the sample: what is meant may be small or not."""
_ORIENTATIONS = 24
_PEAKS = 4
"""Places of a frame where the patch may be."""
_LIKE = 0.5
"""Least correlation of a patch that may be the declared one."""
_TOLERANCE_PX = 2.0
_DRAWS = 800
_MOST = 3
"""Proposals from one template."""
_NEAR = 2.0
"""Standard uncertainties about a hinted pivot in which centres are tried."""
_STEPS = 5
"""Centres along each side of that square."""


@dataclass(frozen=True)
class _Places:
    """Where a patch may be; arrays of length n."""

    frame: NDArray[np.int64]
    place: NDArray[np.complex128]
    """px, imaginary axis upwards."""
    likeness: Floats
    """Correlation with the patch."""


def proposals(sample: Sample, hints: Hints) -> list[Proposal]:
    """Return what the hints may mean; empty without any."""
    return [*_of_mark(sample, hints), *_about_pivot(sample, hints)]


def _about_pivot(sample: Sample, hints: Hints) -> list[Proposal]:
    if hints.pivot_px is None:
        return []
    reach = _NEAR * min(hints.pivot_sigma_px, 0.25 * max(sample.pictures.shape[1:]) / sample.scale)
    steps = np.linspace(-reach, reach, _STEPS)
    return polar.proposals(sample, [hints.pivot_px + np.array(step) for step in itertools.product(steps, steps)])


def _of_mark(sample: Sample, hints: Hints) -> list[Proposal]:
    at = np.flatnonzero(sample.frames == hints.mark_frame)
    if hints.mark_px is None or len(at) == 0:
        return []
    low, high = sample.place(hints.mark_px[:2]), sample.place(hints.mark_px[2:])
    middle, extent = 0.5 * (low + high), 0.5 * float((high - low).max())
    halves = [round(extent)] if extent > _HALF_PX[0] else _HALF_PX
    tried = [_circles(sample, hints, int(at[0]), middle, half) for half in halves]
    return [one for of_half in tried for one in of_half]


def _circles(sample: Sample, hints: Hints, k: int, middle: Floats, half: int) -> list[Proposal]:
    """Return proposals of circles on which the patch around a place (2,) of frame k is found."""
    side = 2 * half + 1
    patch = cv2.getRectSubPix(sample.pictures[k], (2 * side, 2 * side), tuple(map(float, middle)))
    if float(patch.std()) < sample.noise:
        return []
    where = _found(sample, patch, half)
    frame, place = where.frame, where.place
    start = complex(up(middle))
    rng = np.random.default_rng(0)
    others = np.flatnonzero(frame != k)
    if len(others) < 2:
        return []
    i, j = rng.choice(others, (2, _DRAWS))
    a, b = place[i] - start, place[j] - start
    area = (np.conj(a) * b).imag
    drawn = (frame[i] != frame[j]) & (np.abs(area) > 1e-3 * np.abs(a) * np.abs(b)) & (np.abs(a - b) > _TOLERANCE_PX)
    a, b, area = a[drawn], b[drawn], area[drawn]
    centres = start + 1j * (np.abs(a) ** 2 * b - np.abs(b) ** 2 * a) / (-2.0 * area)
    if hints.pivot_px is not None:
        hint = complex(up(sample.place(hints.pivot_px)))
        centres = centres[np.abs(centres - hint) < 3.0 * hints.pivot_sigma_px * sample.scale]
    found: list[Proposal] = []
    paths: list[NDArray[np.complex128]] = []
    votes = [_vote(centre, start, where, len(sample.frames)) for centre in centres]
    for n in np.argsort([-vote.sum() for vote, _ in votes]):
        path = np.full(len(sample.frames), np.nan + 0j)
        members = votes[n][1][votes[n][1] >= 0]
        path[frame[members]] = place[members]
        path[k] = start
        if np.isfinite(path).sum() < 4 or any(same_path(path, other, _TOLERANCE_PX) for other in paths):
            continue
        paths.append(path)
        spin = np.zeros(len(path), complex)
        centre, arm = fit_centre(path, spin, complex(centres[n]), start - complex(centres[n]))
        turn = turn_about(centre, arm, path, spin)
        found.append(proposal_of(sample, "mark", centre, np.where(np.isfinite(path), turn, np.nan)))
        if len(found) == _MOST:
            break
    return found


def _found(sample: Sample, patch: NDArray[np.float32], half: int) -> _Places:
    """Return frames, places and correlations of where a patch is found, turned or not."""
    side, wide = 2 * half + 1, patch.shape[0]
    disc = cv2.circle(np.zeros((side, side), np.float32), (half, half), half, 1.0, -1)
    templates = []
    for turn in np.arange(_ORIENTATIONS) * 360.0 / _ORIENTATIONS:
        about = cv2.getRotationMatrix2D((0.5 * (wide - 1),) * 2, turn, 1.0)
        about[:, 2] -= 0.5 * (wide - side)
        templates.append(cv2.warpAffine(patch, about, (side, side)))
    frames, places, likeness = [], [], []
    for k, picture in enumerate(sample.pictures):
        framed = cv2.copyMakeBorder(picture, half, half, half, half, cv2.BORDER_REPLICATE)
        best = np.max([cv2.matchTemplate(framed, t, cv2.TM_CCOEFF_NORMED, mask=disc) for t in templates], axis=0)
        best[~np.isfinite(best)] = 0.0
        for _ in range(_PEAKS):
            _, value, _, (x, y) = cv2.minMaxLoc(best)
            if value < _LIKE:
                break
            frames.append(k)
            places.append((x, y))
            likeness.append(value)
            cv2.circle(best, (x, y), half, 0.0, -1)
    return _Places(np.array(frames, np.int64), up(np.array(places, float).reshape(-1, 2)), np.array(likeness))


def _vote(centre: complex, start: complex, found: _Places, count: int) -> tuple[Floats, NDArray[np.int64]]:
    """Return the votes of the frames for a circle, and for each the place that votes, -1 for none."""
    off = np.abs(np.abs(found.place - centre) - abs(start - centre)) / _TOLERANCE_PX
    good = np.where(off < 1.0, found.likeness - 0.3 * off, 0.0)
    votes, members = np.zeros(count), np.full(count, -1)
    for n in np.argsort(good):
        if good[n] > 0.0:
            votes[found.frame[n]], members[found.frame[n]] = good[n], n
    return votes, members
