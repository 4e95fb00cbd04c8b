"""Start values of effects for tests without recordings."""

from __future__ import annotations

import numpy as np

from anglecam.effects import Effect
from anglecam.effects.seen import Seen
from anglecam.loop.screen import starts_of

TIMES = np.arange(0.0, 7.0, 0.01)
SEEN = Seen(
    26.0, 524.0, 508.0, -0.25, 0.25, 3.0, 0.25, 120.0, 7.0, 1 / 30, (TIMES,), (0.25 * np.sin(3.0 * TIMES),),
    lambda torques: (np.ones((torques[0].shape[1] // 2, 2)), np.sin(np.arange(torques[0].shape[1] // 2)) ** 2),
)  # fmt: skip
"""A plant like the paper's neck, and a residual in which every fourth wave or so stands out."""


def first_start(effect: Effect) -> np.ndarray:
    """Return the parameters at which an effect is tried first, SI."""
    return starts_of(effect, SEEN)[0]
