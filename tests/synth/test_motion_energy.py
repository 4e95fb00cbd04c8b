"""Energy balance of the motion at every instant, with all powers derived independently of `synth.motion`.

Energy is stored in motion, springs and weight. The servo, the disturbance and a constant torque supply power, all kinds
of friction dissipate it. The balance is the equation of motion times the speed. It holds to the integrator's accuracy
only if every term is present in every mode and the state is continuous from kink to kink.
"""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline

from anglecam.neck import FourBar, head_angle, servo_angle
from support.moved import EVERYTHING, NECK, NOT_OF_A_NECK, PLANT, spec_of
from synth.motion import Motion, command_rows, move
from synth.motion.drive import drive
from synth.motion.neck import build_neck
from synth.spec import Spec

UNTIL, STEP_S = 4.0, 2e-5
LIMIT = EVERYTHING["torque_saturation"]["limit"]
TIMES = np.arange(0.0, UNTIL + STEP_S / 2, STEP_S)


def everything(kind: str, plant: dict) -> tuple[Spec, np.ndarray, Motion]:
    effects = EVERYTHING
    if "kind" in plant:
        effects = {name: effect for name, effect in effects.items() if name not in NOT_OF_A_NECK}
    command = {"kind": kind, "levels_deg": [9, -12, 14, 3]} if kind == "stairs" else {"kind": kind}
    spec = spec_of(effects, command, plant)
    rows = command_rows(spec.recordings[0], np.random.SeedSequence(2))
    return spec, rows, move(spec, spec.recordings[0], rows, UNTIL)


def arriving(spec: Spec, rows: np.ndarray) -> np.ndarray:
    """Return the lagged command at each of the times."""
    line, lag = drive(rows, spec), spec.effects.actuator_lag.tau_s
    bounds = [0.0, *line.knots[(line.knots > 0) & (line.knots < UNTIL)].tolist(), UNTIL + STEP_S]
    out, v = np.empty(len(TIMES)), 0.0
    for begin, end in itertools.pairwise(bounds):
        after = line.lagged(lag, begin, v)
        inside = (begin <= TIMES) & (end > TIMES)
        out[inside] = [after(t) for t in TIMES[inside].tolist()]
        v = after(end)
    return out


def load_energy(spec: Spec, theta: np.ndarray, omega: np.ndarray, psi: np.ndarray, swing: np.ndarray) -> np.ndarray:
    """Return the energy stored by effects, per inertia of the head."""
    e = spec.effects
    own = 2 * math.pi * e.elastic_coupling.frequency_hz
    energy = e.elastic_coupling.inertia_share * ((omega + swing) ** 2 + own**2 * psi**2) / 2
    energy += e.stiffening_spring.k3 * theta**4 / 4 - e.constant_torque.torque * theta
    energy += e.one_sided_spring.stiffness / 2 * np.maximum(theta - math.radians(e.one_sided_spring.slack_deg), 0) ** 2
    if e.gravity_geometry:
        neutral = math.radians(e.gravity_geometry.gravity_deg)
        weight = np.cos(neutral + theta) + theta * math.sin(neutral) + theta**2 / 2 * math.cos(neutral)
        energy += e.gravity_geometry.strength * weight
    return energy


def load_power(spec: Spec, omega: np.ndarray, swing: np.ndarray) -> np.ndarray:
    """Return the net power supplied by effects, per inertia of the head."""
    e = spec.effects
    dry, shake = e.coulomb_friction, e.periodic_disturbance
    level = np.where(omega > 0, dry.torque, dry.downward)
    level = level + (dry.breakaway - level) * np.exp(-((omega / math.radians(dry.stribeck_deg_per_s)) ** 2))
    power = -level * np.abs(omega) - e.quadratic_drag.q * np.abs(omega) ** 3
    power += shake.amplitude * np.sin(2 * math.pi * shake.frequency_hz * TIMES + shake.phase) * omega
    own = 2 * math.pi * e.elastic_coupling.frequency_hz
    return power - e.elastic_coupling.inertia_share * 2 * e.elastic_coupling.damping_ratio * own * swing**2


def assert_balanced(energy: np.ndarray, power: np.ndarray) -> None:
    brought = cumulative_simpson(power, dx=STEP_S, initial=0.0)
    throughput = np.abs(power).sum() * STEP_S
    assert throughput > 5.0
    np.testing.assert_allclose(energy - brought, energy[0], rtol=0, atol=1e-6 * throughput)


@pytest.mark.parametrize("kind", ["stairs", "chirp"])
def test_energy_is_balanced_with_all_effects_on_the_base_model(kind):
    spec, rows, motion = everything(kind, PLANT)
    theta, omega, psi, swing, warm = motion.state(TIMES)
    a, b, c = PLANT.values()
    share = EVERYTHING["torque_saturation"]["share"]
    rocker, h = head_angle(FourBar(), math.radians(135.0)), 1e-4
    slope = float(servo_angle(FourBar(), rocker + h) - servo_angle(FourBar(), rocker - h)) / (2 * h)

    def phi(angle: np.ndarray) -> np.ndarray:
        return (servo_angle(FourBar(), rocker - angle) - math.radians(135.0)) / -slope

    lever = (8 * (phi(theta + h) - phi(theta - h)) - (phi(theta + 2 * h) - phi(theta - 2 * h))) / (12 * h)
    error = arriving(spec, rows) - share * b / c * phi(theta)
    width = math.radians(EVERYTHING["dead_zone"]["half_width_deg"])
    asked = c * np.sign(error) * np.maximum(np.abs(error) - width, 0.0)
    servo = lever * np.clip(asked, -LIMIT, LIMIT)
    if kind == "stairs":  # the motion passes every kink
        assert (np.abs(asked) > LIMIT).any()
        assert (np.abs(error) < width).any()
        assert (omega == 0).any()
    damping = a * (1 - EVERYTHING["time_varying_parameter"]["share"] * warm)
    energy = omega**2 / 2 + (1 - share) * b * theta**2 / 2 + load_energy(spec, theta, omega, psi, swing)
    assert_balanced(energy, (servo - damping * omega) * omega + load_power(spec, omega, swing))


def test_energy_is_balanced_with_all_effects_on_the_neck_and_a_heavy_rotor():
    # the rotor has 10⁸ times the paper's inertia, so that its terms matter
    spec, rows, motion = everything("stairs", {**NECK, "rotor_inertia": 1e-3})
    theta, omega, psi, swing, warm = motion.state(TIMES)
    p = spec.plant
    inertia = p.mass * p.centre_of_mass**2 + p.own_inertia
    c3 = p.motor_constant * p.amplifier_gain / (p.gear_ratio * p.output_impedance)
    motor = p.motor_constant**2 / (p.gear_ratio**2 * p.output_impedance)

    # γ = dθ_f/dθ_s from Eqs. (1)-(2) by differences, and its integral over the head's angle
    rocker, h = head_angle(FourBar(), math.radians(135.0)), 1e-4
    grid = np.linspace(theta.min() - 0.01, theta.max() + 0.01, 801)
    crank = servo_angle(FourBar(), rocker - grid)
    near = {k: head_angle(FourBar(), crank + k * h) for k in (-2, -1, 1, 2)}
    gamma = CubicSpline(grid, (8 * (near[1] - near[-1]) - (near[2] - near[-2])) / (12 * h))
    gathered = gamma.antiderivative()
    error = arriving(spec, rows) - p.sensor_gain * (gathered(theta) - gathered(0.0))
    servo = np.clip(c3 / inertia * error, -LIMIT, LIMIT)
    assert (np.abs(servo) == LIMIT).any()

    springs = build_neck(p, FourBar()).springs
    behind, before = (np.array(stretch) for stretch in zip(*map(springs.stretched, theta.tolist()), strict=True))
    weight = p.mass * p.gravity * p.centre_of_mass * np.cos(math.radians(p.neutral_deg) + theta)
    stored = springs.rate * (behind**2 + before**2) / 2 + weight + p.rotor_inertia * gamma(theta) * omega**2 / 2
    energy = omega**2 / 2 + stored / inertia + load_energy(spec, theta, omega, psi, swing)

    oil = p.damping * (1 - EVERYTHING["time_varying_parameter"]["share"] * warm)
    lost = (oil + motor * gamma(theta)) * omega**2 + p.rotor_inertia * gamma(theta, 1) * omega**3 / 2
    assert_balanced(energy, servo * omega - lost / inertia + load_power(spec, omega, swing))
