import math

import numpy as np
import pytest

from synth.command import command_rows
from synth.motion import drive_from_rows, move
from synth.spec import Effects, Plant, Recording

PLANT = Plant(a=26.0, b=524.0, c=508.0)
UNDAMPED = Plant(a=0.0, b=524.0, c=508.0)
PERIOD = 2 * math.pi / math.sqrt(524.0)
STEP = np.array([[0.0, 0.0], [0.7, 15.0]])
TIMES = np.linspace(0.0, 3.0, 1501)


def moved(
    plant: Plant, effects: dict, rows: np.ndarray | None, end: float = 3.0, start: float = 0.0, let_go: float = 0.0
):
    hidden = Effects.model_validate(effects)
    return move(plant, hidden, drive_from_rows(rows, hidden), end, start, let_go)


def step_response(times: np.ndarray, at: float, level: float) -> np.ndarray:
    """Solve θ̈ = c·u − a·θ̇ − b·θ from rest in closed form, underdamped."""
    since = np.maximum(times - at, 0.0)
    damping, rate = PLANT.a / 2, math.sqrt(PLANT.b - PLANT.a**2 / 4)
    swing = np.exp(-damping * since) * (np.cos(rate * since) + damping / rate * np.sin(rate * since))
    return PLANT.c / PLANT.b * level * (1 - swing)


def test_a_step_gives_the_closed_form_of_the_linear_model():
    expected = step_response(TIMES, 0.7, math.radians(15))
    np.testing.assert_allclose(moved(PLANT, {}, STEP).angle(TIMES), expected, atol=1e-9)


def test_dead_time_shifts_the_answer_exactly_even_by_less_than_a_frame():
    late = moved(PLANT, {"dead_time": {"tau_s": 0.0437}}, STEP).angle(TIMES)
    np.testing.assert_allclose(late, step_response(TIMES, 0.7437, math.radians(15)), atol=1e-9)


def test_free_release_waits_for_the_hand_and_then_swings_about_zero():
    angle = moved(UNDAMPED, {}, None, 3.0, 0.2, 0.7).angle(TIMES)
    expected = 0.2 * np.cos(math.sqrt(524.0) * np.maximum(TIMES - 0.7, 0.0))
    np.testing.assert_allclose(angle, expected, atol=1e-8)


@pytest.mark.parametrize("k3", [0.0, 3000.0])
def test_the_undamped_rig_keeps_its_energy_over_ten_seconds(k3):
    effects = {"stiffening_spring": {"k3": k3}}
    motion = moved(UNDAMPED, effects, None, 10.0, 0.25)
    h = 2e-4
    times = np.linspace(0.01, 9.99, 2000)
    before, now, after = (motion.angle(times + shift) for shift in (-h, 0.0, h))
    omega = (after - before) / (2 * h)
    # the central difference has a known error of h²/6 of the third derivative, θ⃛ = −(b + 3·k3·θ²)·θ̇
    omega /= 1 - h**2 / 6 * (524.0 + 3 * k3 * now**2)
    energy = omega**2 / 2 + 524.0 * now**2 / 2 + k3 * now**4 / 4
    reference = 524.0 * 0.25**2 / 2 + k3 * 0.25**4 / 4
    np.testing.assert_allclose(energy / reference, 1.0, atol=1e-6)


def test_dry_friction_takes_2_f_over_b_from_every_half_swing_and_then_holds():
    friction = 12.0
    motion = moved(UNDAMPED, {"coulomb_friction": {"torque": friction}}, None, 3.0, 0.25)
    loss = 2 * friction / UNDAMPED.b
    swings = int((0.25 - friction / UNDAMPED.b) // loss) + 1
    turning = motion.angle(PERIOD / 2 * np.arange(swings + 1))
    expected = (0.25 - loss * np.arange(swings + 1)) * (-1.0) ** np.arange(swings + 1)
    np.testing.assert_allclose(turning, expected, atol=1e-8)
    stuck = motion.angle(np.linspace(swings * PERIOD / 2 + 1e-6, 3.0, 50))
    assert np.ptp(stuck) == 0.0
    assert abs(stuck[0]) <= friction / UNDAMPED.b


def test_a_stuck_head_waits_for_the_breakaway_torque():
    effects = {"coulomb_friction": {"torque": 4.0, "breakaway": 10.0}, "rate_limit": {"r_deg_per_s": 30.0}}
    motion = moved(PLANT, effects, STEP)
    away = 0.7 + 10.0 / (PLANT.c * math.radians(30.0))  # the ramp reaches breakaway here
    assert motion.angle(away - 1e-6) == 0.0
    shortly = 1e-3  # from then on 10 − 4 rad/s² are left, and the ramp adds to it
    grown = 6.0 * shortly**2 / 2 + PLANT.c * math.radians(30.0) * shortly**3 / 6
    assert motion.angle(away + shortly) == pytest.approx(grown, rel=0.02)


def test_drag_takes_the_energy_that_it_should():
    # on the way down d(ω²)/dθ = −2bθ + 2qω², so that (1 + 2qθ)·e^(−2qθ) is the same at both turning points
    q, start = 2.0, 0.25
    turned = moved(UNDAMPED, {"quadratic_drag": {"q": q}}, None, 0.4, start).angle(np.linspace(0, 0.3, 60001)).min()

    def kept(theta: float) -> float:
        return (1 + 2 * q * theta) * math.exp(-2 * q * theta)

    assert turned > -0.24
    assert kept(turned) == pytest.approx(kept(start), abs=1e-7)


def test_actuator_lag_settles_where_the_plant_does_and_answers_later():
    lagging = moved(PLANT, {"actuator_lag": {"tau_s": 0.05}}, STEP)
    final = PLANT.c / PLANT.b * math.radians(15)
    assert lagging.angle(3.0) == pytest.approx(final, abs=1e-6)
    t = 0.01  # third order: θ = c·u·t³/(6τ) at first
    assert lagging.angle(0.7 + t) == pytest.approx(PLANT.c * math.radians(15) * t**3 / (6 * 0.05), rel=0.15)


def test_the_rate_limit_carries_on_from_where_a_new_command_finds_it():
    rows = np.array([[0.0, 0.0], [0.5, 10.0], [0.6, 0.0], [1.5, 5.0]])
    drive = drive_from_rows(rows, Effects.model_validate({"rate_limit": {"r_deg_per_s": 50.0}}))
    np.testing.assert_allclose(drive.knots, [0.0, 0.5, 0.6, 0.7, 1.5, 1.6])
    np.testing.assert_allclose(np.degrees(drive.levels), [0, 0, 5, 0, 0, 5], atol=1e-12)
    np.testing.assert_allclose(np.degrees(drive.slopes), [0, 50, -50, 0, 50, 0], atol=1e-12)


def test_a_periodic_disturbance_shakes_the_head_by_the_frequency_response():
    frequency, strength = 1.7, 12.0
    effects = {"periodic_disturbance": {"amplitude": strength, "frequency_hz": frequency}}
    angle = moved(PLANT, effects, None, 6.0).angle(np.linspace(3.0, 3.0 + 5 / frequency, 2000, endpoint=False))
    rate = 2 * math.pi * frequency
    gain = 1 / abs(complex(PLANT.b - rate**2, PLANT.a * rate))
    assert np.ptp(angle) / 2 == pytest.approx(strength * gain, rel=1e-4)


@pytest.mark.parametrize("effect", [{}, {"coulomb_friction": {"torque": 5.0, "breakaway": 6.0}}])
@pytest.mark.parametrize("kind", ["step", "stairs", "triangle", "chirp", "release", "random"])
def test_every_command_starts_with_rest_and_keeps_within_its_amplitude(kind, effect):
    command = {"kind": kind, "levels_deg": [5, -10]} if kind == "stairs" else {"kind": kind}
    recording = Recording.model_validate({"name": "x", "duration_s": 4.0, "command": command})
    rows = command_rows(recording, np.random.SeedSequence(3))
    assert rows is not None
    assert tuple(rows[0]) == (0.0, 0.0)
    assert rows[1, 0] >= 0.5
    assert (np.diff(rows[:, 0]) > 0).all()
    assert np.abs(rows[:, 1]).max() <= 15.0
    angle = np.degrees(moved(PLANT, effect, rows, 4.0).angle(np.linspace(0, 4, 121)))
    assert np.abs(angle[:15]).max() == 0.0
    assert 3.0 < np.abs(angle).max() < 25.0
