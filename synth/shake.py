"""Unwanted motion of the camera: vibration of its stand, and a slow rotation about its line of sight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synth.effects.angle_drift import AngleDrift
from synth.spec import Camera, Effects

Floats = NDArray[np.float64]

WAVES = 24
"""Number of sines in the vibration; enough for their sum to be practically Gaussian."""


@dataclass(frozen=True)
class Unrest:
    """The camera's motion during one recording, a smooth function of time."""

    rates: Floats
    """(WAVES,), rad/s."""
    phases: Floats
    """(2, WAVES), for x and y, rad."""
    rms_px: float
    sag: float
    """Rate of rotation, rad/s, in the direction in which measured angles grow."""

    def shift(self, times: ArrayLike) -> Floats:
        """Return the shift of the picture (n, 2) at times (n,), px."""
        at = np.asarray(times, dtype=float)
        waves = np.cos(at[:, None, None] * self.rates + self.phases)
        return np.asarray(self.rms_px * math.sqrt(2 / WAVES) * waves.sum(axis=-1))

    def roll(self, times: ArrayLike) -> Floats:
        """Return the rotation of the picture (n,) about the shaft at times (n,), rad, positive as upward nods are."""
        return self.sag * np.asarray(times, dtype=float)


def unrest(camera: Camera, effects: Effects, seed: np.random.SeedSequence) -> Unrest:
    """Draw the camera's motion of one recording.

    Parameters
    ----------
    camera : Camera
        Its ``shake`` is used.
    effects : Effects
        Only ``angle_drift`` acts here.
    seed : numpy.random.SeedSequence
        Source of the random numbers.

    Returns
    -------
    Unrest
        With zero amplitude if the camera stands still.
    """
    rng = np.random.default_rng(seed)
    drift = effects.get(AngleDrift)
    highest = camera.shake.frequency_hz if camera.shake else 1.0
    return Unrest(
        rates=2 * math.pi * rng.uniform(0.1, 1.0, WAVES) * highest,
        phases=rng.uniform(0.0, 2 * math.pi, (2, WAVES)),
        rms_px=camera.shake.rms_px if camera.shake else 0.0,
        sag=math.radians(drift.rate_deg_per_s) if drift else 0.0,
    )
