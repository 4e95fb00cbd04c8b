import math

import pytest

from anglecam.neck.damping import SAE_20_VISCOSITY, OilFilm, damping_torque, shear_stress, surface_speed
from anglecam.neck.parameters import PAPER

NO_LOAD = math.pi / 3 / 0.11
"""rad/s, HS-225: 0.11 s for 60°."""


def test_the_papers_film_gives_0_0530():
    assert OilFilm().damping == pytest.approx(0.0530, abs=5e-5)  # printed: 0.0532


def test_real_sae_20_oil_damps_a_thousand_times_less():
    assert OilFilm(viscosity=SAE_20_VISCOSITY).damping == pytest.approx(5.3e-5, abs=5e-8)
    assert PAPER.damping / OilFilm(viscosity=SAE_20_VISCOSITY).damping > 2800


def test_equation_22_is_19_to_21_put_together():
    film, omega = OilFilm(), 3.0
    stress = shear_stress(film, surface_speed(film, omega))
    assert stress == pytest.approx(125.0 * omega * 6.35e-3 / 0.12e-3, rel=1e-12)
    assert damping_torque(film, omega) == pytest.approx(film.damping * omega, rel=1e-12)


def test_the_area_of_equation_21_is_that_of_two_bearings():
    assert OilFilm().area == pytest.approx(2 * (math.pi * 12.7e-3 * 15.8e-3), rel=1e-12)


def test_half_the_no_load_speed_damps_with_0_252_newton_metres():
    assert damping_torque(OilFilm(), NO_LOAD / 2) == pytest.approx(0.252, abs=5e-4)
