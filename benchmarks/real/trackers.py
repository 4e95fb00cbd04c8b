"""Plain trackers: the centroid of a colour, a polar picture about an axis, the teeth of a gear, a thread that swings.

Each returns time stamps, s, and an angle, degrees, counter-clockwise as seen in the stored picture; NaN where lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import av
import cv2
import numpy as np

Tracked = tuple[np.ndarray, np.ndarray]
BINS = 1440
"""Directions of a polar picture."""


def frames(path: Path) -> Iterator[tuple[float, np.ndarray]]:
    with av.open(path) as container:
        for frame in container.decode(video=0):
            if frame.time is not None:
                yield float(frame.time), frame.to_ndarray(format="bgr24")


def blob(path: Path, mask: Callable[[np.ndarray], np.ndarray], pivot: tuple[float, float] | None = None) -> Tracked:
    """Follow the largest region of a mask; without a pivot, its path's circle gives one."""
    times, places = [], []
    for time, image in frames(path):
        chosen = mask(image).astype(np.uint8)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(chosen)
        times.append(time)
        if count < 2:
            places.append((np.nan, np.nan))
            continue
        y, x = np.nonzero(labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))
        places.append((float(x.mean()), float(y.mean())))
    place = np.array(places)
    centre = np.array(pivot) if pivot is not None else _circle_centre(place[np.isfinite(place[:, 0])])
    arm = place - centre
    return np.array(times), _unwrapped(np.arctan2(-arm[:, 1], arm[:, 0]))


def polar(
    path: Path, axis: tuple[float, float], radii: tuple[float, float], *, handheld: bool, subtract: bool
) -> Tracked:
    """Find the shift of the polar picture about an axis that fits a reference best.

    ``handheld``: the axis and the picture's direction are carried along with the background's points.
    ``subtract``: the median polar picture is the still background; what differs from it turns.
    """
    times, unrolled, follow = [], [], _Background(axis, radii[1])
    for time, image in frames(path):
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        matrix = follow(grey) if handheld else np.eye(2, 3)
        still = cv2.warpAffine(grey, matrix, grey.shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        size = (round(radii[1]), BINS)
        unrolled.append(cv2.warpPolar(still, size, axis, radii[1], cv2.WARP_POLAR_LINEAR)[:, round(radii[0]) :])
        times.append(time)
    stack = np.array(unrolled, np.float32)
    if subtract:
        stack -= np.median(stack[:: max(1, len(stack) // 60)], axis=0)
    stack -= stack.mean(axis=1, keepdims=True)
    spectra = np.fft.rfft(stack, axis=1)
    spectra[:, BINS // 12 :] = 0.0  # detail finer than 2·360°/(BINS/6) is noise
    reference, turn = spectra[0], np.zeros(len(stack))
    for _ in range(3):
        before = 0.0
        for i, one in enumerate(spectra):
            match = np.fft.irfft((one * reference.conj()).sum(axis=1), BINS)
            apart = (np.arange(BINS) - before + BINS / 2) % BINS - BINS / 2
            # two arms of a horn are alike: the nearer of two fits is right at frame rate
            before = turn[i] = _best_shift(np.where(np.abs(apart) < BINS / 8, match, match.min()))
        k = np.arange(spectra.shape[1])
        # every frame turned back by its angle, averaged: a better reference than the first frame
        back = np.exp(2j * np.pi * turn[:, None] * k / BINS)
        reference = np.einsum("ikr,ik->kr", spectra, back) / len(spectra)
    # rows of a polar picture count clockwise, because y points down
    return np.array(times), _unwrapped(-turn / BINS * 2.0 * np.pi)


def gear(path: Path, centre: tuple[float, float], axes: tuple[float, float], pitch_deg: float) -> Tracked:
    """Sum up the shifts from frame to frame of the brightness along the ellipses on which the teeth lie.

    Each shift is the one within half a tooth's pitch that fits best; an oblique view makes shifts uneven along the
    ellipse, and right on average.
    """
    times, angles, before = [], [0.0], None
    turn = np.arange(BINS) / BINS * 2.0 * np.pi
    share = np.linspace(0.86, 1.0, 12)[:, None]
    x = (centre[0] + share * axes[0] * np.cos(turn)).astype(np.float32)
    y = (centre[1] - share * axes[1] * np.sin(turn)).astype(np.float32)
    most = round(0.5 * pitch_deg / 360.0 * BINS)
    for time, image in frames(path):
        grey = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (0, 0), 2.0)
        ring = cv2.remap(grey, x, y, cv2.INTER_LINEAR).astype(float)
        spectrum = np.fft.rfft(ring - ring.mean(axis=1, keepdims=True), axis=1)
        if before is not None:
            match = np.fft.irfft((spectrum * before.conj()).sum(axis=0), BINS)
            apart = np.abs((np.arange(BINS) + BINS // 2) % BINS - BINS // 2)
            shift = _best_shift(np.where(apart <= most, match, match.min()))
            angles.append(angles[-1] + (shift + BINS / 2) % BINS - BINS / 2)
        before = spectrum
        times.append(time)
    return np.array(times), np.array(angles) / BINS * 360.0


def thread(path: Path, pivot: tuple[float, float], radii: tuple[float, float], reach_deg: float) -> Tracked:
    """Take the mean direction of what differs from the median picture, within a sector below the pivot."""
    pictures = [(time, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)) for time, image in frames(path)]
    y, x = np.indices(pictures[0][1].shape)
    direction = np.degrees(np.arctan2(x - pivot[0], y - pivot[1]))  # from straight down, counter-clockwise as seen
    away = np.hypot(x - pivot[0], y - pivot[1])
    sector = (np.abs(direction) < reach_deg) & (away > radii[0]) & (away < radii[1])
    still = np.median(np.stack([picture for _, picture in pictures[::5]]), axis=0)
    angles = []
    for _, picture in pictures:
        off = np.abs(cv2.GaussianBlur(picture - still, (0, 0), 1.0))[sector]
        strength = np.where(off > 8.0, off, 0.0)
        counts, edges = np.histogram(direction[sector], bins=400, weights=strength)
        smooth = np.convolve(counts, np.ones(7), "same")
        top = edges[int(np.argmax(smooth))] + 0.5 * (edges[1] - edges[0])
        near = np.abs(direction[sector] - top) < 1.5
        angles.append(float(np.average(direction[sector][near], weights=strength[near] + 1e-9)))
    return np.array([time for time, _ in pictures]), np.array(angles)


class _Background:
    """Carry the picture back onto the first frame by points outside a circle about the axis."""

    def __init__(self, axis: tuple[float, float], clear: float) -> None:
        self.axis, self.clear = axis, clear
        self.first: np.ndarray | None = None

    def __call__(self, grey: np.ndarray) -> np.ndarray:
        if self.first is None:
            mask = np.full_like(grey, 255)
            cv2.circle(mask, tuple(round(v) for v in self.axis), round(1.3 * self.clear), 0, -1)
            self.first, self.matrix = grey, np.eye(2, 3)
            self.points = cv2.goodFeaturesToTrack(grey, 400, 0.01, 8, mask=mask)
            return self.matrix
        start = cv2.transform(self.points, self.matrix).astype(np.float32)
        found, status, _ = cv2.calcOpticalFlowPyrLK(
            self.first, grey, self.points, start, winSize=(31, 31), maxLevel=4, flags=cv2.OPTFLOW_USE_INITIAL_FLOW
        )
        good = status[:, 0] == 1
        matrix, _ = cv2.estimateAffinePartial2D(self.points[good], found[good], ransacReprojThreshold=2.0)
        self.matrix = self.matrix if matrix is None else matrix
        return self.matrix


def _best_shift(correlation: np.ndarray) -> float:
    k = int(np.argmax(correlation))
    before, top, after = correlation[[k - 1, k, (k + 1) % len(correlation)]]
    return k + 0.5 * (before - after) / min(before - 2.0 * top + after, -1e-9)


def _circle_centre(places: np.ndarray) -> np.ndarray:
    """Fit x² + y² = 2ax + 2by + c; on a long arc this is near the geometric fit."""
    middle = places.mean(axis=0)
    x, y = (places - middle).T
    a, b, _ = np.linalg.lstsq(np.column_stack([2 * x, 2 * y, np.ones(len(x))]), x**2 + y**2, rcond=None)[0]
    return middle + (a, b)


def _unwrapped(angle: np.ndarray) -> np.ndarray:
    found = np.isfinite(angle)
    angle[found] = np.unwrap(angle[found])
    return np.degrees(angle)
