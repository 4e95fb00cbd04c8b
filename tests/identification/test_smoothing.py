"""The smoother against the textbook's recursion and against the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from anglecam.identification.ekf import fit_ekf, settings_for
from anglecam.identification.kalman import filter_record
from anglecam.identification.smoothing import smooth
from support.consistency import error_consistency
from support.motion import Plant as TruePlant
from support.motion import Recording, move
from support.series import record, session

TRUE = np.array([26.0, 524.0, 508.0])
SIGMA = np.radians(0.2)
PROCESS = 1e-6
SPREAD = np.array([0.01, 0.1, 1.0, 10.0, 10.0])
"""Standard deviations of the state before the first frame."""


def wandering(rng):
    """Return true states with process noise in all five, and the filter's pass: data that meet its assumptions."""
    frames = record(TruePlant(), Recording("steps", duration_s=4.0), np.random.default_rng(0), sigma_deg=0.0)
    mean = np.array([0.0, 0.0, *TRUE])
    true = [mean + SPREAD * rng.normal(size=5)]
    for now, then in zip(frames.time[:-1], frames.time[1:], strict=True):
        inside = frames.command.time[(frames.command.time > now) & (frames.command.time < then)]
        theta, omega, a, b, c = true[-1]
        for start, stop in zip([now, *inside], [*inside, then], strict=True):
            A = np.array([[0.0, 1.0, 0.0], [-b, -a, c], [0.0, 0.0, 0.0]])
            theta, omega, _ = expm(A * (stop - start)) @ [theta, omega, frames.command.at(np.array([start]))[0]]
        true.append(np.array([theta, omega, a, b, c]) + rng.normal(0.0, np.sqrt(PROCESS), 5))
    true = np.array(true)
    noisy = true[:, 0] + rng.normal(0.0, SIGMA, len(true))
    filmed = replace(frames, angle=noisy, zero_known=True)
    passed = filter_record(filmed, mean, np.diag(SPREAD**2), process_variance=PROCESS, measurement_variance=SIGMA**2)
    return true, passed


def textbook(passed):
    """Return the recursion of Rauch, Tung and Striebel as printed."""
    state, covariance = [passed.state[-1]], [passed.covariance[-1]]
    for i in range(len(passed.state) - 2, -1, -1):
        P, ahead = passed.covariance[i], passed.prior_covariance[i + 1]
        G = np.linalg.solve(ahead, passed.transition[i + 1] @ P).T
        state.append(passed.state[i] + G @ (state[-1] - passed.prior[i + 1]))
        covariance.append(P + G @ (covariance[-1] - ahead) @ G.T)
    return np.array(state[::-1]), np.array(covariance[::-1])


@pytest.fixture(scope="module")
def trials():
    return [wandering(np.random.default_rng(seed)) for seed in range(40)]


def test_the_result_equals_that_of_rauch_tung_and_striebel(trials):
    passed = trials[0][1]
    smoothed, (state, covariance) = smooth([passed])[0], textbook(passed)
    deviation = np.sqrt(np.einsum("nii->ni", covariance))
    assert np.max(np.abs(smoothed.state - state) / deviation) < 1e-6
    scale = deviation[:, :, None] * deviation[:, None, :]
    assert np.max(np.abs(smoothed.covariance - covariance) / scale) < 1e-6


def test_filtered_and_smoothed_errors_agree_with_their_covariance_in_all_five_states(trials):
    for frame in (5, 40, 80, 110):
        filtered = error_consistency(
            np.array([passed.state[frame] - true[frame] for true, passed in trials]),
            np.array([passed.covariance[frame] for _, passed in trials]),
        )
        smoothed = [smooth([passed])[0] for _, passed in trials]
        after = error_consistency(
            np.array([s.state[frame] - true[frame] for s, (true, _) in zip(smoothed, trials, strict=True)]),
            np.array([s.covariance[frame] for s in smoothed]),
        )
        for found in (filtered, after):  # eight tests of one kind: bounds of 99.9 % each
            half = 3.3 * np.sqrt(2.0 / found.degrees_of_freedom)
            assert abs(found.mean - 1.0) < half, (frame, found)


def test_smoothing_lowers_the_error_of_angle_and_rate(trials):
    before = np.mean([(passed.state - true)[:, :2] ** 2 for true, passed in trials], axis=(0, 1))
    after = np.mean([(smooth([passed])[0].state - true)[:, :2] ** 2 for true, passed in trials], axis=(0, 1))
    assert np.all(after < 0.8 * before)


def test_without_process_noise_a_long_overdamped_record_keeps_only_the_noise_of_its_parameters():
    plant = TruePlant(a=200.0, b=2000.0, c=2000.0)  # over 20 s its fast mode decays by e⁻³⁷⁰⁰: no way back through F⁻¹
    recording = Recording("steps", duration_s=20.0)
    exact = record(plant, recording, np.random.default_rng(1), sigma_deg=0.0)
    one = replace(
        exact, angle=exact.angle + np.random.default_rng(2).normal(0.0, SIGMA, len(exact.time)), zero_known=True
    )
    start = np.array([150.0, 1500.0, 1500.0])
    estimate = fit_ekf([one], start, settings_for([one], start, SIGMA))
    error = smooth(estimate.filtered)[0].state[:, 0] - exact.angle
    assert np.sqrt(np.mean(error**2)) < 0.2 * SIGMA


def test_parameters_smoothed_in_one_recording_use_all_others():
    records = session(TruePlant(), 3, sigma_deg=0.2)
    estimate = fit_ekf(records, TRUE, settings_for(records, TRUE, SIGMA))
    for one in smooth(estimate.filtered):
        assert one.state[[0, -1], 2:5] == pytest.approx(np.tile(estimate.parameters, (2, 1)), rel=1e-6)
        assert one.covariance[-1, 2:5, 2:5] == pytest.approx(estimate.covariance, rel=1e-3)


def test_the_smoothed_angle_is_closer_to_the_truth_than_the_filtered_and_the_measured_angle():
    rows = np.array([[0.0, 0.0], [1.0, 12.0], [3.0, -6.0]])
    recording = Recording("steps", duration_s=5.0)
    made = record(TruePlant(), recording, np.random.default_rng(0), sigma_deg=0.2)
    made = replace(made, command=type(made.command)(rows[:, 0], np.radians(rows[:, 1])), zero_known=True)
    true = np.radians(move(TruePlant(), recording, made.time, rows))
    made = replace(made, angle=true + np.random.default_rng(1).normal(0.0, SIGMA, len(true)))
    estimate = fit_ekf([made], TRUE, settings_for([made], TRUE, SIGMA))
    measured, filtered, smoothed = (
        np.sqrt(np.mean((angle - true) ** 2))
        for angle in (made.angle, estimate.filtered[0].state[:, 0], smooth(estimate.filtered)[0].state[:, 0])
    )
    assert smoothed < 0.8 * filtered < 0.8 * measured
