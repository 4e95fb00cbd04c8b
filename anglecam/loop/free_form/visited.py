"""The motion that a fitted plant shows, as the quantities that a torque can depend on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.identification.joined import join
from anglecam.loop.refit import plant_of
from anglecam.loop.seen import dense_motion, torque_response
from anglecam.models.curved_plant import Curve


@dataclass(frozen=True)
class Stretch:
    """The quantities at evenly spaced instants of one recording, denser than its frames; arrays of length n."""

    time: Floats = field(repr=False)
    """s."""
    quantities: Mapping[str, Floats] = field(repr=False)
    """Name, as in `anglecam.models.torque_curve.QUANTITIES` → values; phases are NaN without a period."""

    def acceleration(self, curve: Curve) -> Floats:
        """Return the acceleration for each parameter of a curve, (n, m); zeros where it has no value."""
        values = [self.quantities[name] for name in curve.over]
        known = np.all(np.isfinite(values), axis=0)
        found = np.zeros((len(self.time), curve.count))
        found[known] = curve.columns([x[known] for x in values])
        return found


@dataclass(frozen=True)
class Visited:
    """What a fitted plant visits in its recordings."""

    fit: Fit = field(repr=False)
    records: tuple[Record, ...] = field(repr=False)
    stretches: tuple[Stretch, ...] = field(repr=False)
    """One for each recording."""

    def all(self, name: str) -> Floats:
        """Return a quantity in all recordings."""
        return np.concatenate([one.quantities[name] for one in self.stretches])

    @property
    def names(self) -> list[str]:
        """Quantities that vary."""
        return [name for name in self.stretches[0].quantities if np.ptp(_finite(self.all(name))) > 0.0]

    def responses(self, curve: Curve) -> Floats:
        """Return the change of the whitened angles for each parameter of a curve, (N, m).

        It is the response of the linear plant with the a and b of the fit.
        """
        a, b = self.fit.parameters[:2].tolist()
        blocks = [
            torque_response(one.time, one.acceleration(curve), record.time, a, b)
            for one, record in zip(self.stretches, self.records, strict=True)
        ]
        return np.nan_to_num(join(self.records, self.fit.phi).whiten(np.concatenate(blocks)))

    def followed(self, stretch: Stretch, over: Sequence[str]) -> Floats:
        """Return the functions of some quantities that the base model can follow, (n, f).

        A constant is followed by the zeros of the angle unless one is declared, and a straight line over the angle by
        b, over the velocity by a, over the command by c.
        """
        constant = [] if any(r.zero_known for r in self.records) else [np.ones(len(stretch.time))]
        lines = [stretch.quantities[name] for name in over if name in ("angle", "velocity", "command")]
        return np.column_stack([np.empty((len(stretch.time), 0)), *constant, *lines])


def _finite(values: Floats) -> Floats:
    return values[np.isfinite(values)] if np.isfinite(values).any() else np.zeros(1)


def visit(fit: Fit, records: Sequence[Record]) -> Visited:
    """Run a fitted plant through its recordings.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, on ``records``.
    records : sequence of Record
        The fitted recordings.

    Returns
    -------
    Visited
        Its motion.
    """
    found = []
    for record, time, motion in zip(records, *dense_motion(fit, records), strict=True):
        quantities = {"angle": motion[:, 0], "velocity": motion[:, 1]}
        if plant_of(fit).driven:
            quantities["command"] = np.zeros(len(time)) if record.command is None else record.command.at(time)
        quantities |= {"phase": _phase(record, time), "time": time}
        found.append(Stretch(time, quantities))
    return Visited(fit, tuple(records), tuple(found))


def _phase(record: Record, time: Floats) -> Floats:
    """Return the share of the command's period that has passed, 0 to 1; NaN without a period."""
    cycle = None if record.command is None else record.command.cycle
    if cycle is None:
        return np.full(len(time), np.nan)
    return np.asarray(np.mod((time - cycle[1]) / cycle[0], 1.0))
