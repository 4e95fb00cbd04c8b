"""Damping by the oil film of the sleeve bearings: Eqs. (19)-(22).

    τ = μ·ΔU/Δt                                                                                          Eq. (19)
    U = Δθ̇·d/2                                                                                           Eq. (20)
    T_d = τ·A·d/2,   A = 2π·d·w                                                                          Eq. (21)
    T_d = C·Δθ̇,   C = π·μ·d³·w/(2t)                                                                      Eq. (22)

t is the thickness of the film. A counts two bearings of area π·d·w each, the "two shaft support" of the text.

The paper uses μ = 125 N·s/m² for SAE 20 oil and prints C = 0.0532 N·m·s; Eq. (22) gives 0.0530. But this oil has about
0.125 N·s/m² near room temperature, and its film damps a thousand times less: 5.3e-5 N·m·s. The damping of the neck must
then have another cause, which shows in the paper when a moves from 5 to 26 1/s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats

PAPER_VISCOSITY = 125.0
"""μ printed by the paper, N·s/m²."""
SAE_20_VISCOSITY = 0.125
"""μ of SAE 20 oil near room temperature, N·s/m²."""


@dataclass(frozen=True)
class OilFilm:
    """The film between shaft and bearings; the defaults are the paper's."""

    viscosity: float = PAPER_VISCOSITY
    """μ, N·s/m²."""
    diameter: float = 12.7e-3
    """d of the shaft, m."""
    width: float = 15.8e-3
    """w of a bearing, m."""
    thickness: float = 0.12e-3
    """t, m: clearance between shaft and bearing."""

    @property
    def area(self) -> float:
        """A = 2π·d·w of Eq. (21), m², of both bearings together."""
        return 2.0 * math.pi * self.diameter * self.width

    @property
    def damping(self) -> float:
        """C = π·μ·d³·w/(2t) of Eq. (22), N·m·s."""
        return math.pi * self.viscosity * self.diameter**3 * self.width / (2.0 * self.thickness)


def surface_speed(film: OilFilm, omega: ArrayLike) -> Floats:
    """Return the speed of the shaft's surface, m/s, at a speed of the head, rad/s, Eq. (20)."""
    return np.asarray(np.asarray(omega, dtype=float) * film.diameter / 2.0)


def shear_stress(film: OilFilm, speed: ArrayLike) -> Floats:
    """Return the shear stress in the film, N/m², at a speed of the shaft's surface, m/s, Eq. (19)."""
    return np.asarray(film.viscosity * np.asarray(speed, dtype=float) / film.thickness)


def damping_torque(film: OilFilm, omega: ArrayLike) -> Floats:
    """Return the torque that opposes the motion, from stress, area and radius, Eqs. (19)-(21).

    Parameters
    ----------
    film : OilFilm
        Viscosity and dimensions.
    omega : array_like
        Δθ̇ of the head, rad/s.

    Returns
    -------
    ndarray
        T_d, N·m.
    """
    return np.asarray(shear_stress(film, surface_speed(film, omega)) * film.area * film.diameter / 2.0)
