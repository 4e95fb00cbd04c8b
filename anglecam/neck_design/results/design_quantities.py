"""Units, symbols and rows of the quantities that the design relations hold, Eqs. (34) and (35)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated

from anglecam.neck.correlated import CorrelatedQuantities, UncertainValue
from anglecam.neck_design.text import with_sigma
from anglecam.neck_design.units import NEWTON_METRE, OHM, ONE, Unit, UnitsByName

_DAMPING = Unit("N_m_s", "N·m·s")
_SENSOR_GAIN = Unit("V_per_rad", "V/rad")
_TORQUE_GAIN = Unit("N_m_per_V", "N·m/V")

UNITS = {
    "a": Unit("per_s", "1/s"),
    "b": Unit("per_s2", "1/s²"),
    "c": Unit("rad_per_s2_V", "rad/(s²·V)"),
    "inertia": Unit("kg_m2", "kg·m²"),
    "gamma": ONE,
    "spring": NEWTON_METRE,
    "weight": NEWTON_METRE,
    "damping": _DAMPING,
    "sensor_gain": _SENSOR_GAIN,
    "motor_constant": Unit("N_m_per_A", "N·m/A"),
    "amplifier_gain": ONE,
    "gear_ratio": ONE,
    "output_impedance": OHM,
    "torque_gain": _TORQUE_GAIN,
    "motor_torque_gain": _TORQUE_GAIN,
    "torque_gain_gap": _TORQUE_GAIN,
    "back_emf_ratio": Unit("V_s_per_rad", "V·s/rad"),
    "sensor_gain_bound": _SENSOR_GAIN,
    "damping_bound": _DAMPING,
    "spring_bound": NEWTON_METRE,
    "stiffness": NEWTON_METRE,
}
"""Unit of each quantity of `anglecam.neck.design`."""

LABELS = {
    "inertia": "J + γ·J_r",
    "spring": "K·L2·L6",
    "damping": "C",
    "sensor_gain": "h",
    "torque_gain": "c3",
    "motor_torque_gain": "K_m·G_a/(G_g·R_a)",
    "torque_gain_gap": "difference",
    "back_emf_ratio": "c4",
    "sensor_gain_bound": "h at the bound of Eq. (35)",
    "damping_bound": "C at which c4 = 0",
    "spring_bound": "K·L2·L6 at which h = 0",
    "stiffness": "stiffness b·J, Eq. (35)",
}
"""Label of a quantity in a table; any other has its name."""

Quantities = Annotated[Mapping[str, UncertainValue], UnitsByName(UNITS)]
"""Values with standard uncertainties by the names of `anglecam.neck.design`."""


def quantities(every: CorrelatedQuantities, names: Sequence[str]) -> dict[str, UncertainValue]:
    """Return some of the quantities by name."""
    return {name: every[name] for name in names}


def fact(name: str, value: UncertainValue) -> tuple[str, str]:
    """Return a quantity's label and value for a table."""
    return LABELS.get(name, name.replace("_", " ")), f"{with_sigma(value)} {UNITS[name].symbol}".rstrip()
