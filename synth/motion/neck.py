"""The paper's neck at large angles: servo, linkage, springs and head, Eqs. (5)-(18) and (31).

    T = c3·U − J_r·θ̈_a − K_m²/(G_g²·R_a)·θ̇_a − c3·h·θ_a,   c3 = K_m·G_a/(G_g·R_a)                    Eq. (11)
    J·θ̈ + C·θ̇ + F_s·L_s − M_h·g·L·sin(θ0 + θ) = T,   J = M_h·L² + J_cg                               Eq. (16)

Eqs. (3) and (12) use θ_a = γΔθ with a constant γ = −0.36, the slope dθ_f/dθ_s of Fig. 4. This slope is printed
inverted, in the torque as well, but Eq. (28) and the identified b are based on it. Here γ is the exact four-bar's at
every angle, so θ_a = Γ(θ) = ∫γ dθ, θ̇_a = γ·θ̇, θ̈_a = γ·θ̈ + γ′·θ̇². At small angles this reduces to Eq. (28) with γ
at neutral.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from anglecam.neck import FourBar
from synth.motion.linkage import Transmission, transmission
from synth.motion.mechanism import Terms
from synth.spec import LinearPlant, NeckPlant, Plant

SPARE = 1.25
"""Safety factor of the springs' pre-tension: stretch at neutral over the largest reduction of stretch in the reach."""


@dataclass(frozen=True)
class Springs:
    """Two springs, in front of and behind the shaft, that carry the head at neutral and restore it.

    The paper has two springs (Figs. 2, 3) but writes a single spring that can also push, F_s = K·Δx with either sign. A
    single spring that only pulls would be slack 9° below neutral. Here two springs of half the rate act against each
    other, mirror images at neutral. Their common stretch is so large that neither goes slack within the linkage's
    reach, and the difference of their stretches carries the head, Eqs. (23)-(24).

    Each has the length ℓ(θ′)² = L2² + L6² − 2·L2·L6·cos θ′ and the arm ℓ′ of Eq. (17), with θ′ = θ′0 ± θ. Neutral is
    the right angle of Fig. 6 (c), cos θ′0 = L2/L6, where the arm is L2 as in the paper; there ℓ″ = 0, so that the
    stretch adds no stiffness. The tangent stiffness of Eqs. (24)-(28) is K·L2·L6, because Eq. (18a) uses L6·Δθ as the
    change in length. The lengths of Eq. (18b) change by L2·Δθ. Both agree if K in Eq. (18b) is the paper's K times
    L6/L2, as here.
    """

    base: float
    """L2, m."""
    arm: float
    """L6, m."""
    rate: float
    """Rate of each spring, N/m."""
    behind: float
    """Stretch at neutral of the spring that pulls the head towards −θ, m."""
    before: float
    """Stretch at neutral of the other spring, m."""

    def stretched(self, theta: float) -> tuple[float, float]:
        """Return the stretch of the spring behind the shaft and of the spring in front of it, m."""
        rest = self._length(0.0)
        return self.behind + self._length(theta) - rest, self.before + self._length(-theta) - rest

    def torque(self, theta: float) -> float:
        """Return F_s·L_s of Eq. (16), N·m; a positive torque acts against θ."""
        behind, before = self.stretched(theta)
        return self.rate * (behind * self._arm_at(theta) - before * self._arm_at(-theta))

    def _length(self, turned: float) -> float:
        return math.sqrt(self.base**2 + self.arm**2 - 2 * self.base * self.arm * math.cos(self._neutral + turned))

    def _arm_at(self, turned: float) -> float:
        return self.base * self.arm * math.sin(self._neutral + turned) / self._length(turned)  # Eq. (17)

    @property
    def _neutral(self) -> float:
        return math.acos(self.base / self.arm)


@dataclass(frozen=True)
class Neck:
    """Eq. (31) with the exact linkage; C_i = 1 V/rad in Eq. (29), so that v in rad is U in V."""

    plant: NeckPlant
    through: Transmission
    springs: Springs

    @property
    def inertia(self) -> float:
        """Return J, kg·m²."""
        return self.plant.mass * self.plant.centre_of_mass**2 + self.plant.own_inertia

    @property
    def gain(self) -> float:
        """Return c3/J, 1/(s²·V)."""
        p = self.plant
        return p.motor_constant * p.amplifier_gain / (p.gear_ratio * p.output_impedance) / self.inertia

    @property
    def reach(self) -> tuple[float, float]:
        """Return the linkage's reach."""
        return self.through.reach

    def terms(self, theta: float, omega: float, damping: float) -> Terms:
        """Return the terms, see `Mechanism`; `damping` multiplies C only, the motor's damping is unaffected."""
        p = self.plant
        _, gamma, bend = self.through.at(theta)
        viscous = p.damping * damping + _motor_damping(p) * gamma
        weight = p.mass * p.gravity * p.centre_of_mass * math.sin(math.radians(p.neutral_deg) + theta)
        torque = weight - self.springs.torque(theta) - viscous * omega - p.rotor_inertia * bend * omega**2
        return Terms(
            feedback=p.sensor_gain * self.through.gathered(theta),
            lever=1.0,
            passive=torque / self.inertia,
            inertia=1 + p.rotor_inertia / self.inertia * gamma,
        )


def build_neck(plant: NeckPlant, linkage: FourBar) -> Neck:
    """Assemble servo, linkage, springs and head."""
    through = transmission(linkage)
    rate = plant.spring_rate * plant.spring_arm / plant.spring_base / 2
    carried = plant.mass * plant.gravity * plant.centre_of_mass * math.sin(math.radians(plant.neutral_deg))
    difference = carried / (rate * plant.spring_base)
    low, high = through.reach
    unstretched = Springs(plant.spring_base, plant.spring_arm, rate, 0.0, 0.0)
    common = -SPARE * unstretched.stretched(-max(-low, high))[0]
    springs = replace(unstretched, behind=common + max(difference, 0.0), before=common + max(-difference, 0.0))
    return Neck(plant, through, springs)


def linear_model(plant: Plant, linkage: FourBar) -> tuple[float, float, float]:
    """Return a, b, c of a plant in the limit of small angles.

    Parameters
    ----------
    plant : LinearPlant or NeckPlant
        Without effects.
    linkage : FourBar
        Link lengths, m.

    Returns
    -------
    a, b, c : float
        1/s, 1/s², 1/s²: those of the linear plant, or those of Eq. (28) with γ at neutral.

    Raises
    ------
    ValueError
        If the neck cannot be built.
    """
    if isinstance(plant, LinearPlant):
        return plant.a, plant.b, plant.c
    neck = build_neck(plant, linkage)
    gamma, c3 = neck.through.neutral_gamma, neck.gain * neck.inertia
    inertia = neck.inertia + gamma * plant.rotor_inertia
    damping = plant.damping + _motor_damping(plant) * gamma
    gravity = plant.mass * plant.gravity * plant.centre_of_mass * math.cos(math.radians(plant.neutral_deg))
    spring = plant.spring_rate * plant.spring_base * plant.spring_arm
    stiffness = c3 * plant.sensor_gain * gamma + spring - gravity
    return damping / inertia, stiffness / inertia, c3 / inertia


def _motor_damping(plant: NeckPlant) -> float:
    """Return K_m²/(G_g²·R_a) of Eq. (11), N·m·s."""
    return plant.motor_constant**2 / (plant.gear_ratio**2 * plant.output_impedance)
