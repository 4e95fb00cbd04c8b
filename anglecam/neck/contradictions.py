"""Where an identified motion contradicts what is taken as known of the neck.

The paper gives an example: a = 26 with C = 0.0532 N·m·s gives c4 = −0.09, "however, the constant c4 cannot be negative
because the K_m, G_a, and G_g are all positive. Therefore the a/c ratio suggests that the initial damping constant term
is underestimated."
"""

from __future__ import annotations

import math

from anglecam.neck.correlated import CorrelatedQuantities, UncertainValue

_COVERAGE = 2.0
"""Standard uncertainties beyond which a sign or a difference counts as significant."""


def contradictions(q: CorrelatedQuantities, found: tuple[str, ...]) -> tuple[str, ...]:
    """Return a line for each contradiction between a motion and what is taken as known.

    Parameters
    ----------
    q : CorrelatedQuantities
        All quantities of a route, by the names of `anglecam.neck.design`.
    found : tuple of str
        Names of the quantities that the route finds.

    Returns
    -------
    tuple of str
        Each names both sides and the value that would resolve it; empty if there is no contradiction.
    """
    lines: list[str] = []
    a, b, spring, gamma = q["a"], q["b"], q["spring"], q["gamma"].value
    if b.value <= 0.0:
        lines.append(f"b = {text(b)} 1/s² is not positive: Eq. (35) does not hold, the neck falls from neutral")
    if "back_emf_ratio" in found and q["back_emf_ratio"].value < 0.0:
        wrong, bound = ("small", "at least") if gamma < 0.0 else ("large", "at most")
        lines.append(
            f"c4 = {text(q['back_emf_ratio'])} V·s/rad cannot be negative: C = {text(q['damping'])} N·m·s is too "
            f"{wrong} to explain a = {text(a)} 1/s; it takes {bound} {text(q['damping_bound'])} N·m·s"
            + _doubt(q["back_emf_ratio"])
        )
    if "sensor_gain" in found and q["sensor_gain"].value < 0.0:
        wrong, bound = ("small", "at least") if gamma < 0.0 else ("large", "at most")
        lines.append(
            f"h = {text(q['sensor_gain'])} V/rad cannot be negative: K·L2·L6 = {text(spring)} N·m is too {wrong} "
            f"to explain b = {text(b)} 1/s²; it takes {bound} {text(q['spring_bound'])} N·m" + _doubt(q["sensor_gain"])
        )
    if "damping" in found and q["damping"].value < 0.0:
        lines.append(
            f"C = {text(q['damping'])} N·m·s cannot be negative: the motor's back-emf explains more than "
            f"a = {text(a)} 1/s" + _doubt(q["damping"])
        )
    if "spring" in found and spring.value < 0.0:
        lines.append(
            f"K·L2·L6 = {text(spring)} N·m cannot be negative: h = {text(q['sensor_gain'])} V/rad explains more than "
            f"b = {text(b)} 1/s²" + _doubt(spring)
        )
    if "torque_gain_gap" in found:
        gap = q["torque_gain_gap"]
        if 0.0 < _COVERAGE * gap.sigma < abs(gap.value):
            lines.append(
                f"c·J = {text(q['torque_gain'])} N·m/V and K_m·G_a/(G_g·R_a) = {text(q['motor_torque_gain'])} N·m/V "
                f"differ by {text(gap)}: inertia or motor is not as stated"
            )
    return tuple(lines)


def _doubt(quantity: UncertainValue) -> str:
    """Return a remark if zero lies within `_COVERAGE` standard uncertainties."""
    if abs(quantity.value) > _COVERAGE * quantity.sigma:
        return ""
    return " (zero lies within two standard uncertainties: the data do not exclude a small positive value)"


def text(quantity: UncertainValue) -> str:
    """Write a quantity to the second digit of its uncertainty, or to three digits if it is exact."""
    if quantity.sigma == 0.0:
        return f"{quantity.value:.3g}".replace("-", "−")
    digits = max(0, 1 - math.floor(math.log10(quantity.sigma)))
    return f"{quantity.value:.{digits}f} ± {quantity.sigma:.{digits}f}".replace("-", "−")
