"""Velocity and acceleration against functions whose derivatives are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import savgol_filter

from anglecam.data.series import AngleSeries
from anglecam.measurement.derivatives import LEAST_FRAMES, derivatives, with_derivatives

DRAWS = 10
"""Recordings over which an error is compared with its sigma."""


def sine(time):
    """Return angle, velocity and acceleration of 10° at 1 Hz."""
    rate = 2.0 * np.pi
    return 10.0 * np.sin(rate * time), 10.0 * rate * np.cos(rate * time), -10.0 * rate**2 * np.sin(rate * time)


def step_response(time, rate=25.0, damping=0.3):
    """Return a plant's answer of second order to a step of 10° at 1 s: its acceleration jumps."""
    late = np.maximum(time - 1.0, 0.0)
    damped, decay = rate * np.sqrt(1.0 - damping**2), np.exp(-damping * rate * late)
    angle = 10.0 * (1.0 - decay * (np.cos(damped * late) + damping * rate / damped * np.sin(damped * late)))
    velocity = 10.0 * decay * rate**2 / damped * np.sin(damped * late)
    pushed = np.where(time > 1.0, 10.0 * rate**2, 0.0)
    return angle, velocity, pushed - 2.0 * damping * rate * velocity - rate**2 * angle


def chirp(time):
    """Return 5° from 0.3 Hz upward, by 0.4 Hz each second."""
    rate, phase = 2.0 * np.pi * (0.3 + 0.4 * time), 2.0 * np.pi * (0.3 * time + 0.2 * time**2)
    return (
        5.0 * np.sin(phase),
        5.0 * rate * np.cos(phase),
        5.0 * 2.0 * np.pi * 0.4 * np.cos(phase) - 5.0 * rate**2 * np.sin(phase),
    )


def constant(time):
    return np.zeros_like(time), np.zeros_like(time), np.zeros_like(time)


def wheel(time):
    """Return many turns at 300° each second."""
    return 300.0 * time, np.full_like(time, 300.0), np.zeros_like(time)


def uneven(n, seed=0):
    """Return the times of n frames at 60 Hz with a jitter of a fifth of the interval."""
    return (np.arange(n) + np.random.default_rng(seed).uniform(-0.2, 0.2, n)) / 60.0


def rms_of_pulls(time, truth, noise_deg, measured):
    """Return the RMS of error ÷ sigma of velocity and acceleration; ``measured(rng)`` draws the angles, °."""
    pulls = []
    for seed in range(DRAWS):
        found = derivatives(time, np.radians(measured(np.random.default_rng(seed))), np.radians(noise_deg))
        pulls.append(
            (
                (np.degrees(found.velocity) - truth[1]) / np.degrees(found.velocity_sigma),
                (np.degrees(found.acceleration) - truth[2]) / np.degrees(found.acceleration_sigma),
            )
        )
    return np.sqrt(np.mean(np.square(pulls), axis=(0, 2)))


@pytest.mark.parametrize(
    ("motion", "n", "noise_deg", "least_acceleration"),
    [
        (sine, 120, 0.02, 0.7),
        (sine, 600, 0.02, 0.7),
        (sine, 20, 0.02, 0.7),
        (step_response, 120, 0.02, 0.7),
        # of a recording that mostly rests, the acceleration's sigma is too large by up to a factor of 2
        (step_response, 600, 0.02, 0.5),
        (step_response, 600, 0.2, 0.5),
        (chirp, 600, 0.02, 0.7),
        (constant, 120, 0.02, 0.7),
        (constant, 600, 0.2, 0.7),
        (constant, 20, 0.02, 0.7),
        (wheel, 120, 0.02, 0.7),
    ],
)
def test_sigma_covers_the_true_velocity_and_acceleration(motion, n, noise_deg, least_acceleration):
    time = uneven(n)
    truth = motion(time)
    noise = np.full(n, noise_deg)
    velocity, acceleration = rms_of_pulls(time, truth, noise, lambda rng: truth[0] + noise_deg * rng.standard_normal(n))
    assert 0.7 < velocity < 1.4
    assert least_acceleration < acceleration < 1.4


@pytest.mark.parametrize("step_deg", [0.1, 1.0])
@pytest.mark.parametrize("motion", [sine, chirp, step_response])
def test_sigma_covers_the_derivatives_of_a_quantised_angle(motion, step_deg):
    time = np.arange(600) / 60.0
    truth = motion(time)
    noise = np.full(600, step_deg / np.sqrt(12.0))
    velocity, acceleration = rms_of_pulls(
        time, truth, noise, lambda rng: step_deg * np.round((truth[0] + rng.uniform(0.0, step_deg)) / step_deg)
    )
    assert 0.6 < velocity < 1.4
    assert 0.4 < acceleration < 1.4


def test_sigma_covers_across_gaps_and_frames_left_out_at_random():
    rng = np.random.default_rng(1)
    kept = rng.random(600) > 0.1
    kept[100:130] = kept[300:420] = False
    time = uneven(600)[kept]
    truth = sine(time)
    n = len(time)
    velocity, acceleration = rms_of_pulls(
        time, truth, np.full(n, 0.02), lambda rng: truth[0] + 0.02 * rng.standard_normal(n)
    )
    assert 0.7 < velocity < 1.4
    assert 0.6 < acceleration < 1.4


@pytest.mark.parametrize("stated", [1.0 / 3.0, 3.0])
def test_a_wrongly_stated_noise_is_corrected_by_the_scatter_of_many_frames(stated):
    time = uneven(600)
    truth = sine(time)
    velocity, _ = rms_of_pulls(
        time, truth, np.full(600, stated * 0.02), lambda rng: truth[0] + 0.02 * rng.standard_normal(600)
    )
    assert 0.6 < velocity < 1.4


def test_sigma_is_small_at_rest_and_large_where_the_motion_begins():
    time = uneven(600)
    angle = np.radians(step_response(time)[0] + 0.02 * np.random.default_rng(0).standard_normal(600))
    found = derivatives(time, angle, np.radians(np.full(600, 0.02)))
    moving, resting = (time > 1.0) & (time < 1.3), time > 4.0
    assert np.median(found.acceleration_sigma[moving]) > 50.0 * np.median(found.acceleration_sigma[resting])


def test_the_smoother_is_closer_than_any_filter_of_one_width():
    rng, time = np.random.default_rng(0), np.arange(600) / 60.0
    angle, velocity, _ = step_response(time)
    measured = angle + 0.02 * rng.standard_normal(600)
    found = derivatives(time, np.radians(measured), np.radians(np.full(600, 0.02)))
    error = np.sqrt(np.mean((np.degrees(found.velocity) - velocity) ** 2))
    others = [
        np.sqrt(np.mean((savgol_filter(measured, width, 3, deriv=1, delta=1 / 60) - velocity) ** 2))
        for width in range(5, 41, 2)
    ]
    assert error < min(others)


@pytest.mark.parametrize("size", [1.0, 1e2, 1e5])
def test_a_jump_of_the_angle_within_an_interval_disturbs_its_neighbourhood_only(size):
    time = np.arange(300) / 60.0
    angle = 1e-4 * (np.random.default_rng(0).standard_normal(300) + np.where(time > 2.5, size, 0.0))
    found = derivatives(time, angle, np.full(300, 1e-4))
    away = np.abs(time - 2.5) > 1.0
    assert np.sqrt(np.mean((found.velocity / found.velocity_sigma)[away] ** 2)) < 2.0
    assert np.isfinite(found.acceleration_sigma).all()


def test_an_angle_without_any_noise_is_differentiated_exactly():
    time = np.arange(300) / 60.0
    angle, velocity, _ = sine(time)
    found = derivatives(time, np.radians(angle), np.zeros(300))
    assert np.degrees(found.velocity)[5:-5] == pytest.approx(velocity[5:-5], abs=1e-4)


def test_too_few_frames_have_no_derivatives():
    few = LEAST_FRAMES - 1
    assert np.isnan(derivatives(np.arange(few) / 30.0, np.zeros(few), np.full(few, 1e-4)).velocity).all()
    assert np.isfinite(derivatives(np.arange(few + 1) / 30.0, np.zeros(few + 1), np.full(few + 1, 1e-4)).velocity).all()


def _series(angle, sigma, random):
    n = len(angle)
    return AngleSeries(
        "swing", np.arange(n) / 60.0, angle, np.full(n, sigma), ("ok",) * n, sigma_random=np.full(n, random)
    )


def test_frames_that_are_not_measured_stay_empty():
    series = _series(0.1 * np.sin(np.arange(100) / 10.0), 1e-4, 1e-4)
    status = tuple("duplicate" if k in (7, 50) else "ok" for k in range(100))
    angle = np.where([s == "ok" for s in status], series.angle, np.nan)
    found = with_derivatives(replace(series, angle=angle, status=status)).derivatives
    for values in vars(found).values():
        assert np.flatnonzero(np.isnan(values)).tolist() == [7, 50]


def test_an_error_of_the_scale_is_in_the_velocitys_sigma():
    angle = 0.1 * np.sin(np.arange(400) / 10.0)
    common, random = 0.05 * np.abs(angle), 1e-5
    series = replace(_series(angle, random, random), sigma=np.hypot(common, random))
    assert series.common_share == pytest.approx(0.05, rel=0.01)
    found = with_derivatives(series).derivatives
    fastest = np.argmax(found.velocity)
    assert found.velocity_sigma[fastest] == pytest.approx(0.05 * found.velocity[fastest], rel=0.01)


def test_an_error_of_the_zero_is_not_in_the_velocitys_sigma():
    series = _series(0.1 * np.sin(np.arange(400) / 10.0), 1e-3, 1e-5)
    assert series.common_share < 1e-3


def test_a_series_without_sigma_has_no_derivatives():
    series = replace(_series(np.zeros(50), np.nan, np.nan), sigma_random=None)
    assert with_derivatives(series).derivatives is None
