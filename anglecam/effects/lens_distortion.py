"""Lens distortion: the scale of the picture grows or shrinks towards its edges.

    p′ = m + (p − m)·(1 + κ·|p − m|²/R²)

m is the middle of the picture, R the lever arm and κ = k1·(R/f)². The paper names "image distortion, and optical
aberration" as errors and neglects them.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Parameter

ROUNDS = 8
"""Fixed-point iterations that invert the distortion; each multiplies the error by the size of the distortion."""
MIN_SCALE = 0.3
"""Smallest local scale that a lens produces; it keeps the iteration finite."""


def _observe(time: Floats, angle: Floats, parameters: Floats, view: View) -> Floats:
    lever, pivot = view.lever_px or 1.0, view.pivot_px or (0.0, 0.0)
    # pivot from the middle of the picture, ahead and up, in lever arms
    side = -1.0 if view.mirrored else 1.0
    shown = np.array([side * pivot[0], -pivot[1]]) / lever
    centre, neutral = _undistorted(shown, view.neutral, parameters[0])

    def distorted(place: Floats) -> Floats:
        return place * (1.0 + parameters[0] * (place**2).sum(axis=-1, keepdims=True))

    def line(turned: Floats) -> Floats:
        arm = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
        seen = distorted(centre + arm) - distorted(centre)
        cross, dot = arm[..., 0] * seen[..., 1] - arm[..., 1] * seen[..., 0], (arm * seen).sum(axis=-1)
        return np.arctan2(cross, dot)

    return angle + line(neutral + angle) - line(np.asarray(neutral))


def _undistorted(shown: Floats, neutral: float, kappa: float) -> tuple[Floats, float]:
    """Return the true pivot, in true lever arms, and the true neutral direction, from those in the picture."""
    places = np.stack([shown, shown + [math.cos(neutral), math.sin(neutral)]])
    true, lever = places, 1.0
    for _ in range(ROUNDS):
        true = places / np.maximum(1.0 + kappa * (true**2).sum(axis=1, keepdims=True) / lever**2, MIN_SCALE)
        arm = true[1] - true[0]
        lever = math.hypot(*arm)
    return true[0] / lever, math.atan2(arm[1], arm[0])


def _needs(view: View) -> bool:
    return view.lever_px is not None and view.pivot_px is not None and not view.only_pivot_differs


EFFECT = Effect(
    id="lens_distortion",
    station="camera",
    summary="The lens stretches or compresses the picture towards its edges, and with it the angles.",
    equation="p′ = p·(1 + κ·|p|²/R²) about the middle of the picture, κ = k1·(R/f)²",
    relaxes='"image distortion, and optical aberration" are left out',
    parameters=(Parameter("distortion_at_lever", "κ", null=0.0, lower=-0.3, upper=0.3, starts=(0.01, -0.01)),),
    aliases=("camera_tilt", "pivot_offset", "linkage_geometry", "perspective"),
    separating_experiment="a chessboard clip: anglecam calibrate, then camera: {calibration: …}",
    source="Brown, Photogrammetric Engineering 37(8), 1971",
    observation=_observe,
    needs=_needs,
)
