"""The paper's design procedure: from identified a, b, c to the quantities of the neck, with their uncertainty.

The procedure has seven steps. Steps 1 and 2 choose a mechanism and measure a person, 3 is `identified`, 4 is `known`, 5
is one of three routes through

    c  = c3/J                                       J stands for J + γ·J_r
    a/c = (C + c3·c4·γ)/c3                          Eq. (34a),  c3 = K_m·G_a/(G_g·R_a),  c4 = K_m/(G_a·G_g)
    b/c = h·γ + (K·L2·L6 − M_h·g·L·cos θ0)/c3       Eq. (34b)
    c3·h·γ + K·L2·L6 − M_h·g·L·cos θ0 > 0           Eq. (35)

and 6 is `explained_neck`, from which `anglecam.neck.synthesis` starts. Step 7, control, is `anglecam.neck.pd`. γ is the
slope −0.36 = dθ_f/dθ_s, as in `anglecam.neck.linear`.

========================  ================================  ============================
route                     taken as known                    gives
========================  ================================  ============================
`by_inertia`              J, γ, spring, weight, C           c3, h, c4
`by_inertia_and_motor`    J, γ, weight, h, K_m, G_a, G_g    c3, C, K·L2·L6
`by_motor`                K_m, G_a, G_g, R_a, γ, spring,    J, h, C
                          weight
========================  ================================  ============================

The covariance of a, b, c and of the known quantities is propagated to every result. A physical constant that comes out
negative is reported as a contradiction between a known quantity and the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anglecam.neck.contradictions import contradictions
from anglecam.neck.correlated import CorrelatedQuantities, UncertainValue, correlated
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import PAPER, NeckParameters
from anglecam.neck.variation import PARAMETERS


@dataclass(frozen=True)
class Relations:
    """Result of one route through Eqs. (34)-(35); every quantity in SI, with its standard uncertainty."""

    route: str
    """Name of the function of this module."""
    given: tuple[str, ...]
    """Names in ``quantities`` that the route takes as known."""
    found: tuple[str, ...]
    """Names in ``quantities`` that the route gives."""
    quantities: CorrelatedQuantities
    """All quantities, with their covariance."""
    contradictions: tuple[str, ...]
    """Lines on where the motion contradicts what is taken as known; empty if nowhere."""

    def __getitem__(self, name: str) -> UncertainValue:
        return self.quantities[name]

    @property
    def stable(self) -> bool:
        """Whether Eq. (35) holds, so that the neck returns to neutral."""
        return self["stiffness"].value > 0.0


def identified(a: float, b: float, c: float, uncertainty: ArrayLike = (0.0, 0.0, 0.0)) -> CorrelatedQuantities:
    """Return the identified parameters of Eq. (30) with their covariance (step 3).

    Parameters
    ----------
    a, b, c : float
        1/s, 1/s² and rad/(s²·V); c is positive.
    uncertainty : (3,) or (3, 3) array_like
        Standard uncertainties, or the covariance.

    Returns
    -------
    CorrelatedQuantities
        ``a``, ``b`` and ``c``.

    Raises
    ------
    ValueError
        If c is not positive or the covariance is not valid.
    """
    if not c > 0.0:
        raise ValueError(f"c = {c:g} rad/(s²·V) is not positive: reverse the sign of the command or of the angle")
    return correlated({"a": a, "b": b, "c": c}, uncertainty)


def known(neck: NeckParameters = PAPER, sigmas: Mapping[str, float] | None = None) -> CorrelatedQuantities:
    """Return the quantities of the neck that are known before the design, with their covariance (step 4).

    Parameters
    ----------
    neck : NeckParameters
        Weighed, measured or from data sheets; a route ignores the quantities that it finds itself.
    sigmas : mapping, optional
        Standard uncertainties, SI, by a symbol of `anglecam.neck.variation.PARAMETERS`; the others count as exact. Mass
        and lever arm enter inertia and weight alike, which gives these two a covariance. L_6 is here the arm of the
        spring only: γ has a separate uncertainty.

    Returns
    -------
    CorrelatedQuantities
        ``inertia`` J + γ·J_r kg·m², ``gamma``, ``spring`` K·L2·L6 N·m, ``weight`` M_h·g·L·cos θ0 N·m, ``damping`` C
        N·m·s, ``sensor_gain`` h V/rad, ``motor_constant`` N·m/A, ``amplifier_gain``, ``gear_ratio``,
        ``output_impedance`` Ω. `CorrelatedQuantities.replaced` exchanges a value that is known
        from another source.

    Raises
    ------
    ValueError
        For an unknown symbol, a negative uncertainty or γ = 0.
    """
    given = dict(sigmas or {})
    unknown = set(given) - set(PARAMETERS)
    if unknown:
        raise ValueError(f"no quantity {', '.join(sorted(unknown))}; there are {', '.join(PARAMETERS)}")
    if neck.gamma == 0.0:
        raise ValueError("γ is 0: the servo does not move the head")
    head = neck.head
    primitives = {s: p.read(neck) for s, p in PARAMETERS.items()} | {"arm": neck.spring.arm}
    errors = {s: given.get(s, 0.0) for s in PARAMETERS} | {"arm": given.get("L_6", 0.0)}

    def aggregates(q: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "inertia": q["J_cg"] + q["M_h"] * q["L"] ** 2 + q["gamma"] * q["J_r"],
            "spring": q["K"] * q["L_2"] * q["arm"],
            "weight": q["M_h"] * head.gravity * q["L"] * np.cos(q["theta_0"]),
        }

    every = correlated(primitives, [errors[s] for s in primitives]).derived(aggregates)
    names = {
        "inertia": "inertia",
        "gamma": "gamma",
        "spring": "spring",
        "weight": "weight",
        "C": "damping",
        "h": "sensor_gain",
        "K_m": "motor_constant",
        "G_a": "amplifier_gain",
        "G_g": "gear_ratio",
        "R_a": "output_impedance",
    }
    at = [every.names.index(s) for s in names]
    return CorrelatedQuantities(tuple(names.values()), every.values[at], every.covariance[np.ix_(at, at)])


def by_inertia(found: CorrelatedQuantities, beforehand: CorrelatedQuantities) -> Relations:
    """Find c3, h and c4 from a known inertia, spring, weight and damping (step 5, the paper's first way).

    Parameters
    ----------
    found, beforehand : CorrelatedQuantities
        From `identified` and `known`.

    Returns
    -------
    Relations
        ``torque_gain`` c3 N·m/V, ``sensor_gain`` h V/rad, ``back_emf_ratio`` c4 = K_m/(G_a·G_g) V·s/rad,
        ``sensor_gain_bound`` V/rad (Eq. (35): h lies below it where γ < 0), ``damping_bound`` N·m·s (C at which c4 is
        0), ``spring_bound`` N·m (K·L2·L6 at which h is 0) and ``stiffness`` b·J N·m.
    """

    def relation(q: Mapping[str, Any]) -> dict[str, Any]:
        c3 = q["c"] * q["inertia"]
        passive = q["spring"] - q["weight"]
        return {
            "torque_gain": c3,
            "sensor_gain": (q["b"] / q["c"] - passive / c3) / q["gamma"],
            "back_emf_ratio": (q["a"] / q["c"] - q["damping"] / c3) / q["gamma"],
            "sensor_gain_bound": -passive / (c3 * q["gamma"]),
            "damping_bound": q["a"] * q["inertia"],
            "spring_bound": q["b"] * q["inertia"] + q["weight"],
            "stiffness": q["b"] * q["inertia"],
        }

    given = ("inertia", "gamma", "spring", "weight", "damping")
    return _relations("by_inertia", given, found, beforehand, relation)


def by_inertia_and_motor(found: CorrelatedQuantities, beforehand: CorrelatedQuantities) -> Relations:
    """Find c3, C and K·L2·L6 from a known inertia and motor (step 5, the paper's second way).

    Parameters
    ----------
    found, beforehand : CorrelatedQuantities
        From `identified` and `known`.

    Returns
    -------
    Relations
        ``torque_gain`` c3 = c·J N·m/V and ``motor_torque_gain`` K_m·G_a/(G_g·R_a), which should be equal;
        ``back_emf_ratio`` c4 V·s/rad, ``damping`` C N·m·s, ``spring`` K·L2·L6 N·m, ``sensor_gain_bound`` V/rad and
        ``stiffness`` N·m.
    """

    def relation(q: Mapping[str, Any]) -> dict[str, Any]:
        c3 = q["c"] * q["inertia"]
        c4 = q["motor_constant"] / (q["amplifier_gain"] * q["gear_ratio"])
        spring = (q["b"] / q["c"] - q["sensor_gain"] * q["gamma"]) * c3 + q["weight"]
        motor = q["motor_constant"] * q["amplifier_gain"] / (q["gear_ratio"] * q["output_impedance"])
        return {
            "torque_gain": c3,
            "motor_torque_gain": motor,
            "torque_gain_gap": c3 - motor,
            "back_emf_ratio": c4,
            "damping": q["a"] / q["c"] * c3 - c3 * c4 * q["gamma"],
            "spring": spring,
            "sensor_gain_bound": (q["weight"] - spring) / (c3 * q["gamma"]),
            "stiffness": q["b"] * q["inertia"],
        }

    motor = ("motor_constant", "amplifier_gain", "gear_ratio", "output_impedance")
    given = ("inertia", "gamma", "weight", "sensor_gain", *motor)
    return _relations("by_inertia_and_motor", given, found, beforehand, relation)


def by_motor(found: CorrelatedQuantities, beforehand: CorrelatedQuantities) -> Relations:
    """Find J, h and C from a known motor, spring and weight (step 5, with the motor in place of the inertia).

    Parameters
    ----------
    found, beforehand : CorrelatedQuantities
        From `identified` and `known`.

    Returns
    -------
    Relations
        ``torque_gain`` c3 N·m/V, ``inertia`` J + γ·J_r = c3/c kg·m², ``sensor_gain`` h V/rad, ``back_emf_ratio`` c4
        V·s/rad, ``damping`` C N·m·s, ``sensor_gain_bound`` V/rad, ``spring_bound`` N·m and ``stiffness`` N·m.
    """

    def relation(q: Mapping[str, Any]) -> dict[str, Any]:
        c3 = q["motor_constant"] * q["amplifier_gain"] / (q["gear_ratio"] * q["output_impedance"])
        c4 = q["motor_constant"] / (q["amplifier_gain"] * q["gear_ratio"])
        passive = q["spring"] - q["weight"]
        return {
            "torque_gain": c3,
            "inertia": c3 / q["c"],
            "sensor_gain": (q["b"] / q["c"] - passive / c3) / q["gamma"],
            "back_emf_ratio": c4,
            "damping": q["a"] * c3 / q["c"] - c3 * c4 * q["gamma"],
            "sensor_gain_bound": -passive / (c3 * q["gamma"]),
            "spring_bound": q["b"] * c3 / q["c"] + q["weight"],
            "stiffness": q["b"] * c3 / q["c"],
        }

    motor = ("motor_constant", "amplifier_gain", "gear_ratio", "output_impedance")
    return _relations("by_motor", ("gamma", "spring", "weight", *motor), found, beforehand, relation)


def explained_neck(relations: Relations, neck: NeckParameters = PAPER) -> NeckParameters:
    """Return a neck whose Eq. (28) is the identified motion (step 6).

    Parameters
    ----------
    relations : Relations
        Without contradictions.
    neck : NeckParameters
        Lengths, mass and γ: the same neck that the route was given.

    Returns
    -------
    NeckParameters
        With C, h and K as found or given. R_a and G_a, the two that the paper had to estimate, are set to give c3 and
        c4; the inertia of the head about its centre of mass is set to give J.

    Raises
    ------
    ValueError
        If the relations contradict each other.
    """
    if relations.contradictions:
        raise ValueError(relations.contradictions[0])
    q = {name: relations.quantities[name].value for name in relations.quantities.names}
    servo, head, spring = neck.servo, neck.head, neck.spring
    gain = servo.motor_constant / (q["back_emf_ratio"] * servo.gear_ratio)
    impedance = servo.motor_constant * gain / (servo.gear_ratio * q["torque_gain"])
    own = q["inertia"] - q["gamma"] * servo.rotor_inertia - head.mass * head.centre_of_mass**2
    if own < 0.0:
        raise ValueError(
            f"J = {q['inertia']:.4g} kg·m² is less than the head's M_h·L² = "
            f"{head.mass * head.centre_of_mass**2:.4g} kg·m²"
        )
    return replace(
        neck,
        servo=replace(servo, amplifier_gain=gain, output_impedance=impedance, sensor_gain=q["sensor_gain"]),
        head=replace(head, own_inertia=own),
        spring=replace(spring, rate=q["spring"] / (spring.base * spring.arm)),
        damping=q["damping"],
        gamma=q["gamma"],
    )


def sensor_gain_bound(neck: NeckParameters) -> float:
    """Return the sensor gain at which Eq. (35) fails, V/rad: h lies below it where γ < 0, above it where γ > 0."""
    servo = neck.servo
    stiffness = linear_neck(neck).stiffness
    return servo.sensor_gain - stiffness / (neck.gamma * servo.torque_gain)


def _relations(
    route: str,
    given: tuple[str, ...],
    found: CorrelatedQuantities,
    beforehand: CorrelatedQuantities,
    relation: Callable[[Mapping[str, Any]], dict[str, Any]],
) -> Relations:
    """Apply a relation to the motion and the known quantities that it needs."""
    at = [beforehand.names.index(name) for name in given]
    start = found + CorrelatedQuantities(given, beforehand.values[at], beforehand.covariance[np.ix_(at, at)])
    whole = start.derived(relation)
    results = whole.names[len(start.names) :]
    return Relations(route, given, results, whole, contradictions(whole, results))
