"""Fig. 16 and Eq. (37), margins against a dense locus, the nonlinear loop against the linear one, tuning."""

import json

import control
import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.responses_json import nod_from_responses
from anglecam.neck.large_angle import LargeAngleNeck, acceleration, equilibrium
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import PAPER
from anglecam.neck.pd import (
    PdGains,
    close_loop,
    eq_37,
    gains_table,
    linear_plant,
    linearised,
    loop_response,
    rest_gain,
    simulate_pd,
    sys2,
    third_order_plant,
)
from anglecam.neck.pd_tuning import ADULT, NodTarget, tune_pd

NECK = linear_neck(PAPER)


def test_sys2_overshoots_by_10_per_cent():
    figures = close_loop(sys2(), PdGains()).figures
    assert figures.overshoot == pytest.approx(0.1004, abs=5e-5)
    assert figures.rise_time == pytest.approx(0.166, abs=5e-4)
    assert figures.settling_time == pytest.approx(0.48, abs=5e-3)
    assert figures.steady_state == pytest.approx(23.58, abs=5e-3)


@pytest.mark.parametrize("K_d", [0.005, 0.01])
def test_fig_16_damps_with_k_d_and_keeps_the_steady_state(K_d):
    figures = close_loop(sys2(), PdGains(0.0, K_d)).figures
    assert figures.overshoot < 1e-9
    assert figures.steady_state == pytest.approx(23.58, abs=5e-3)


def test_fig_16_k_p_of_a_hundredth_loses_19_per_cent():
    loop = close_loop(sys2(), PdGains(0.01, 0.0))
    assert loop.loss == pytest.approx(0.19, abs=2e-3)
    assert loop.figures.steady_state * loop.reference_gain == pytest.approx(23.5777, abs=1e-4)


def test_the_table_has_every_pair_of_gains():
    table = gains_table(sys2())
    assert len(table) == 16
    assert [t.figures.overshoot < 0.005 for t in table] == 4 * [False, False, True, True]


@pytest.mark.parametrize("gains", [PdGains(0.0, 0.005), PdGains(1e-4, 0.01), PdGains(0.01, 0.0)])
def test_eq_37_is_the_feedback_loop_about_sys2(gains):
    ours, printed = close_loop(sys2(), gains).system, eq_37(gains)
    s = 1j * np.logspace(-2, 3, 200)
    np.testing.assert_allclose(printed(s), ours(s), rtol=2e-3)  # Eq. (37) rounds 25.51 to 25.5


def test_a_third_order_fit_of_sys2_is_the_same_plant():
    below, above = sys2().den[0][0], sys2().num[0][0]
    plant = third_order_plant([*below[1:], *above])
    assert close_loop(plant, PdGains()).figures.overshoot == pytest.approx(0.1004, abs=5e-5)


def test_pd_about_the_linear_neck_adds_to_a_and_b():
    gains = PdGains(0.3, 0.05)
    below = close_loop(linear_plant(NECK), gains).system.den[0][0]
    np.testing.assert_allclose(below / below[0], [1.0, NECK.a + 0.05 * NECK.c, NECK.b + 0.3 * NECK.c], rtol=1e-12)


@pytest.mark.parametrize("K", [(0.5, 0.02), (2.0, 0.0), (0.0, 0.2)])
def test_margins_are_those_of_a_dense_locus(K):
    # a lagging plant, so that every margin is finite where the gain passes 1
    plant = control.series(linear_plant(NECK), control.tf([1.0], [0.01, 1.0]))
    loop = close_loop(plant, PdGains(*K))
    omega = np.concatenate([[0.0], np.logspace(-2, 5, 400_001)])
    L = plant(1j * omega) * (K[0] + K[1] * 1j * omega)
    assert loop.margins.modulus == pytest.approx(np.abs(1.0 + L).min(), rel=1e-6)
    assert loop.margins.sensitivity == pytest.approx(1.0 / loop.margins.modulus)
    crossings = np.flatnonzero(np.diff(np.sign(np.abs(L) - 1.0)))
    away = np.abs(np.angle(-L[crossings]))
    assert loop.margins.phase == pytest.approx(away.min() if len(away) else np.inf, abs=1e-3)
    if np.isfinite(loop.margins.delay):
        late = np.exp(-1j * omega * loop.margins.delay)
        assert np.abs(1.0 + L * late).min() < 1e-3
    if np.isfinite(loop.margins.gain):
        for factor, stable in ((0.999, True), (1.001, False)):
            poles = control.feedback(plant * control.tf([K[1], K[0]], [1.0]) * loop.margins.gain * factor, 1).poles()
            assert (poles.real.max() < 0.0) == stable


def test_an_unstable_loop_has_neither_figures_nor_margins():
    loop = close_loop(linear_plant(NECK), PdGains(0.0, -0.2))
    assert np.isnan(loop.figures.rise_time)
    assert np.isnan(loop.margins.modulus)


def test_the_simulated_loop_of_a_linear_neck_is_the_linear_loop():
    gains = PdGains(0.2, 0.03)
    motion = simulate_pd(lambda q, w, u: NECK.c * u - NECK.a * w - NECK.b * q, gains, 0.4, 1.5)
    loop = close_loop(linear_plant(NECK), gains)
    np.testing.assert_allclose(motion.angle, loop_response(loop, motion.time, 0.4), atol=1e-8)
    assert motion.figures.overshoot == pytest.approx(loop.figures.overshoot, abs=1e-5)
    assert motion.figures.rise_time == pytest.approx(loop.figures.rise_time, abs=1e-5)
    np.testing.assert_allclose(motion.voltage[[0, -1]], [0.4, NECK.b / NECK.c * motion.angle[-1]], atol=1e-6)


def test_a_nonlinear_neck_is_linearised_where_it_rests():
    def pendulum(q: float, w: float, u: float) -> float:
        return 500.0 * u - 25.0 * w - 700.0 * np.sin(q)

    rest = np.arcsin(500.0 * 0.8 / 700.0)
    below = linearised(pendulum, rest, 0.8).den[0][0]
    np.testing.assert_allclose(below, [1.0, 25.0, 700.0 * np.cos(rest)], rtol=1e-7)
    motion = simulate_pd(pendulum, PdGains(0.0, 0.05), 0.8, 2.0)
    assert motion.figures.steady_state == pytest.approx(rest, abs=1e-6)
    assert np.isnan(simulate_pd(pendulum, PdGains(0.0, -0.05), 0.8, 2.0).figures.rise_time)


def test_the_large_angle_neck_starts_out_as_the_linear_one_and_rests_elsewhere():
    neck = LargeAngleNeck()

    def swing(q, w, u):
        return acceleration(neck, q, w, u)

    below = linearised(swing, 0.0, 0.0).den[0][0]
    np.testing.assert_allclose(below, [1.0, NECK.a, NECK.b], rtol=1e-4)
    gains = tune_pd(linear_plant(NECK)).loop.gains
    small, large = (simulate_pd(swing, gains, u, 2.0).figures for u in (0.01, 0.4))
    loop = close_loop(linear_plant(NECK), gains).figures
    assert small.rise_time == pytest.approx(loop.rise_time, rel=0.01)
    assert small.steady_state / 0.01 == pytest.approx(loop.steady_state, rel=0.01)
    assert large.steady_state == pytest.approx(equilibrium(neck, 0.4), abs=1e-5)
    assert abs(large.steady_state / (0.4 * loop.steady_state) - 1.0) > 0.02


def test_a_head_that_leaves_the_reach_of_its_linkage_is_an_error():
    neck = LargeAngleNeck(gamma="exact")
    with pytest.raises(ValueError, match="the head leaves its linkage's reach"):
        simulate_pd(lambda q, w, u: acceleration(neck, q, w, u), PdGains(), 3.0, 1.0)


def test_gain_at_rest_of_integrators_and_differentiators():
    s = control.tf([1.0, 0.0], [1.0])
    lag = control.tf([2.0], [1.0, 1.0])
    assert [rest_gain(g) for g in (lag, lag * s, lag / s, lag * s / s)] == [2.0, 0.0, np.inf, 2.0]
    loop = close_loop(lag / s, PdGains(0.5, 0.1))
    assert loop.loss == 1.0
    assert loop.margins.modulus > 0.5


@pytest.mark.parametrize("plant", [sys2(), linear_plant(NECK)])
def test_tuning_gives_the_adults_nod(plant):
    tuned = tune_pd(plant)
    assert tuned.feasible
    assert tuned.loop.figures.rise_time == pytest.approx(0.3, rel=0.0201)
    assert tuned.loop.figures.overshoot <= 0.00501
    assert tuned.loop.loss < 1e-6  # damping alone does it
    assert tuned.loop.margins.sensitivity <= 2.0


def test_tuning_speeds_a_slow_neck_up_where_the_loss_is_allowed():
    slow = control.tf([20.0], [1.0, 9.0, 20.0])
    tuned = tune_pd(slow, NodTarget(0.2, 0.05), largest_loss=0.9)
    assert tuned.feasible
    assert tuned.loop.figures.rise_time == pytest.approx(0.2, rel=0.0201)
    assert tuned.loop.gains.proportional > 0.0
    assert tuned.loop.figures.steady_state * tuned.loop.reference_gain == pytest.approx(1.0, rel=1e-6)


def test_an_unmet_constraint_is_named_with_the_nearest_value():
    slow = control.tf([20.0], [1.0, 9.0, 20.0])
    tuned = tune_pd(slow, NodTarget(0.2, 0.0), largest_loss=0.01)
    assert not tuned.feasible
    assert any(line.startswith("rise time ≤ 0.204 s") for line in tuned.unmet)
    with pytest.raises(ValueError, match="only for a stable plant"):
        tune_pd(control.tf([1.0], [1.0, 1.0, 0.0]))


def test_a_measured_nod_is_read_from_its_responses(tmp_path):
    def row(rise, overshoot):
        return {"rise_time_s": {"value": rise, "sigma": 0.01}, "overshoot": {"value": overshoot, "sigma": 0.02}}

    path = tmp_path / "nod.responses.json"
    path.write_text(json.dumps([row(0.4, 0.1), row(None, 0.0), row(0.5, 0.2), row(0.6, 0.3)]))
    nod = nod_from_responses(path)
    assert (nod.rise_time, nod.overshoot) == (0.5, pytest.approx(0.2))
    assert nod.rise_tolerance == pytest.approx(0.04)
    assert nod_from_responses(path, 0).rise_time == 0.4
    assert ADULT.rise_time == 0.3
    for text, cause in (("{", "not a list"), ("[]", "none of 0"), ('[{"rise_time_s": 1}]', "not a list")):
        path.write_text(text)
        with pytest.raises(InputError, match=f"nod.responses.json: {cause}"):
            nod_from_responses(path)
    with pytest.raises(InputError, match="cannot be read"):
        nod_from_responses(tmp_path / "none.json")
