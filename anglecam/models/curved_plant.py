"""A plant with a torque of free form in addition to its effects, as a model that an estimator can fit.

    θ̈ = c·u − a·θ̇ − b·θ + effects + τ(x)   or   + τ(x, y),     τ as in `anglecam.models.torque_curve`

The curve's parameters α determine the splines' coefficients, γ = Z·α, and are fitted with a penalty on the curvature.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from anglecam.data.command import Command
from anglecam.data.runs import Runs
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.models.pieces import Pieces
from anglecam.models.plant import Plant
from anglecam.models.torque_curve import NO_AXIS, Axis, curve_torque

UNBOUNDED = 1e9
"""rad/s²; no curve comes near it."""
NO_CYCLE = (0.0, 0.0)


@dataclass(frozen=True)
class Curve:
    """Which quantities a torque of free form depends on, and how much it may bend."""

    axes: tuple[Axis, ...]
    """One or two."""
    basis: Floats = field(repr=False)
    """(k, m) Z: coefficients of the splines for each of the m parameters."""
    bending: tuple[Floats, ...] = field(repr=False)
    """For each axis (r, m) rows that give, multiplied by the parameters, how much the curve bends along it, rad/s²."""
    smoothness: tuple[float, ...]
    """λ for each axis, s⁴: the sum of squared bendings times λ counts as a sum of squared errors, rad²."""

    @property
    def over(self) -> tuple[str, ...]:
        """Names of the quantities."""
        return tuple(axis.quantity for axis in self.axes)

    @property
    def count(self) -> int:
        """Number of parameters."""
        return self.basis.shape[1]

    @property
    def penalty(self) -> Floats:
        """(r, m) rows that give, multiplied by the parameters, the errors that a bent curve counts as, rad."""
        return np.vstack([np.sqrt(size) * rows for size, rows in zip(self.smoothness, self.bending, strict=True)])

    def header(self, command: Command | None) -> Floats:
        """Return the curve's header for `anglecam.models.torque_curve.curve_at` under a command."""
        cycle = None if command is None else command.cycle
        second = self.axes[1].header if len(self.axes) > 1 else NO_AXIS
        return np.array([*self.axes[0].header, *second, *(cycle or NO_CYCLE)])

    def columns(self, quantities: Sequence[Floats]) -> Floats:
        """Return the acceleration for each parameter, (n, m), at values of the quantities, (n,) each."""
        splines = [axis.splines(x) for axis, x in zip(self.axes, quantities, strict=True)]
        return products(splines) @ self.basis


def products(splines: Sequence[Floats]) -> Floats:
    """Return the products of the (n, k) values of splines along each axis, (n, k) or (n, k·l)."""
    first, *others = splines
    for other in others:
        first = (first[:, :, None] * other[:, None, :]).reshape(len(first), first.shape[1] * other.shape[1])
    return first


@dataclass(frozen=True)
class CurvedPlant(Plant):
    """Plant with a curve, whose parameters follow those of the effects."""

    curve: Curve = field(kw_only=True)

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters in their order."""
        return super().names + tuple(f"curve_{i + 1}_deg_per_s2" for i in range(self.curve.count))

    @property
    def lower(self) -> Floats:
        """Lower bounds, SI."""
        return np.append(super().lower, np.full(self.curve.count, -UNBOUNDED))

    @property
    def upper(self) -> Floats:
        """Upper bounds, SI."""
        return np.append(super().upper, np.full(self.curve.count, UNBOUNDED))

    @property
    def scales(self) -> Floats:
        """Magnitudes, SI, that scale the steps of difference quotients."""
        return np.append(super().scales, np.full(self.curve.count, 0.1))

    @property
    def to_file(self) -> Floats:
        """Factors from SI to the units in `names`."""
        return np.append(super().to_file, np.full(self.curve.count, np.degrees(1.0)))

    @property
    def penalty(self) -> Floats:
        """(r, p) rows that give, multiplied by the parameters, errors that a fit keeps small, rad."""
        rows = self.curve.penalty
        return np.hstack([np.zeros((len(rows), len(self.names) - self.curve.count)), rows])

    def _run(
        self,
        parameters: Floats,
        pairs: Sequence[tuple[Effect, Floats]],
        runs: Runs,
        first: Floats,
        near: Floats | None = None,
    ) -> Floats:
        if "phase" not in self.curve.over or len(runs.played[0]) == 1:
            return super()._run(parameters, pairs, runs, first, near)
        # each command has its period, so those of one command run together
        motion = np.empty((len(runs.time), 2))
        for number in range(len(runs.played[0])):
            which = np.flatnonzero(runs.played[1] == number)
            frames = np.isin(runs.owner, which)
            edges = np.cumsum([0, *np.diff(runs.edges)[which]])
            alone = Runs(
                runs.time[frames],
                edges,
                tuple(runs.commands[i] for i in which),
                tuple(runs.views[i] for i in which),
            )
            motion[frames] = super()._run(
                parameters, pairs, alone, first[which], None if near is None else near[frames]
            )
        return motion

    @cached_property
    def pieces(self) -> Pieces:
        """What is inside the equation of motion, the curve included, compiled."""
        return super().pieces.with_torque(curve_torque)

    def _numbers(self, parameters: Floats, pairs: Sequence[tuple[Effect, Floats]], runs: Runs) -> Floats:
        coefficients = self.curve.basis @ parameters[len(parameters) - self.curve.count :]
        return np.concatenate(
            [super()._numbers(parameters, pairs, runs), self.curve.header(runs.commands[0]), coefficients]
        )

    @property
    def _max_step(self) -> float:
        return super()._max_step or self.smooth_step


def curved(plant: Plant, curve: Curve) -> CurvedPlant:
    """Return a plant of the ledger's effects with a curve in addition."""
    return CurvedPlant(plant.effects, plant.driven, plant.fastest, curve=curve)
