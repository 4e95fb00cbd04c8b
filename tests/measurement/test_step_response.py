"""Rise, overshoot, settling from samples, against the exact response of second-order systems and a least-jerk nod."""

import numpy as np
import pytest

from anglecam.measurement.step_response import responses
from support.series import noise
from synth.motion.nod import nod
from synth.spec.commands import Nod

DAMPED, SETTLING_S = (22.9, 0.57), 0.2561
"""ω_n (rad/s) and ζ of the paper's neck; the settling time is from the step, to 2 %."""


def step_response(time, omega, zeta):
    damped, t = omega * np.sqrt(1 - zeta**2), np.maximum(time, 0.0)
    swing = np.cos(damped * t) + zeta / np.sqrt(1 - zeta**2) * np.sin(damped * t)
    return 1 - np.exp(-zeta * omega * t) * swing


def exact(omega, zeta):
    """Return rise, overshoot, settling from the step, and peak speed of a unit step."""
    t = np.arange(0.0, 4.0, 1e-5)
    y = step_response(t, omega, zeta)
    rise = t[np.argmax(y >= 0.9)] - t[np.argmax(y >= 0.1)]
    return rise, np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), t[np.abs(y - 1) > 0.02][-1], np.gradient(y, t).max()


def film(rng, rate_hz, sigma_deg, omega, zeta, height_deg=15.0):
    """Return a step up at 0.71 s and back at 3.5 s, frames at a random phase."""
    time = np.arange(0.0, 6.0, 1 / rate_hz) + rng.uniform(0, 1 / rate_hz)
    angle = height_deg * (step_response(time - 0.71, omega, zeta) - step_response(time - 3.5, omega, zeta))
    return time, np.radians(angle + noise(rng, len(time), sigma_deg)), np.full(len(time), np.radians(sigma_deg))


@pytest.mark.parametrize(
    ("rate_hz", "sigma_deg", "omega", "zeta", "within"),
    [
        # of rise (s), overshoot, settling (s): RMS over films
        (30, 0.02, *DAMPED, (0.002, 0.003, 0.008)),
        pytest.param(60, 0.02, *DAMPED, (0.0006, 0.002, 0.004), marks=pytest.mark.sweep),
        pytest.param(120, 0.02, *DAMPED, (0.0004, 0.002, 0.003), marks=pytest.mark.sweep),
        (30, 0.005, 9.0, 0.3, (0.001, 0.003, 0.008)),
    ],
)
def test_figures_are_those_of_the_exact_response_and_their_sigma_is_true(rate_hz, sigma_deg, omega, zeta, within):
    rng = np.random.default_rng(5)
    rise, overshoot, settling, speed = exact(omega, zeta)
    errors, sigmas = [], []
    for _ in range(6):
        found = responses(*film(rng, rate_hz, sigma_deg, omega, zeta), changes=(0.71, 3.5))
        assert len(found) == 2
        for one, change in zip(found, (0.71, 3.5), strict=True):
            assert one.start.value == change
            figures = (one.rise_time, one.overshoot, one.settling_time, one.peak_speed)
            true = (rise, overshoot, settling, np.radians(15) * speed)
            errors.append([f.value - t for f, t in zip(figures, true, strict=True)])
            sigmas.append([f.sigma for f in figures])
    errors, sigmas = np.array(errors), np.array(sigmas)
    assert (np.sqrt((errors[:, :3] ** 2).mean(axis=0)) < within).all()
    ratio = np.sqrt(((errors / sigmas) ** 2).mean(axis=0))
    # four frames a rise: what the angle did between them can only be bounded
    assert (ratio > 0.2).all()
    assert (ratio < 3.0).all()
    assert np.median(ratio) < 1.6


def test_without_a_command_the_start_is_where_the_angle_leaves_its_rest():
    found = responses(*film(np.random.default_rng(2), 60, 0.02, *DAMPED))
    t = np.arange(0.0, 1.0, 1e-5)
    leaves = t[np.argmax(step_response(t, *DAMPED) >= 0.02)]
    assert abs(found[0].start.value - 0.71 - leaves) < 0.003
    assert found[0].settling_time.value == pytest.approx(SETTLING_S - leaves, abs=0.005)
    assert np.degrees(found[0].to_angle.value) == pytest.approx(15.0, abs=4 * np.degrees(found[0].to_angle.sigma))


@pytest.mark.parametrize("late_s", [0.02, 0.05, 0.2])
def test_an_answer_that_comes_late_begins_at_its_command_all_the_same(late_s):
    time, angle, sigma = film(np.random.default_rng(4), 60, 0.02, *DAMPED)
    found = responses(time + late_s, angle, sigma, changes=(0.71, 3.5))
    assert [one.start.value for one in found] == [0.71, 3.5]
    assert [one.settling_time.value for one in found] == pytest.approx([SETTLING_S + late_s] * 2, abs=0.005)


def test_a_way_on_which_the_command_changes_again_is_left_out():
    found = responses(*film(np.random.default_rng(4), 60, 0.02, *DAMPED), changes=(0.71, 3.5, 3.6))
    assert [one.start.value for one in found] == [0.71]


def nod_series(rate_hz, sigma_deg, seed=1, until=3.0, **command):
    rng = np.random.default_rng(seed)
    # a variable frame rate: every interval up to 10 % off
    time = np.cumsum(rng.uniform(0.9, 1.1, int(until * rate_hz))) / rate_hz
    angle = nod(Nod(kind="nod", **command), time)[0]
    return time, angle + noise(rng, len(time), np.radians(sigma_deg)), np.full(len(time), np.radians(sigma_deg))


@pytest.mark.parametrize(("rate_hz", "rise_within"), [(30, 0.006), (60, 0.0025), (240, 0.001)])
def test_a_nod_up_and_back_is_two_responses_without_overshoot(rate_hz, rise_within):
    found = responses(*nod_series(rate_hz, 0.02, from_deg=-25.0))
    assert len(found) == 2
    way = np.arange(0.0, 1.0, 1e-5)
    share = way**3 * (10 - 15 * way + 6 * way**2)
    rise, settling = (
        0.3 * np.ptp(way[(share > 0.1) & (share < 0.9)]),
        0.3 * np.ptp(way[(share > 0.02) & (share < 0.98)]),
    )
    for one, ends in zip(found, ((-25, 45), (45, -25)), strict=True):
        np.testing.assert_allclose(np.degrees([one.from_angle.value, one.to_angle.value]), ends, atol=0.03)
        assert abs(one.rise_time.value - rise) < rise_within
        assert abs(one.settling_time.value - settling) < 3 * rise_within
        assert one.overshoot.value < 0.004
        assert abs(np.degrees(one.peak_speed.value) - 437.5) < 15


def test_a_pause_too_short_to_settle_does_not_end_a_response():
    time = np.arange(0.0, 3.0, 1 / 60)
    halves = [nod(Nod(kind="nod", rise_deg=20.0, hold_s=9.0, rest_s=at), time)[0] for at in (0.7, 1.08)]
    rng = np.random.default_rng(3)
    angle = sum(halves) + noise(rng, len(time), np.radians(0.02))
    found = responses(time, angle, np.full(len(time), np.radians(0.02)))
    assert [round(np.degrees(f.to_angle.value - f.from_angle.value)) for f in found] == [40]


@pytest.mark.parametrize("sigma_deg", [0.002, 0.05, 0.3])
@pytest.mark.parametrize(
    "motion",
    [
        lambda t: 20 * np.sin(6 * t),
        lambda t: 20 * np.sin(t),
        lambda t: 0.0 * t,
        lambda t: 20 * np.abs(t % 2 - 1),
        lambda t: 3.0 * t,
        lambda t: 20 * np.exp(-0.1 * t) * np.cos(7 * t),
        lambda t: 8 * np.sin(2 * np.pi * (0.3 * t + 0.2 * t**2)),
        lambda t: 0.3 * np.sin(3 * t),
    ],
    ids=["swing", "slow swing", "still", "triangle", "ramp", "dying swing", "chirp", "faint swing"],
)
def test_no_response_is_invented(motion, sigma_deg):
    time = np.arange(0.0, 10.0, 1 / 30)
    for seed in range(5):
        angle = motion(time) + noise(np.random.default_rng(seed), len(time), sigma_deg)
        assert responses(time, np.radians(angle), np.full(len(time), np.radians(sigma_deg))) == ()


def sines(count):
    def motion(rng, t):
        return sum(
            rng.uniform(1, 20) * np.sin(2 * np.pi * rng.uniform(0.1, 2) * t + rng.uniform(0, 6.28))
            for _ in range(count)
        )

    return motion


def harmonics(rng, t):
    f = rng.uniform(0.1, 1.0)
    second = rng.uniform(0, 0.5) * np.sin(2 * np.pi * rng.choice([2, 3]) * f * t + rng.uniform(0, 6.28))
    return rng.uniform(5, 20) * (np.sin(2 * np.pi * f * t) + second)


def chirp(rng, t):
    begins, ends = rng.uniform(0.05, 3, 2)
    return rng.uniform(3, 20) * np.sin(2 * np.pi * (begins * t + (ends - begins) * t**2 / 2 / t[-1]))


def free_decay(rng, t):
    omega = rng.uniform(2, 15)
    return rng.uniform(3, 30) * np.exp(-rng.uniform(0.005, 0.2) * omega * t) * np.cos(omega * t + rng.uniform(0, 6.28))


def random_walk(rng, t):
    return rng.uniform(0.1, 10) * np.sqrt(np.median(np.diff(t))) * np.cumsum(rng.standard_normal(len(t)))


def needle(rng, t):
    at, wide = rng.uniform(0.3, 0.7) * t[-1], rng.uniform(0.05, 0.1) * t[-1]
    away = rng.uniform(5, 30) * np.exp(-(((t - at) / wide) ** 2))
    return away + rng.uniform(0, 2) / (1 + np.exp(-3 * (t - at) / wide))


def ramp(rng, t):
    return rng.uniform(-30, 30) * t + rng.uniform(0, 1) * t**2


@pytest.mark.parametrize(
    "motion",
    [sines(2), sines(3), sines(5), harmonics, chirp, free_decay, random_walk, needle, ramp],
    ids=["two sines", "three sines", "five sines", "harmonics", "chirp", "free decay", "walk", "needle", "ramp"],
)
def test_a_motion_without_steps_has_none_in_all_but_one_of_a_hundred_films(motion):
    films = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        time = np.arange(0.0, rng.uniform(3, 15), 1 / rng.choice([15, 30, 60, 120]))
        sigma = float(rng.choice([0.002, 0.02, 0.1, 0.5]))
        angle = motion(rng, time) + noise(rng, len(time), sigma)
        films += bool(responses(time, np.radians(angle), np.full(len(time), np.radians(sigma))))
    assert films <= 1


def staircase(rng, kind):
    """Return steps of a servo with a delay: time, angle, sigma, and the times of the commands and the heights."""
    zeta = rng.uniform(0.05, 0.3) if kind == "ringing" else rng.uniform(0.3, 0.95)
    omega, late, count = rng.uniform(8, 30), rng.uniform(0, 0.1), rng.integers(1, 6)
    each = 4.5 / (zeta * omega) * rng.uniform(1.5, 4) + rng.uniform(0.3, 1.5)
    commands = rng.uniform(0.5, 1.3) + each * np.arange(count)
    time = np.arange(0, commands[-1] + each, 1 / rng.choice([30, 60, 120]))
    heights = rng.uniform(3, 30, count) * rng.choice([-1, 1], count)
    sigma, angle = float(rng.choice([0.002, 0.02, 0.1])), np.zeros(len(time))
    for command, height in zip(commands, heights, strict=True):
        since = time - command - late
        angle += height * step_response(since, omega, zeta)
        if kind == "creeping":
            angle += 0.05 * height * (1 - np.exp(-np.maximum(since, 0) / (0.2 * each)))
    return time, angle + noise(rng, len(time), sigma), sigma, commands, heights


@pytest.mark.parametrize("kind", ["damped", "ringing", "creeping"])
def test_steps_of_a_servo_are_found_each_with_its_height(kind):
    missed = asked = 0
    for seed in range(15):
        time, angle, sigma, commands, heights = staircase(np.random.default_rng(seed), kind)
        found = responses(time, np.radians(angle), np.full(len(time), np.radians(sigma)), tuple(commands))
        seen = {one.start.value: np.degrees(one.to_angle.value - one.from_angle.value) for one in found}
        asked += len(commands)
        missed += sum(abs(seen.get(c, 0.0) / h - 1) > 0.07 for c, h in zip(commands, heights, strict=True))
        assert set(seen) <= set(commands)
    assert missed <= 0.02 * asked


def test_an_excursion_that_ends_elsewhere_is_no_step():
    time = np.arange(0.0, 6.0, 1 / 30)
    kick = 15.0 * np.exp(-(((time - 2.5) / 0.3) ** 2)) + 1.0 / (1.0 + np.exp(-(time - 2.5) / 0.1))
    angle = kick + noise(np.random.default_rng(0), len(time), 0.02)
    assert responses(time, np.radians(angle), np.full(len(time), np.radians(0.02))) == ()


def test_figures_that_lie_in_a_gap_are_not_guessed():
    time, angle, sigma = nod_series(60, 0.02)
    angle[(time > 0.77) & (time < 0.95)] = np.nan
    up, down = responses(time, angle, sigma)
    assert np.isnan([up.rise_time.value, up.overshoot.value, up.peak_speed.value]).all()
    assert np.degrees(up.to_angle.value) == pytest.approx(70, abs=0.03)
    assert np.isfinite([down.rise_time.value, down.overshoot.value, down.settling_time.value]).all()


def test_a_film_that_ends_on_the_way_has_no_response_there():
    time, angle, sigma = nod_series(60, 0.02, until=0.9)
    assert responses(time, angle, sigma) == ()


def test_a_series_without_sigma_tells_its_own_noise():
    time, angle, sigma = nod_series(60, 0.05)
    with_it, without = responses(time, angle, sigma), responses(time, angle, np.full(len(time), np.nan))
    assert len(without) == 2
    assert without[0].rise_time.value == pytest.approx(with_it[0].rise_time.value, abs=0.003)
