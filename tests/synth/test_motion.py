"""The base model against closed forms, and the beginning and end of a motion."""

import math

import numpy as np
import pytest

from support.moved import COMMANDS, EVERYTHING, NECK, NOT_OF_A_NECK, PLANT, let_go, moved, performed
from synth.motion import command_rows, move
from synth.spec import Spec

TIMES = np.linspace(0.0, 3.0, 1501)


OF_A_NECK, OF_THE_PLANT = ("nod",), ("step", "chirp", "free", "random")
"""Commands by which each moves; by the others it does in the sweep."""


def step_response(times: np.ndarray, at: float, level: float) -> np.ndarray:
    """Return the closed-form solution of θ̈ = c·u − a·θ̇ − b·θ from rest, underdamped."""
    since = np.maximum(times - at, 0.0)
    damping, rate = PLANT["a"] / 2, math.sqrt(PLANT["b"] - PLANT["a"] ** 2 / 4)
    swing = np.exp(-damping * since) * (np.cos(rate * since) + damping / rate * np.sin(rate * since))
    return PLANT["c"] / PLANT["b"] * level * (1 - swing)


def test_a_step_gives_the_closed_form_of_the_linear_model():
    expected = step_response(TIMES, 0.7, math.radians(15))
    np.testing.assert_allclose(moved({}).angle(TIMES), expected, atol=1e-10)


def test_speed_is_the_derivative_of_angle():
    times, h = TIMES + 0.0003, 1e-4  # away from the step
    motion = moved({})
    slope = (8 * (motion.angle(times + h) - motion.angle(times - h))) / (12 * h)
    slope -= (motion.angle(times + 2 * h) - motion.angle(times - 2 * h)) / (12 * h)
    np.testing.assert_allclose(motion.speed(times), slope, atol=1e-6)


def test_dead_time_shifts_the_response_exactly_even_by_less_than_a_frame():
    late = moved({"dead_time": {"tau_s": 0.0437}}).angle(TIMES)
    np.testing.assert_allclose(late, step_response(TIMES, 0.7437, math.radians(15)), atol=1e-10)


def test_a_released_head_rests_until_its_release_and_then_swings_about_zero():
    angle = let_go({}, math.degrees(0.2), rest_s=0.7).angle(TIMES)
    expected = 0.2 * np.cos(math.sqrt(524.0) * np.maximum(TIMES - 0.7, 0.0))
    np.testing.assert_allclose(angle, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("effects", "potential"),
    [
        ({}, lambda th: 0.0),
        pytest.param({"stiffening_spring": {"k3": 3000.0}}, lambda th: 750.0 * th**4, marks=pytest.mark.sweep),
        ({"one_sided_spring": {"stiffness": 400.0, "slack_deg": 2.0}}, lambda th: slack_energy(th, 400.0, 2.0)),
        ({"constant_torque": {"torque": 12.0}}, lambda th: -12.0 * th),
    ],
)
def test_the_undamped_rig_keeps_its_energy_over_ten_seconds(effects, potential):
    motion = let_go(effects, 14.0, 10.5)
    times = np.linspace(0.5, 10.5, 20001)
    theta, omega = motion.angle(times), motion.speed(times)
    energy = omega**2 / 2 + 262.0 * theta**2 + potential(theta)
    np.testing.assert_allclose(energy / energy[0], 1.0, atol=1e-7)


def slack_energy(theta: np.ndarray, stiffness: float, slack_deg: float) -> np.ndarray:
    return stiffness / 2 * np.maximum(theta - math.radians(slack_deg), 0.0) ** 2


def test_actuator_lag_delays_the_response_and_keeps_the_final_value():
    lagging = moved({"actuator_lag": {"tau_s": 0.05}})
    final = PLANT["c"] / PLANT["b"] * math.radians(15)
    assert lagging.angle(3.0) == pytest.approx(final, abs=1e-9)
    # partial fractions of 1/((1 + τs)·(s² + as + b)·s): three exponentials and the final value
    poles = np.array([-1 / 0.05, *np.roots([1.0, PLANT["a"], PLANT["b"]])])
    weights = [1 / (p * np.prod(p - np.delete(poles, k))) for k, p in enumerate(poles)]
    since = TIMES[TIMES > 0.7] - 0.7
    answer = final + math.radians(15) * PLANT["c"] / 0.05 * sum(
        w * np.exp(p * since) for w, p in zip(weights, poles, strict=True)
    )
    np.testing.assert_allclose(lagging.angle(since + 0.7), answer.real, atol=1e-9)


def test_a_periodic_disturbance_moves_the_head_by_the_frequency_response():
    frequency, strength = 1.7, 12.0
    effects = {"periodic_disturbance": {"amplitude": strength, "frequency_hz": frequency, "phase": 0.8}}
    times = np.linspace(3.0, 5.9, 2000)
    rate = 2 * math.pi * frequency
    answer = strength / complex(PLANT["b"] - rate**2, PLANT["a"] * rate)
    expected = (answer * np.exp(1j * (rate * times + 0.8))).imag
    np.testing.assert_allclose(moved(effects, None, 6.0).angle(times), expected, atol=1e-9)


def test_a_constant_torque_has_moved_the_head_before_the_film_begins():
    motion = moved({"constant_torque": {"torque": 10.0}})
    np.testing.assert_allclose(motion.angle(np.linspace(-1.0, 0.7, 50)), 10.0 / PLANT["b"], atol=1e-12)
    stuck = moved({"constant_torque": {"torque": 10.0}, "coulomb_friction": {"torque": 6.0}}, None)
    np.testing.assert_allclose(stuck.angle(TIMES), 4.0 / PLANT["b"], atol=1e-11)  # friction holds the other 6
    held = moved({"constant_torque": {"torque": 10.0}, "coulomb_friction": {"torque": 11.0}}, None)
    assert np.ptp(held.angle(TIMES)) == 0.0


def test_a_motion_is_defined_a_second_before_and_after_for_times_of_any_shape():
    motion = let_go({"elastic_coupling": {"frequency_hz": 5.0}}, 12.0, 3.0)
    grid = np.linspace(-1.0, 4.0, 60).reshape(3, 4, 5)
    assert motion.angle(grid).shape == motion.speed(grid).shape == motion.appendage(grid).shape == (3, 4, 5)
    assert motion.angle(-1.0) == pytest.approx(math.radians(12.0), abs=0)
    assert motion.speed(-1.0) == motion.appendage(0.3) == 0.0
    assert abs(motion.appendage(1.0)) > 1e-3
    assert moved({}).appendage(2.0) == 0.0


@pytest.mark.parametrize(
    ("plant", "kind"),
    [
        *(pytest.param("linear", kind, marks=() if kind in OF_THE_PLANT else pytest.mark.sweep) for kind in COMMANDS),
        *(pytest.param("neck", kind, marks=() if kind in OF_A_NECK else pytest.mark.sweep) for kind in COMMANDS),
    ],
)
def test_everything_at_once_moves_by_every_command(plant, kind):
    effects = EVERYTHING
    if plant == "neck":
        effects = {name: effect for name, effect in EVERYTHING.items() if name not in NOT_OF_A_NECK}
    controller = {"pulse_hz": 50, "bits": 8, "phase_s": 0.003}
    motion = performed(effects, kind, plant=NECK if plant == "neck" else PLANT, controller=controller)
    times = np.linspace(-1.0, 4.0, 2001)
    angle = np.degrees(motion.angle(times))
    assert np.isfinite(angle).all()
    assert np.abs(np.diff(angle)).max() < 4.0  # no jump: 2.5 ms at the nod's 440°/s is 1.1°
    assert 2.0 < np.ptp(angle) <= 70.0
    assert np.ptp(angle[times < 0]) == 0.0


def test_a_head_that_would_leave_the_linkages_reach_is_an_error_with_the_time():
    for effects, plant in (({"linkage_geometry": {"share": 0.2}}, PLANT), ({}, NECK)):
        with pytest.raises(ValueError, match=r"would leave the range in which the linkage closes, at t = 0\.\d+ s"):
            moved(effects, np.array([[0.0, 0.0], [0.5, 75.0]]), plant=plant)


def test_a_runaway_on_a_softening_spring_is_an_error():
    with pytest.raises(ValueError, match=r"runs away, at t = 0\.\d+ s"):
        moved({"stiffening_spring": {"k3": -3e5}})


def test_contradicting_shares_are_an_error():
    effects = {"torque_saturation": {"limit": 50, "share": 0.5}, "linkage_geometry": {"share": 0.7}}
    with pytest.raises(ValueError, match="share"):
        moved(effects)


def test_the_same_spec_gives_bitwise_the_same_motion():
    recording = {"name": "x", "duration_s": 2.0, "command": {"kind": "random"}}
    spec = Spec.model_validate({"effects": EVERYTHING, "recordings": [recording]})
    angles = []
    for _ in range(2):
        rows = command_rows(spec.recordings[0], np.random.SeedSequence(7))
        angles.append(move(spec, spec.recordings[0], rows, 2.0).angle(TIMES))
    assert (angles[0] == angles[1]).all()
