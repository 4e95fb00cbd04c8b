"""Wind gusts: a random torque whose energy lies within a band, a sum of many waves with random frequency and phase."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from synth.effects.effect import Dynamics, Effect
from synth.section import Positive

WAVES = 40


class WindGusts(Effect):
    """A random torque."""

    id: ClassVar[str] = "wind_gusts"
    order: ClassVar[int] = 260

    rms: Positive
    """rad/s²."""
    from_hz: Positive = 0.3
    to_hz: Positive = 3.0
    number: Annotated[int, Field(ge=0)] = 0
    """Seed of the gusts."""

    def dynamics(self) -> Dynamics:
        """Return the gusts."""
        rng = np.random.default_rng(self.number)
        rates = 2 * math.pi * rng.uniform(self.from_hz, self.to_hz, WAVES)
        return _Gusts(self.rms * math.sqrt(2 / WAVES), rates, rng.uniform(0, 2 * math.pi, WAVES))


EFFECT = WindGusts


class _Gusts(Dynamics):
    def __init__(self, size: float, rates: np.ndarray, phases: np.ndarray) -> None:
        self._size, self._rates, self._phases = size, rates, phases

    def disturbance(self, t: float) -> float:
        return float(self._size * np.sin(self._rates * t + self._phases).sum())
