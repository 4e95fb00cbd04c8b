"""From light to grey levels: lens blur, vignetting, flicker, shot noise and read noise, gamma."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from synth.exposure import Shutter
from synth.normal import standard_normal
from synth.spec import Camera

Floats = NDArray[np.float64]
Light = NDArray[np.float32]

WHITE = 255.0


def develop(light: Light, camera: Camera, gain: Floats, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Turn the light of a frame into the camera's picture.

    Parameters
    ----------
    light : ndarray
        (height, width, 3), 0 to 1, the mean over each pixel and its exposure.
    camera : Camera
        Blur, vignetting, noise and gamma.
    gain : ndarray
        Strength of the light in each row, (height,) or (1,).
    rng : numpy.random.Generator
        Source of this frame's noise.

    Returns
    -------
    ndarray
        (height, width, 3), RGB, 0-255.
    """
    signal: NDArray[Any] = light * np.float32(WHITE)
    if camera.focus_blur_px > 0:
        signal = cv2.GaussianBlur(signal, (0, 0), camera.focus_blur_px, borderType=cv2.BORDER_REPLICATE)
    if camera.vignetting > 0:
        signal *= _vignette(signal.shape[:2], camera.vignetting)[..., None]
    if camera.flicker is not None:
        signal *= gain.astype(np.float32)[:, None, None]
    if camera.noise_grey > 0 or camera.electrons_at_white is not None:
        noise = standard_normal(rng, signal.shape)
        if camera.electrons_at_white is None:
            noise *= camera.noise_grey
        else:
            # many electrons: their Poisson noise is normal, its variance the signal in electrons
            variance = signal * (WHITE / camera.electrons_at_white)
            noise *= np.sqrt(variance + camera.noise_grey**2)
        signal += noise
    if camera.gamma != 1.0:
        signal = WHITE * (np.maximum(signal, 0.0) / WHITE) ** (1 / camera.gamma)
    return np.clip(np.rint(signal, out=signal), 0, 255, out=signal).astype(np.uint8)


def flicker(camera: Camera, shutter: Shutter, taken: float) -> Floats:
    """Return the strength of the light in each row of a frame: a sine, averaged over the row's exposure.

    Parameters
    ----------
    camera : Camera
        Its flicker, if any.
    shutter : Shutter
        Exposure of the rows.
    taken : float
        Time of the frame, s.

    Returns
    -------
    ndarray
        (rows,) or (1,).
    """
    rows = shutter.row_times(taken)
    if camera.flicker is None:
        return np.ones(len(rows))
    rate = camera.flicker.frequency_hz
    smoothed = camera.flicker.share * np.sinc(rate * shutter.exposure_s)
    return np.asarray(1 + smoothed * np.sin(2 * math.pi * rate * rows))


def _vignette(shape: tuple[int, int], lost: float) -> Light:
    """Return a factor that falls with the square of the distance from the middle, to 1 − `lost` in the corners."""
    y, x = (np.linspace(-1.0, 1.0, side, dtype=np.float32) for side in shape)
    return np.asarray(1 - lost * (y[:, None] ** 2 + x[None, :] ** 2) / 2, dtype=np.float32)
