"""Error sources of a nodding head with chosen sizes."""

from __future__ import annotations

import math

import numpy as np

from anglecam.budget.terms import ErrorSources, Neutral

N = 80
REST = np.arange(N) < 15
PIVOT = np.array([240.0, 300.0])
COVARIANCE = np.array([[0.05, 0.02], [0.02, 0.09]])


def nod_sources(*, mirrored=False, neutral=REST, noise=0.03, pose=0.02, **more) -> tuple[ErrorSources, np.ndarray]:
    """Return the error sources of a nodding head, and the positions of its mouth in the picture."""
    time = np.arange(N) / 30.0
    line = np.radians(-8.0 + 20.0 * np.sin(2.0 * time) * ~REST + 0.02 * np.sin(40.0 * time))
    lever = 200.0 + 0.05 * np.cos(30.0 * time)
    ahead = -1.0 if mirrored else 1.0
    mouth = PIVOT + lever[:, None] * np.column_stack([ahead * np.cos(line), -np.sin(line)])
    noise_px = noise * (1.0 + 0.3 * np.sin(time))
    zero = math.radians(-8.0) if neutral is None else line[neutral].mean()
    built = {
        "frame": np.arange(N),
        "time": time,
        "angle": line - zero,
        "line": line,
        "lever_px": lever,
        "mirrored": mirrored,
        "pivot_px": PIVOT,
        "pivot_covariance_px2": COVARIANCE,
        "pivot_source": "marker",
        "pivot_dof": math.inf,
        "noise_px": noise_px,
        "noise_dof": math.inf,
        "pose_px": pose,
        "pose_dof": math.inf,
        "neutral": None if neutral is None else _rest(lever, line, mouth, noise_px, neutral),
    }
    return ErrorSources(**{**built, **more}), mouth


def _rest(lever, line, mouth, noise_px, rest) -> Neutral:
    ahead, up = np.cos(line[rest]), np.sin(line[rest])
    return Neutral(
        frames=int(rest.sum()),
        poses=len(np.unique(np.round(mouth[rest]), axis=0)),
        place_px=np.array([(lever[rest] * ahead).mean(), (lever[rest] * up).mean()]),
        along=np.array([-up.mean(), ahead.mean()]),
        noise_px=math.sqrt((noise_px[rest] ** 2).mean() / rest.sum()),
    )
