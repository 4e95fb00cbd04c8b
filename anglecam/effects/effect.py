"""What an entry of the ledger says: one effect that a model of the form θ̈ = c·u − a·θ̇ − b·θ can lack.

An effect belongs to one station of the signal's path, command → actuator → load → camera, and changes one thing
there through one *port*. Its parameters at their null leave the model exactly as it was.

    command   what arrives:          u(t) → v(t), straight lines in, straight lines out
    lag       how late it arrives:   τ·v̇ = u − v
    servo     what torque comes of it:   c·v − b·θ → another torque
    load      what the head's motion adds
    dry       what holds it
    when      when the camera saw what it shows
    seen      what the camera makes of the angle
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats

Values = tuple[float, ...]
"""Parameters as compiled functions take them: arrays would cost them more than what they work out."""

PORTS = ("command", "lag", "servo", "load", "friction", "timing", "observation")


@dataclass(frozen=True)
class Knots:
    """An angle made of straight lines; arrays of length m. Before the first knot its level holds."""

    time: Floats
    """s, ascending."""
    level: Floats
    """At each knot, rad."""
    slope: Floats
    """From there to the next, rad/s."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect."""

    name: str
    """As in result files, with its unit there (``tau_s``)."""
    symbol: str
    """As in the effect's equation."""
    null: float
    """The value at which the effect is absent, SI."""
    lower: float
    upper: float
    starts: tuple[float, ...]
    """Values to start a fit from, SI; more than one where the fit may have several valleys."""
    to_file: float = 1.0
    """Factor from SI to the unit in ``name``."""
    inverse: bool = False
    """Whether files state its reciprocal: of a limit, which is absent at 0."""
    circular: bool = False
    """Whether it is a direction, which files state between −180° and 180°."""
    staged: bool = False
    """Whether it is left out, which must be the same as 0, until the data ask for it; such parameters come last."""
    mimics_zero_offset: bool = False
    """Whether it moves the head as a wrong zero of the angle does, so that it can be told only where zero is known."""
    is_speed: bool = False
    """Whether it is a speed of the head, which recordings that are much slower cannot tell."""

    def in_file_unit(self, value: float, sigma: float = 0.0) -> tuple[float, float]:
        """Return value and standard uncertainty in the unit in ``name``; infinite for a limit that is absent."""
        if self.circular:
            value = math.remainder(value, math.tau)
        if not self.inverse:
            return value * self.to_file, sigma * abs(self.to_file)
        if value == 0.0:
            return math.inf, math.nan
        return self.to_file / value, sigma * abs(self.to_file) / value**2


@dataclass(frozen=True)
class Effect:
    """One entry of the ledger. Exactly one of the ports is filled."""

    id: str
    station: str
    """Where on the signal's path: ``command``, ``actuator``, ``load`` or ``camera``."""
    summary: str
    """What happens, in a sentence that a student understands."""
    equation: str
    relaxes: str
    """Which assumption of the paper it lifts, and where the paper makes it."""
    parameters: tuple[Parameter, ...]
    """The first is the effect's size; the others shape it."""
    aliases: tuple[str, ...]
    """Whom it can be mistaken for."""
    separating_experiment: str
    """What to record next to tell it from its aliases."""
    source: str
    fixed: tuple[tuple[int, float], ...] = ()
    """Places, ascending, and values, SI, of parameters that are not fitted: they are known, or cannot be."""
    rank: int = 0
    """Place among the effects of the same port, on the signal's way."""
    command: Callable[[Knots, Floats], Knots] | None = field(default=None, repr=False)
    """What is asked for, and parameters → what arrives."""
    lag: Callable[[Floats], float] | None = field(default=None, repr=False)
    """Parameters → τ, s."""
    servo: Any = field(default=None, repr=False)
    """Compiled (torque, θ, abc, parameters) → torque of servo and springs, rad/s²; given c·v − b·θ or what another
    effect has made of it."""
    load: Any = field(default=None, repr=False)
    """Compiled (θ, ω, parameters) → angular acceleration added, rad/s²."""
    friction: Any = field(default=None, repr=False)
    """Compiled (parameters) → (sliding up, sliding down, breaking away if more, Stribeck's speed): rad/s² and rad/s;
    opposes motion."""
    timing: Callable[[Floats, Floats, Floats, View], Floats] | None = field(default=None, repr=False)
    """(stamps s, angle rad, parameters, view) → when what the frames show happened, s."""
    observation: Callable[[Floats, Floats, Floats, View], Floats] | None = field(default=None, repr=False)
    """(stamps s, angle rad, parameters, view) → the angle that is measured, rad."""
    needs: Callable[[View], bool] = field(default=lambda view: True, repr=False)
    """Whether a view tells what the effect is reckoned from."""

    def with_fixed(self, values: Mapping[str, float]) -> Effect:
        """Return the effect with some parameters fixed: ``values`` by name, SI; itself where none is its own."""
        own = tuple((i, values[p.name]) for i, p in enumerate(self.parameters) if p.name in values)
        if not own:
            return self
        return replace(self, parameters=tuple(p for p in self.parameters if p.name not in values), fixed=own)

    def complete(self, own: Floats) -> Floats:
        """Put the parameters that are `fixed` among the (k,) fitted ones."""
        for place, value in self.fixed:
            own = np.insert(own, place, value)
        return own

    @property
    def null(self) -> Floats:
        """Parameter values at which the effect is absent."""
        return np.array([p.null for p in self.parameters])

    @cached_property
    def port(self) -> str:
        """The one that is filled."""
        return next(f.name for f in fields(self) if f.name in PORTS and getattr(self, f.name) is not None)
