"""``anglecam neck power``: energy and power of each nod, and the fitted source, as in Figs. 12 and 13."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from anglecam.neck.correlated import UncertainValue
from anglecam.neck.power import SERVOS, PowerLog, PowerUse
from anglecam.neck_design.render import Facts, Layout, Rows
from anglecam.neck_design.text import number, with_sigma
from anglecam.neck_design.units import INTERNAL, OHM, VOLT, Ampere, Amperes, Column, Time, Unit, Voltage, Watt


@dataclass(frozen=True)
class NodRow:
    """Energy and power of one nod."""

    start: Annotated[Time, Column("nod, s", _span_text)]
    end: Time
    energy: Annotated[float, Unit("J"), Column("energy, J", 3)]
    charge: Annotated[float, Unit("A_s")]
    mean_power: Annotated[Watt, Column("mean, W", 3)]
    peak_power: Annotated[Watt, Column("peak, W", 3)]
    peak_current: Annotated[Ampere, Column("peak, A", 3)]
    lowest_voltage: Annotated[Voltage, Column("lowest, V", 3)]


def _span_text(nod: NodRow) -> str:
    return f"{number(nod.start, 3)} … {number(nod.end, 3)}"


@dataclass(frozen=True)
class SourceFacts:
    """The fitted source V = V0 − R·I."""

    open_voltage: Annotated[UncertainValue, VOLT]
    """V0."""
    resistance: Annotated[UncertainValue, OHM]
    """R."""
    correlation: float
    """Between V0 and R."""
    residual: Voltage
    """Standard deviation of the voltage around the line."""
    current_range: Amperes
    greatest_power: Watt
    """That a load can draw."""


@dataclass(frozen=True)
class Power:
    """Result of ``anglecam neck power``."""

    nods: tuple[NodRow, ...]
    source: SourceFacts
    idle_power: Watt
    servos: int
    all_servos: Watt
    """Mean power if all servos of the head nodded at once."""
    log: Annotated[PowerLog, INTERNAL]
    use: Annotated[PowerUse, INTERNAL]

    def tables(self) -> list[Layout]:
        """Return the nods and the facts of the source."""
        source = self.source
        facts = [
            ("source V0", f"{with_sigma(source.open_voltage)} V"),
            ("source R", f"{with_sigma(source.resistance)} Ω"),
            ("scatter about it", f"{number(source.residual, 3)} V"),
            ("most a load can draw", f"{number(source.greatest_power, 3)} W"),
            ("between nods", f"{number(self.idle_power, 3)} W"),
            (f"all {self.servos} servos at once", f"{number(self.all_servos, 1)} W"),
        ]
        return [Rows(self.nods), Facts("power", facts)]

    def remarks(self) -> tuple[str, ...]:
        """Return nothing: there is nothing to remark."""
        return ()


def power_of(log: PowerLog, use: PowerUse) -> Power:
    """Return the nods and the source of a log for the renderer.

    Parameters
    ----------
    log : PowerLog
        Voltage and current of one servo.
    use : PowerUse
        What `anglecam.neck.power.power_use` found in it.

    Returns
    -------
    Power
        For the renderer and the figure.
    """
    source = use.source
    sigmas = np.sqrt(np.diag(source.covariance))
    return Power(
        nods=tuple(
            NodRow(
                nod.start,
                nod.end,
                nod.energy,
                nod.charge,
                nod.mean_power,
                nod.peak_power,
                nod.peak_current,
                nod.lowest_voltage,
            )
            for nod in use.nods
        ),
        source=SourceFacts(
            open_voltage=UncertainValue(source.open_voltage, float(sigmas[0])),
            resistance=UncertainValue(source.resistance, float(sigmas[1])),
            correlation=float(source.covariance[0, 1] / sigmas.prod()) if sigmas.all() else 0.0,
            residual=source.residual,
            current_range=source.range,
            greatest_power=source.greatest_power,
        ),
        idle_power=use.idle_power,
        servos=SERVOS,
        all_servos=use.all_servos,
        log=log,
        use=use,
    )
