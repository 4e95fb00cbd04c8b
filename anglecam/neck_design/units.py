"""How a field of a result is written: its unit in the JSON key, its conversion, its column in a table.

A result is a frozen dataclass whose fields hold SI and radians. What a reader sees stands in the field's annotation:

>>> from dataclasses import dataclass
>>> from typing import Annotated
>>> @dataclass(frozen=True)
... class Row:
...     nod: Annotated[Angle, Column("Δθ, °", 1)]

`anglecam.neck_design.render` writes that field as ``"nod_deg": 10.0`` and as the cell ``10.0`` below ``Δθ, °``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from anglecam.neck.turning import KGF_CM


@dataclass(frozen=True)
class Unit:
    """A unit in which a field is written."""

    suffix: str
    """End of the JSON key, after an underscore; empty for a number without unit."""
    symbol: str = ""
    """As printed in a table."""
    convert: Callable[[float], float] = field(default=float, compare=False)
    """From SI to this unit."""


@dataclass(frozen=True)
class Column:
    """Column of a table that shows a field of its rows."""

    heading: str
    """May hold ``{name}`` placeholders, which `anglecam.neck_design.render.Rows` fills in."""
    cell: int | str | Callable[[Any], str] = ""
    """Digits after the point, a format specification, or a function of the row.

    The function is named, not a lambda: `typing.get_type_hints` evaluates annotations with the class as globals, where
    a lambda would not find the module's names.
    """


@dataclass(frozen=True)
class UnitsByName:
    """Marks a mapping whose keys get the unit of the quantity that they name."""

    units: Mapping[str, Unit]


@dataclass(frozen=True)
class WithUnit:
    """A value whose unit depends on the call, such as the output of the controlled plant."""

    value: float
    unit: Unit


@dataclass(frozen=True)
class Marker:
    """Marks a field that is treated otherwise than by its unit."""

    name: str


INLINE = Marker("inline")
"""The fields of this dataclass are written among those of the one that holds it."""
OPTIONAL = Marker("optional")
"""Left out of the JSON where it is ``None``; other fields are written as ``null``."""
INTERNAL = Marker("internal")
"""Not written: the source of figures or of lines below the tables."""

ONE = Unit("", "")
DEGREE = Unit("deg", "°", math.degrees)
PERCENT = Unit("percent", "%", lambda share: 100.0 * share)
DECIBEL = Unit("dB", "dB", lambda factor: 20.0 * math.log10(factor) if factor > 0.0 else math.nan)
NEWTON_METRE = Unit("N_m", "N·m")
KILOGRAM_FORCE_CENTIMETRE = Unit("kgf_cm", "kgf·cm", lambda torque: torque / KGF_CM)
OHM = Unit("ohm", "Ω")
VOLT = Unit("V", "V")

Angle = Annotated[float, DEGREE]
Angles = Annotated[tuple[float, ...], DEGREE]
Ampere = Annotated[float, Unit("A", "A")]
Amperes = Annotated[tuple[float, ...], Unit("A", "A")]
DampingConstant = Annotated[float, Unit("N_m_s", "N·m·s")]
Length = Annotated[float, Unit("m", "m")]
Share = Annotated[float, ONE, PERCENT]
Time = Annotated[float, Unit("s", "s")]
Torque = Annotated[float, NEWTON_METRE]
TorqueInBothUnits = Annotated[float, NEWTON_METRE, KILOGRAM_FORCE_CENTIMETRE]
Voltage = Annotated[float, VOLT]
Watt = Annotated[float, Unit("W", "W")]
