"""Lens distortion: the picture is drawn out or in towards its edges.

    p′ = m + (p − m)·(1 + κ·|p − m|²/R²)

m is the middle of the picture and κ = k1·(R/f)². The paper names "image distortion, and optical aberration" as errors
and leaves them out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anglecam.effects.effect import Effect, Parameter, View

Floats = NDArray[np.float64]


def _seen(time: Floats, angle: Floats, parameters: Floats, view: View) -> Floats:
    lever, pivot = view.lever_px or 1.0, view.pivot_px or (0.0, 0.0)
    # ahead and up from the middle of the picture, in lever arms
    side = -1.0 if view.mirrored else 1.0
    centre = np.array([side * pivot[0], -pivot[1]]) / lever

    def filmed(place: Floats) -> Floats:
        return place * (1.0 + parameters[0] * (place**2).sum(axis=-1, keepdims=True))

    def line(turned: Floats) -> Floats:
        arm = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
        seen = filmed(centre + arm) - filmed(centre)
        cross, dot = arm[..., 0] * seen[..., 1] - arm[..., 1] * seen[..., 0], (arm * seen).sum(axis=-1)
        return np.arctan2(cross, dot)

    return angle + line(view.neutral + angle) - line(np.asarray(view.neutral))


def _needs(view: View) -> bool:
    return view.lever_px is not None and view.pivot_px is not None and not view.only_pivot_differs


EFFECT = Effect(
    id="lens_distortion",
    station="camera",
    summary="The lens draws the picture out or in towards its edges, and angles with it.",
    equation="p′ = p·(1 + κ·|p|²/R²) about the middle of the picture, κ = k1·(R/f)²",
    relaxes='"image distortion, and optical aberration" are left out',
    parameters=(Parameter("distortion_at_lever", "κ", null=0.0, lower=-0.3, upper=0.3, starts=(0.01, -0.01)),),
    aliases=("camera_tilt", "pivot_offset", "linkage_geometry"),
    separating_experiment="a chessboard clip: anglecam calibrate, then camera: {calibration: …}",
    source="Brown, Photogrammetric Engineering 37(8), 1971",
    seen=_seen,
    needs=_needs,
)
