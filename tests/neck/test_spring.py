import numpy as np
import pytest

from anglecam.neck.parameters import PAPER, SpringParameters
from anglecam.neck.spring import (
    Preload,
    elongation,
    large_angle_rate,
    length,
    moment_arm,
    moment_arm_slope,
    neutral_spring_angle,
    small_angle_torque,
    spring_tangent,
    spring_torque,
)

SPRING = PAPER.spring
ANGLES = np.radians(np.linspace(-30.0, 40.0, 71))
SINGLE, PAIR = Preload(0.0072), Preload(0.042, 0.028)
H = 1e-6


def test_neutral_is_the_right_triangle_of_figure_6():
    angle = neutral_spring_angle(SPRING)
    h1 = length(SPRING, angle)
    assert h1**2 + SPRING.base**2 == pytest.approx(SPRING.arm**2, rel=1e-12)
    assert np.sin(angle) == pytest.approx(h1 / SPRING.arm, rel=1e-12)
    assert moment_arm(SPRING, angle) == pytest.approx(SPRING.base, rel=1e-12)


def test_the_arm_is_the_height_over_the_spring_and_the_rate_of_its_length():
    prime = neutral_spring_angle(SPRING) + ANGLES
    held = np.array([SPRING.base, 0.0])
    pulled = SPRING.arm * np.stack([np.cos(prime), np.sin(prime)], axis=-1)
    along = pulled - held
    height = (held[0] * along[:, 1] - held[1] * along[:, 0]) / np.hypot(*along.T)
    np.testing.assert_allclose(moment_arm(SPRING, prime), height, atol=1e-15)
    rate = (length(SPRING, prime + H) - length(SPRING, prime - H)) / (2 * H)
    np.testing.assert_allclose(moment_arm(SPRING, prime), rate, atol=1e-9)


def test_the_slope_of_the_arm_is_as_printed_in_equation_33():
    prime = neutral_spring_angle(SPRING) + ANGLES
    slope = (moment_arm(SPRING, prime + H) - moment_arm(SPRING, prime - H)) / (2 * H)
    np.testing.assert_allclose(moment_arm_slope(SPRING, prime), slope, atol=1e-8)
    assert moment_arm_slope(SPRING, neutral_spring_angle(SPRING)) == pytest.approx(0.0, abs=1e-15)


def test_k_l2_l6_is_5_318_and_the_tangent_at_neutral_whatever_the_preload():
    for preload in (Preload(0.0), SINGLE, PAIR):
        assert spring_tangent(SPRING, preload, 0.0) == pytest.approx(5.318, abs=5e-4)
    assert small_angle_torque(SPRING, 1.0) == pytest.approx(5.318, abs=5e-4)


def test_equation_18b_as_printed_has_another_tangent_of_the_other_sign():
    shortening = -elongation(SPRING, np.array([-H, H])) * SPRING.rate * SPRING.base
    assert np.diff(shortening)[0] / (2 * H) == pytest.approx(-SPRING.rate * SPRING.base**2, rel=1e-5)
    assert large_angle_rate(SPRING) * SPRING.base**2 == pytest.approx(5.318, abs=5e-4)


@pytest.mark.parametrize("preload", [SINGLE, PAIR])
def test_the_tangent_is_the_derivative_of_the_torque(preload):
    slope = (spring_torque(SPRING, preload, ANGLES + H) - spring_torque(SPRING, preload, ANGLES - H)) / (2 * H)
    np.testing.assert_allclose(spring_tangent(SPRING, preload, ANGLES), slope, atol=2e-8)


def test_the_torque_is_the_derivative_of_the_springs_energy():
    def energy(delta: np.ndarray) -> np.ndarray:
        behind, before = PAIR.behind + elongation(SPRING, delta), PAIR.before + elongation(SPRING, -delta)
        return large_angle_rate(SPRING) / 4 * (behind**2 + before**2)

    np.testing.assert_allclose(
        spring_torque(SPRING, PAIR, ANGLES), (energy(ANGLES + H) - energy(ANGLES - H)) / (2 * H), atol=1e-7
    )


def test_small_angles_are_the_limit_of_large_ones():
    for delta, error in ((1e-2, 2e-3), (1e-3, 2e-5)):
        for preload in (Preload(0.0), Preload(0.03, 0.03)):
            assert spring_torque(SPRING, preload, delta) == pytest.approx(small_angle_torque(SPRING, delta), rel=error)


def test_equal_springs_against_each_other_pull_evenly_both_ways():
    even = Preload(0.03, 0.03)
    np.testing.assert_allclose(spring_torque(SPRING, even, ANGLES), -spring_torque(SPRING, even, -ANGLES), atol=1e-15)


def test_an_arm_shorter_than_the_base_makes_no_right_triangle():
    with pytest.raises(ValueError, match="must be longer than base"):
        neutral_spring_angle(SpringParameters(base=0.06, arm=0.05))
