"""The camera: instants within an exposure, row by row, and what becomes of the light in the sensor."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.drawn.canvas import MARGIN, Canvas, Picture
from benchmarks.drawn.faults import MAINS_HZ, Faults
from benchmarks.drawn.mechanism import Stage

Floats = NDArray[np.float32]
BLUR_INSTANTS, BLUR_INSTANTS_OF_BAND, BANDS = 7, 3, 12
"""Instants of a blurred exposure, of one by rows, and bands of rows that a rolling shutter exposes in turn."""


class Camera:
    """A camera before a scene.

    Parameters
    ----------
    stage : Stage
        Size and rate.
    faults : Faults
        Of camera, holder and light.
    scenery : ndarray
        (rows, columns, 3) what is behind the mechanism, margin included.
    paint : callable
        Paints all that moves on a canvas at a time, s.
    """

    def __init__(self, stage: Stage, faults: Faults, scenery: Picture, paint: Callable[[Canvas, float], None]) -> None:
        self._stage, self._faults, self._paint = stage, faults, paint
        self._smooth = "jagged" not in faults.names
        self._scale = 1 if not self._smooth else 3 if stage.width <= 640 else 2
        s = self._scale
        self._scenery = cv2.resize(scenery, None, fx=s, fy=s, interpolation=cv2.INTER_LINEAR)
        y, x = np.mgrid[: stage.height, : stage.width].astype(np.float32)
        self._x, self._y = x, y
        off = ((x - stage.width / 2) / stage.width) ** 2 + ((y - stage.height / 2) / stage.height) ** 2
        self._vignette = 1.0 - 1.1 * off[..., None] if "vignette" in faults.names else None

    def frame(self, t: float, rng: np.random.Generator) -> Picture:
        """Return the picture (h, w, 3) of a time, s: that of the middle of the middle row's exposure."""
        stage, faults = self._stage, self._faults
        exposure = faults.exposure / stage.fps
        bands = BANDS if faults.readout_s else 1
        instants = 1 if not exposure else BLUR_INSTANTS if bands == 1 else BLUR_INSTANTS_OF_BAND
        edges = np.linspace(0, stage.height, bands + 1).astype(int)
        light = np.zeros((stage.height, stage.width, 3), np.float32)
        for top, bottom in pairwise(edges):
            row = faults.readout_s * ((top + bottom) / 2.0 / stage.height - 0.5)
            for i in range(instants):
                at = t + row + exposure * ((i + 0.5) / instants - 0.5)
                light[top:bottom] += self._seen(at, int(top), int(bottom))
        return self._developed(light / instants, t, rng)

    def _seen(self, t: float, top: int, bottom: int) -> Picture:
        """Return the film's rows from ``top`` to ``bottom`` at an instant."""
        s, stage = self._scale, self._stage
        rows = slice(top * s, (bottom + 2 * MARGIN) * s)
        canvas = Canvas(self._scenery[rows].copy(), s, self._smooth, top)
        self._paint(canvas, t)
        size = stage.width + 2 * MARGIN, bottom - top + 2 * MARGIN
        picture = canvas.picture if s == 1 else cv2.resize(canvas.picture, size, interpolation=cv2.INTER_AREA)
        shift = self._moved(t)
        if not shift.any():
            return picture[MARGIN:-MARGIN, MARGIN:-MARGIN]
        move = np.array([[1.0, 0.0, MARGIN + shift[0]], [0.0, 1.0, MARGIN + shift[1]]])
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        return cv2.warpAffine(picture, move, (stage.width, bottom - top), flags=flags)

    def _moved(self, t: float) -> NDArray[np.float64]:
        f, w = self._faults, 2.0 * np.pi * self._faults.shake_hz
        x = np.sin(w * t + f.phase[0]) + 0.5 * np.sin(1.7 * w * t + f.phase[1])
        pan = f.pan_px * (t * self._stage.fps / self._stage.frames - 0.5)
        return f.shake_px * np.array([x, np.sin(1.2 * w * t + f.phase[2])]) + pan

    def _developed(self, light: Floats, t: float, rng: np.random.Generator) -> Picture:
        """Return the picture after lamps, shadow, lens, exposure, and the sensor's noise."""
        f, stage = self._faults, self._stage
        image = light * np.float32(1.0 + f.light[0] * np.sin(2.0 * np.pi * f.light[1] * t + f.phase[3]))
        image *= np.float32(np.interp(t, *_ramps(f.gains)))
        if f.flicker:
            rows = t + f.readout_s * (self._y[:, :1] / stage.height - 0.5)
            image *= (1.0 + f.flicker * np.sin(2.0 * np.pi * MAINS_HZ * rows))[..., None].astype(np.float32)
        if "shadow" in f.names:
            clear, wide = f.shadow
            x = (stage.width + 2.0 * wide) * (t * stage.fps / stage.frames % 1.0) - wide
            across = np.abs(self._x - x - 0.3 * (self._y - stage.height / 2.0)) - wide / 2.0
            image *= 1.0 - (1.0 - clear) / (1.0 + np.exp(across.clip(-300, 300) / 6.0))[..., None]
        if self._vignette is not None:
            image *= self._vignette
        image = 128.0 + f.fade * (image - 128.0)
        if "bw" in f.names:
            image[:] = cv2.cvtColor(np.clip(image, 0, 255).astype(np.float32), cv2.COLOR_BGR2GRAY)[..., None]
        if f.noise:
            channels = 1 if "bw" in f.names else 3
            image = image + f.noise * rng.standard_normal((stage.height, stage.width, channels), np.float32)
        return np.clip(image + 0.5, 0, 255).astype(np.uint8)


def _ramps(gains: tuple[tuple[float, float], ...]) -> tuple[list[float], list[float]]:
    """Return times and gains of an exposure that takes 0.15 s for each step."""
    times, values = [0.0], [gains[0][1]]
    for at, gain in gains[1:]:
        times += [max(at, times[-1]), max(at, times[-1]) + 0.15]
        values += [values[-1], gain]
    return times, values
