"""The form of an entry of the ledger: one effect that a model of the form θ̈ = c·u − a·θ̇ − b·θ can lack.

An effect belongs to one station of the signal's path, command → actuator → load → camera, and changes one thing there
through one *port*. With its parameters at their null values the model is exactly the model without the effect.

    command       the command that arrives: u(t) → v(t), piecewise linear in and out
    lag           first-order delay of the drive: τ·v̇ = u − v
    servo         torque of servo and springs: c·v − b·θ → another torque
    load          acceleration added, a function of time, angle and rate
    friction      levels of dry friction, a function of the servo's torque and of the angle
    dynamics      acceleration added by something with additional states, and the derivatives of those states
    timing        the instant at which the camera recorded what a frame shows
    observation   the angle that the camera measures, a function of the true angle
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, MutableSequence, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats
from anglecam.effects.ports import MOST_PARAMETERS
from anglecam.effects.seen import Motion, Seen
from anglecam.effects.unit_names import split_unit

Values = tuple[float, ...]
"""Numbers that the function of a port reads: parameters, states, or a, b and c."""
Out = MutableSequence[float]
"""Numbers that it writes."""

PORTS = ("command", "lag", "servo", "load", "friction", "dynamics", "timing", "observation")


@dataclass(frozen=True)
class Knots:
    """A piecewise linear angle; arrays of length m. Before the first knot its level holds."""

    time: Floats
    """s, ascending."""
    level: Floats
    """Angle at each knot, rad."""
    slope: Floats
    """Slope from each knot to the next, rad/s."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect."""

    name: str
    """Name in result files; it ends in the unit used there (``tau_s``)."""
    symbol: str
    """Symbol; it occurs in the effect's equation."""
    null: float
    """The value at which the effect is absent, or at which this parameter changes nothing, SI."""
    lower: float
    """Lower bound, SI."""
    upper: float
    """Upper bound, SI."""
    starts: tuple[float, ...] = ()
    """Starting values of a fit, SI; several where the cost may have several minima, none where the effect works them
    out in `Effect.starts`."""
    to_file: float = 1.0
    """Factor from SI to the unit in ``name``."""
    inverse: bool = False
    """Whether files state the reciprocal: for a limit, which is absent at 0."""
    circular: bool = False
    """Whether it is a direction, which files state between −180° and 180°."""
    staged: bool = False
    """Whether it is fitted only if the data justify it after the other parameters. Omitting it must be the same as 0;
    staged parameters come last."""
    mimics_zero_offset: bool = False
    """Whether it moves the body as a wrong zero of the angle does, so that it is determined only if zero is known."""
    is_speed: bool = False
    """Whether it is a speed of the body, which much slower recordings cannot determine."""
    unlimited: bool = False
    """Whether the effect remains what it is however large this size, as a rigid stop is a stop; recordings then need
    not limit it from above."""
    swing_power: int = 0
    """Power of the motion's width with which the value in files grows where the effect keeps its share of the motion:
    1 for a friction torque, −2 for a cubic stiffness; 0 where it does not scale, as for a direction in space."""

    @property
    def unit(self) -> str:
        """Unit in files, parsed from the name: ``friction_deg_per_s2`` → ``deg/s2``; empty for a pure number."""
        return split_unit(self.name)[1]

    @property
    def time_power(self) -> int:
        """Power of the time unit in the value that files state: 1 for ``tau_s``, −2 for ``k3_per_s2``."""
        over, _, under = self.unit.partition("/")
        powers = {"s": 1, "s2": 2, "Hz": -1}
        return powers.get(over, 0) - powers.get(under, 0)

    def at_scale(self, rate: float, swing: float) -> Parameter:
        """Return the parameter with wider bounds and larger starts where a rig requires them.

        Parameters
        ----------
        rate : float
            How many times as fast the plant is as those that bounds and starts were set for; 1 if it is one of them.
        swing : float
            How many times as wide the motion is.

        Returns
        -------
        Parameter
            With bounds and starts multiplied by the factor, at least 1, by which the value grows. Smaller values are
            within the bounds, and the screen tries small shares of every start.
        """
        factor = rate**-self.time_power * swing**self.swing_power
        factor = max(1.0, 1.0 / factor if self.inverse else factor)
        starts = tuple(factor * start for start in self.starts)
        return replace(self, lower=factor * self.lower, upper=factor * self.upper, starts=starts)

    def in_file_unit(self, value: float, sigma: float = 0.0) -> tuple[float, float]:
        """Convert a value and its standard uncertainty from SI to the unit in files; an absent limit is infinite."""
        if self.circular:
            value = math.remainder(value, math.tau)
        if not self.inverse:
            return value * self.to_file, sigma * abs(self.to_file)
        if value == 0.0:
            return math.inf, math.nan
        return self.to_file / value, sigma * abs(self.to_file) / value**2

    def interval_in_file_unit(self, lower: float, upper: float) -> tuple[float, float]:
        """Convert the ends of an interval from SI to the unit in files; the first is the smaller one.

        Examples
        --------
        >>> one = Parameter("limit_deg", 0.0, 1.0, 0.0, (1.0,), to_file=2.0, inverse=True)
        >>> one.interval_in_file_unit(0.0, 0.5)
        (4.0, inf)
        """
        ends = (self.in_file_unit(lower)[0], self.in_file_unit(upper)[0])
        return min(ends), max(ends)


@dataclass(frozen=True)
class Effect:
    """One entry of the ledger. Exactly one of the ports is filled."""

    id: str
    """Identifier in files."""
    station: str
    """Place on the signal's path: ``command``, ``actuator``, ``load`` or ``camera``."""
    summary: str
    """What happens, in a sentence that a student understands."""
    equation: str
    """The equation with the effect, in the symbols of its parameters."""
    relaxes: str
    """The assumption of the paper that the effect relaxes, and where the paper makes it."""
    parameters: tuple[Parameter, ...]
    """The first is the effect's size, and at its null the effect is absent; the others shape it. Names are unique in
    the ledger."""
    aliases: tuple[str, ...]
    """Ids of the effects that it can be mistaken for; they need not name this one in return."""
    separating_experiment: str
    """The recording to make next to distinguish it from its aliases."""
    source: str
    """Literature."""
    fixed: tuple[tuple[int, float], ...] = ()
    """Positions, ascending, and values, SI, of parameters that are not fitted: known, or not identifiable."""
    kinked: bool = False
    """Whether the torque of the port ``load`` or ``dynamics`` has a kink or a jump, as a stop has. The integrator then
    steps by at most 2 ms instead of 6 ms, and fits also start from rest. A jump in the torque, such as a damper that
    acts beyond an angle, still leaves an error of the order of the jump times half a step."""
    rank: int = 0
    """Position among the effects of the same port, along the signal's path."""
    states: int = 0
    """Number of states that the effect adds to angle and rate. Only the ports ``lag`` (one state, solved in closed
    form) and ``dynamics`` add any."""
    command: Callable[[Knots, Floats], Knots] | None = field(default=None, repr=False)
    """(command given, parameters) → command that arrives."""
    lag: Callable[[Floats], float] | None = field(default=None, repr=False)
    """Parameters → τ, s."""
    servo: Any = field(default=None, repr=False)
    """Compiled (torque, θ, ω, abc, parameters) → torque of servo and springs, rad/s². Its first argument is c·v − b·θ,
    or the result of the servo effect before it. A decorator of `anglecam.effects.ports` compiles this and the ports
    that follow."""
    load: Any = field(default=None, repr=False)
    """Compiled (time, θ, ω, abc, parameters) → angular acceleration added, rad/s². Time is the recording's, s. It is
    integrated in steps of 6 ms; for quadratic drag that is accurate to 2e-4° at 5 1/rad and to 1e-3° at 20 1/rad. See
    `kinked` for a torque that is not smooth in θ and ω."""
    friction: Any = field(default=None, repr=False)
    """Compiled (torque, θ, abc, parameters) → levels while sliding up and sliding down, break-away level if higher
    (rad/s²), Stribeck speed (rad/s); opposes motion. The torque is that of servo and springs after every servo effect,
    rad/s². There is no friction where all parameters are zero."""
    dynamics: Any = field(default=None, repr=False)
    """Compiled (time, θ, ω, v, abc, states, parameters, derivatives) → angular acceleration added, rad/s²; it fills the
    `states` derivatives of the states. v is the command at the drive, rad, and abc is a, b, c. The integrator steps by
    at most 2 ms, so rates of the states must stay below 1000/s."""
    initial: Any = field(default=None, repr=False)
    """Compiled (θ, ω, v, abc, parameters, states), for ``dynamics``; it fills the states at a recording's first frame,
    which are zeros where it is ``None``."""
    timing: Callable[[Floats, Floats, Floats, View], Floats] | None = field(default=None, repr=False)
    """(frame times s, angle rad, parameters, view) → instants at which what the frames show happened, s."""
    observation: Callable[[Floats, Floats, Floats, View], Floats] | None = field(default=None, repr=False)
    """(frame times s, angle rad, parameters, view) → the angle that is measured, rad."""
    starts: Callable[[Seen], Sequence[Values]] | None = field(default=None, repr=False)
    """What the model so far shows → parameters at which a fit starts, SI, the likeliest first; for an effect whose
    magnitude, place or frequency depends on plant and motion. ``None`` where the parameters state their starts."""
    searched: Callable[[Seen], Sequence[Floats]] | None = field(default=None, repr=False)
    """What the model so far shows → torques (n, 2k) at `Seen.times` of each recording, for an effect with a parameter
    that only the residual shows, such as a frequency: pairs of columns, one pair for each of k values of it. They do
    not depend on the residual. `starts` finds the best pairs; the residual test finds them in noise, too."""
    needs: Callable[[View], bool] = field(default=lambda view: True, repr=False)
    """Whether a view contains what the effect is computed from."""
    in_free_swing: bool = True
    """Whether it is looked for in free swings. There angle, speed, amplitude and time run together, so that an effect
    with a flexible shape takes the place of another one, or of an error of the measurement."""
    opposite: str = ""
    """What happens where the effect's size is below its null; empty if ``summary`` holds for both signs."""
    possible: Callable[[Values, Values, Motion], bool] = field(default=lambda values, abc, motion: True, repr=False)
    """(parameters, (a, b, c), motion) → whether they describe this effect; a fit elsewhere is some other cause."""
    largest: Callable[[Values, Values], float] | None = field(default=None, repr=False)
    """(parameters, (a, b, c)) → the largest size that physics allows beside them, SI. A fit beyond it is repeated with
    this bound, because the best size that can exist may still be the best explanation."""

    def __post_init__(self) -> None:
        if len(self.parameters) + len(self.fixed) > MOST_PARAMETERS:
            raise ValueError(f"{self.id}: at most {MOST_PARAMETERS} parameters")

    def with_fixed(self, values: Mapping[str, float]) -> Effect:
        """Return the effect with more parameters fixed: ``values`` by name, SI; itself if none of them is named."""
        if not any(p.name in values for p in self.parameters):
            return self
        fixed = dict(self.fixed)
        places = [i for i in range(len(self.parameters) + len(fixed)) if i not in fixed]
        fixed |= {i: values[p.name] for i, p in zip(places, self.parameters, strict=True) if p.name in values}
        left = tuple(p for p in self.parameters if p.name not in values)
        return replace(self, parameters=left, fixed=tuple(sorted(fixed.items())))

    def limited(self, size: float) -> Effect:
        """Return the effect with a size that physics limits from above, so that recordings need not; SI."""
        first, *others = self.parameters
        return replace(self, parameters=(replace(first, upper=size, unlimited=True), *others))

    def at_scale(self, rate: float, swing: float) -> Effect:
        """Return the effect with the bounds and starts that a rig requires; see `Parameter.at_scale`."""
        if rate == 1.0 and swing == 1.0:
            return self
        return replace(self, parameters=tuple(p.at_scale(rate, swing) for p in self.parameters))

    def complete(self, fitted: Floats) -> Floats:
        """Insert the `fixed` parameters among the (k,) fitted parameters."""
        for place, value in self.fixed:
            fitted = np.insert(fitted, place, value)
        return fitted

    @property
    def null(self) -> Floats:
        """Parameter values at which the effect is absent, SI."""
        return np.array([p.null for p in self.parameters])

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the parameters, SI."""
        return np.array([p.lower for p in self.parameters]), np.array([p.upper for p in self.parameters])

    @cached_property
    def port(self) -> str:
        """Name of the port that is filled."""
        return next(f.name for f in fields(self) if f.name in PORTS and getattr(self, f.name) is not None)
