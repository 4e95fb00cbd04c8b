import numpy as np
import pytest

from anglecam.neck.head import centre_of_mass, centre_of_mass_acceleration, head_acceleration, moments_about_pivot
from anglecam.neck.parameters import PAPER

HEAD = PAPER.head
RNG = np.random.default_rng(0)
THETA, OMEGA, ALPHA, RESISTING, TORQUE = RNG.uniform(-2.0, 2.0, (5, 50))


def test_equation_15_is_the_second_derivative_of_equation_14():
    h = 1e-4

    def along(t: float) -> np.ndarray:
        return np.stack(centre_of_mass(HEAD, THETA + OMEGA * t + ALPHA * t**2 / 2))

    second = (along(h) - 2 * along(0.0) + along(-h)) / h**2
    np.testing.assert_allclose(np.stack(centre_of_mass_acceleration(HEAD, THETA, OMEGA, ALPHA)), second, atol=1e-6)


def test_equation_16_follows_from_13_and_15():
    moments = moments_about_pivot(HEAD, THETA, OMEGA, ALPHA, RESISTING, TORQUE)
    weight = HEAD.mass * HEAD.gravity * HEAD.centre_of_mass * np.sin(THETA)
    np.testing.assert_allclose(moments, HEAD.inertia * ALPHA + RESISTING - weight - TORQUE, atol=1e-14)


def test_the_acceleration_leaves_no_moment_over():
    alpha = head_acceleration(HEAD, THETA, RESISTING, TORQUE)
    np.testing.assert_allclose(moments_about_pivot(HEAD, THETA, OMEGA, alpha, RESISTING, TORQUE), 0.0, atol=1e-13)


def test_the_head_falls_away_from_upright():
    assert head_acceleration(HEAD, 0.3, 0.0, 0.0) > 0.0 > head_acceleration(HEAD, -0.3, 0.0, 0.0)


def test_inertia_is_0_00585():
    assert HEAD.inertia == pytest.approx(0.00585, abs=5e-6)
