import control
import numpy as np
import pytest

from anglecam.neck.step import linear_step, linear_step_figures

SYS2 = (47.3859 * np.array([1.0, 56.8, 980.1]), np.polymul([1.0, 13.22], [1.0, 12.29, 149.0]))


def test_figures_of_a_second_order_system_are_those_of_its_closed_form():
    zeta, omega = 0.4, 20.0
    figures = linear_step_figures([3.0 * omega**2], [1.0, 2.0 * zeta * omega, omega**2])
    assert figures.overshoot == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2)), abs=1e-13)
    assert figures.steady_state == pytest.approx(3.0, rel=1e-14)
    late = np.linspace(figures.settling_time, 2.0, 20_001)
    damped = omega * np.sqrt(1.0 - zeta**2)
    gone = np.exp(-zeta * omega * late) * np.abs(np.cos(damped * late) + zeta * omega / damped * np.sin(damped * late))
    assert gone.max() == pytest.approx(0.02, abs=1e-10)
    assert gone.argmax() == 0


def test_figures_of_a_double_pole_and_of_a_first_order_lag():
    # 1 − (1 + t)·e^−t reaches 10 % and 90 % at 0.531812 and 3.889720, first order at −ln 0.9 and −ln 0.1
    assert linear_step_figures([1.0], [1.0, 2.0, 1.0]).rise_time == pytest.approx(3.889720170 - 0.531811608, abs=1e-8)
    lag = linear_step_figures([2.0], [0.5, 1.0])
    assert lag.rise_time == pytest.approx(0.5 * np.log(9.0), abs=1e-12)
    assert lag.settling_time == pytest.approx(0.5 * np.log(50.0), abs=1e-12)
    assert lag.overshoot == 0.0


def test_a_fast_and_a_slow_pole_are_both_resolved():
    figures = linear_step_figures([1e4], np.polymul([1.0, 1e4], [1.0, 1.0]))
    assert figures.rise_time == pytest.approx(np.log(9.0), abs=1e-6)


def test_response_is_python_controls_at_uneven_instants():
    time = np.sort(np.random.default_rng(1).uniform(0.0, 2.0, 300))
    dense = np.linspace(0.0, 2.0, 200_001)
    expected = np.interp(time, dense, control.step_response(control.tf(*SYS2), dense).outputs)
    np.testing.assert_allclose(linear_step(*SYS2, time), expected, atol=1e-7)


def test_responses_without_rest_have_no_figures_but_a_course():
    assert np.isnan(linear_step_figures([1.0], [1.0, 1.0, -4.0]).rise_time)
    assert np.isnan(linear_step_figures([1.0], [1.0, 0.0]).steady_state)
    np.testing.assert_allclose(linear_step([1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 3.0]), [0.0, 0.5, 4.5], atol=1e-12)
    np.testing.assert_allclose(linear_step([4.0], [1.0, 0.0, -4.0], [2.0]), [np.cosh(4.0) - 1.0], rtol=1e-12)


def test_improper_systems_are_refused():
    with pytest.raises(ValueError, match="strictly proper"):
        linear_step([1.0, 0.0, 0.0], [1.0, 2.0, 1.0], [0.0])
