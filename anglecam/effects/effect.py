"""What an entry of the ledger says: one effect that a model of the form θ̈ = c·u − a·θ̇ − b·θ can lack.

An effect belongs to one station of the signal's path, command → actuator → load → camera, and changes one thing
there through one *port* of the integrator. Its parameters at their null leave the model exactly as it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """One number of an effect."""

    name: str
    """As in result files, with its unit there (``tau_s``)."""
    null: float
    """The value at which the effect is absent, SI."""
    lower: float
    upper: float
    starts: tuple[float, ...]
    """Values to start a fit from, SI; more than one where the fit may have several valleys."""
    to_file: float = 1.0
    """Factor from SI to the unit in ``name``."""


@dataclass(frozen=True)
class Effect:
    """One entry of the ledger. At most one of the ports is filled."""

    id: str
    station: str
    """Where on the signal's path: ``command``, ``actuator``, ``load`` or ``camera``."""
    summary: str
    """What happens, in a sentence that a student understands."""
    equation: str
    relaxes: str
    """Which assumption of the paper it lifts, and where the paper makes it."""
    parameters: tuple[Parameter, ...]
    aliases: tuple[str, ...]
    """Whom it can be mistaken for."""
    separating_experiment: str
    """What to record next to tell it from its aliases."""
    source: str
    shift_command: Callable[[Floats, Floats, Floats], tuple[Floats, Floats]] | None = field(default=None, repr=False)
    """Port *command*: (switch times s, values rad, parameters) → the same as the plant receives them."""
    load: Any = field(default=None, repr=False)
    """Port *load*: compiled (θ, ω, u, parameters) → angular acceleration added, rad/s²; smooth in all."""
    dry: Any = field(default=None, repr=False)
    """Port *dry*: compiled (parameters) → (level while sliding, level to break away), rad/s²; opposes motion."""

    @property
    def null(self) -> Floats:
        """Parameter values at which the effect is absent."""
        return np.array([p.null for p in self.parameters])
