"""Compares the estimators of a, b, c with the Cramér–Rao bound, and their stated uncertainty with their actual error.

    PYTHONPATH=tests .venv/bin/python benchmarks/estimators.py [seeds]

The plant is (26, 524, 508) in series of 8 s at 30 frames a second with white noise of 0.2°. The commands are the same
for all seeds; noise and start are drawn for every seed, each of a, b, c up to 80 % off. The truth is computed by the
tests' oracle: the matrix exponential from switch to switch. "Efficiency" is the bound's variance over the mean squared
error. The mean of 300 squares is uncertain by 8 %. "On the same noise" removes this uncertainty: it is the mean squared
error, on the same seeds, of the estimator that is linear about the truth and meets the bound exactly, over that of the
row. Its deficit from 1 is due to the estimator.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from multiprocessing import get_context

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

import anglecam
from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.identification.ekf import PAPER, EkfSettings, fit_ekf, settings_for
from anglecam.identification.identify_records import identify_records
from anglecam.identification.kalman import SHARED
from anglecam.identification.output_error import fit_output_error
from anglecam.identification.smoothing import smooth
from anglecam.io.rig import Rig
from anglecam.models.plant import Plant
from anglecam.models.third_order import ThirdOrder
from support.comparison import compare_models
from support.consistency import consistency, error_consistency, innovation_consistency, innovation_whiteness
from support.cramer_rao import cramer_rao_bound, parameter_covariance
from support.motion import Plant as TruePlant
from support.motion import Recording
from support.roots import poles_and_zeros
from support.series import record
from support.transfer import SYS2, SYS2_DENOMINATOR, SYS2_NUMERATOR, respond

Floats = NDArray[np.float64]
Estimate = tuple[Floats, Floats]
"""(3,) a, b, c and their stated (3, 3) covariance."""

TRUE = np.array([26.0, 524.0, 508.0])
SIGMA = float(np.radians(0.2))
OFF = 0.8
LOST = 10.0
"""A run that ends farther from the truth than this counts as lost, in standard deviations of the bound."""
SERIES = {"steps": ("steps",), "steps, stairs, triangle, chirp": ("steps", "stairs", "triangle", "chirp")}


def output_error(records: list[Record], start: Floats) -> Estimate:
    fit = fit_output_error(Plant(), records, [start])
    return fit.parameters, parameter_covariance(fit, SIGMA)


def iterated_filter(records: list[Record], start: Floats) -> Estimate:
    estimate = fit_ekf(records, start, settings_for(records, start, SIGMA))
    return estimate.parameters, estimate.covariance


def modest(records: list[Record], start: Floats) -> EkfSettings:
    """Return settings for a filter without iteration; the iterated filter's wide variances lose more runs."""
    settings = settings_for(records, start, SIGMA)
    _, rate, *shared = settings.initial_variance
    return replace(settings, initial_variance=((2.0 * SIGMA) ** 2, rate, *(0.25 * v for v in shared)))


def filter_passed_again(records: list[Record], start: Floats) -> Estimate:
    """Repeat the filter about its running estimate until it converges, resetting the initial variance each time."""
    settings = modest(records, start)
    parameters = start
    for _ in range(settings.passes):
        before, (parameters, covariance) = parameters, _one_pass(records, parameters, settings)
        if np.all(np.abs(parameters - before) <= 1e-3 * np.sqrt(np.diag(covariance))):
            break
    return parameters, covariance


def filter_once(records: list[Record], start: Floats) -> Estimate:
    return _one_pass(records, start, modest(records, start))


def filter_with_the_papers_settings(records: list[Record], start: Floats) -> Estimate:
    return _one_pass(records, start, PAPER)


def _one_pass(records: list[Record], start: Floats, settings: EkfSettings) -> Estimate:
    estimate = fit_ekf(records, start, replace(settings, passes=1))
    return estimate.parameters, estimate.covariance


class EulerFilter(ExtendedKalmanFilter):
    """filterpy as in its manual: x ← x + f·Δt, F = I + ∂f/∂x·Δt, with the previous frame's command."""

    step, command = 0.0, 0.0

    def predict_x(self, u: object = 0) -> None:
        theta, omega, a, b, c = self.x
        self.F = np.eye(5)
        self.F[0, 1] = self.step
        self.F[1] += self.step * np.array([-b, -a, -omega, -theta, self.command])
        self.x = self.x + self.step * np.array([omega, c * self.command - a * omega - b * theta, 0.0, 0.0, 0.0])


def filterpy_with_euler(records: list[Record], start: Floats) -> Estimate:
    variance = np.array(modest(records, start).initial_variance)
    parameters, covariance = start, np.diag(variance[SHARED])
    for one in records:
        ekf = EulerFilter(dim_x=5, dim_z=1)
        ekf.x, ekf.P = np.array([one.angle[0], 0.0, *parameters]), np.diag(variance)
        ekf.P[SHARED, SHARED] = covariance
        ekf.Q, ekf.R = np.zeros((5, 5)), np.array([[SIGMA**2]])
        commands = one.command.at(one.time)
        for i in range(1, len(one.time)):
            ekf.step, ekf.command = one.time[i] - one.time[i - 1], commands[i - 1]
            ekf.predict()
            ekf.update(one.angle[i : i + 1], lambda _: np.eye(1, 5), lambda x: x[:1])
        parameters, covariance = ekf.x[SHARED], ekf.P[SHARED, SHARED]
    return parameters, covariance


ESTIMATORS: dict[str, Callable[[list[Record], Floats], Estimate]] = {
    "output error": output_error,
    "EKF, iterated about its smoothed trajectory": iterated_filter,
    "EKF, passed again about its running estimate": filter_passed_again,
    "EKF, one pass, exact F": filter_once,
    "EKF, one pass, the paper's P₀, Q, r": filter_with_the_papers_settings,
    "filterpy, one pass, Euler": filterpy_with_euler,
}


@cache
def exact(kinds: tuple[str, ...]) -> list[Record]:
    """Return the recordings without noise and with a declared zero."""
    rng = np.random.default_rng(0)
    return [replace(record(TruePlant(), Recording(k, k), rng, sigma_deg=0.0), zero_known=True) for k in kinds]


@cache
def at_the_truth(kinds: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Return the bound, and the gain of the estimator that is linear about the truth."""
    records = exact(kinds)
    fit = fit_output_error(Plant(), records, [TRUE])
    bound = cramer_rao_bound(Plant(), TRUE, records, [np.zeros(2)] * len(records), SIGMA)
    return bound, np.linalg.pinv(fit.slopes.projected)


def drawn(kinds: tuple[str, ...], seed: int) -> tuple[list[Record], Floats, Floats]:
    """Draw noisy recordings and a start; return them and the linear estimator's error on the same noise."""
    rng = np.random.default_rng(seed)
    start = TRUE * (1.0 + rng.uniform(-OFF, OFF, 3))
    noise = [rng.normal(0.0, SIGMA, len(r.time)) for r in exact(kinds)]
    records = [replace(r, angle=r.angle + e) for r, e in zip(exact(kinds), noise, strict=True)]
    return records, start, at_the_truth(kinds)[1] @ np.concatenate(noise)


def one_trial(name: str, kinds: tuple[str, ...], seed: int) -> tuple[Floats, Floats, Floats, float]:
    records, start, linear = drawn(kinds, seed)
    began = time.perf_counter()
    with np.errstate(all="ignore"):
        parameters, covariance = ESTIMATORS[name](records, start)
    return parameters - TRUE, covariance, linear, time.perf_counter() - began


@dataclass(frozen=True)
class Row:
    efficiency: Floats
    on_same_noise: Floats
    nees: float
    band: tuple[float, float]
    lost: int
    seconds: float


def run(name: str, kinds: tuple[str, ...], seeds: int, pool: ProcessPoolExecutor | None = None) -> Row:
    """Run an estimator on ``seeds`` draws."""
    each = (pool.map if pool else map)(one_trial, [name] * seeds, [kinds] * seeds, range(seeds))
    errors, covariances, linear, seconds = (np.array(part) for part in zip(*each, strict=True))
    bound = np.diag(at_the_truth(kinds)[0])
    found = np.all(np.abs(errors) < LOST * np.sqrt(bound), axis=1)
    squares = np.mean(errors**2, axis=0)
    with np.errstate(all="ignore"):
        nees = np.array([e @ np.linalg.pinv(np.nan_to_num(P)) @ e for e, P in zip(errors, covariances, strict=True)])
    tested = consistency(float(np.where(nees >= 0.0, nees, np.inf).sum()), 3 * seeds)
    return Row(
        bound / squares,
        np.mean(linear**2, axis=0) / squares,
        tested.mean,
        (tested.lower, tested.upper),
        int(np.sum(~found)),
        float(np.median(seconds)),
    )


def print_efficiency(seeds: int, pool: ProcessPoolExecutor) -> None:
    for title, kinds in SERIES.items():
        deviations = np.sqrt(np.diag(at_the_truth(kinds)[0]))
        print(f"\nSeries: {title}; the bound's deviations of a, b, c: {listed(deviations)}; {seeds} seeds\n")
        print("| estimator | efficiency a, b, c | on the same noise | NEES per degree (95 % band) | lost | ms |")
        print("| --- | --- | --- | --- | --- | --- |")
        for name in ESTIMATORS:
            row = run(name, kinds, seeds, pool)
            cells = [
                ", ".join(f"{e:.2g}" if e < 0.1 else f"{e:.3f}" for e in part)
                for part in (row.efficiency, row.on_same_noise)
            ]
            nees = f"{f'{row.nees:.3g}' if row.nees < 1000 else 'over 1000'} ({row.band[0]:.2f} to {row.band[1]:.2f})"
            print(f"| {name} | {cells[0]} | {cells[1]} | {nees} | {row.lost} | {1e3 * row.seconds:.0f} |", flush=True)


# The paper's self-test. A unit step of this plant ends at c/b = 22.2, the 22° of Fig. 10: the angle is in degrees and
# the step has height 1. It begins with the first frame, and 4 s at the paper's 15 frames a second contain all motion.
SELF_TRUE, SELF_START, SELF_SIGMA = np.array([4.0, 45.0, 1000.0]), np.array([3.0, 40.0, 900.0]), 0.5
SELF_TIME, SELF_STEP = np.arange(0.0, 4.0, 1.0 / 15.0), Command(np.zeros(1), np.ones(1))
PAPER_SELF = replace(PAPER, measurement_variance=0.5)
SELF_WAYS: dict[str, EkfSettings | None] = {
    "EKF, iterated": None,
    "EKF, one pass, P₀ = 1000·I, Q = 0.001, r = 0.5: the paper's": PAPER_SELF,
    "the paper's with Q = 0": replace(PAPER_SELF, process_variance=0.0),
    "the paper's with r = σ² = 0.25": replace(PAPER_SELF, measurement_variance=SELF_SIGMA**2),
    "the paper's with 10⁶ for c in P₀": replace(PAPER_SELF, initial_variance=(1000.0,) * 4 + (1e6,)),
}


def self_test(seed: int | None) -> list[Record]:
    """Return the unit step's response in degrees, with noise if a seed is given."""
    angle = respond(SELF_TRUE[2:], np.array([1.0, *SELF_TRUE[:2]]), SELF_TIME, np.zeros(1), np.ones(1))
    if seed is not None:
        angle = angle + np.random.default_rng(seed).normal(0.0, SELF_SIGMA, len(angle))
    return [Record("step", SELF_TIME, angle, SELF_STEP, True, np.full(len(angle), np.nan))]


def self_test_trial(settings: EkfSettings | None, seed: int) -> Estimate:
    records = self_test(seed)
    estimate = fit_ekf(records, SELF_START, settings or settings_for(records, SELF_START, SELF_SIGMA))
    return estimate.parameters, estimate.covariance


def print_self_test(seeds: int) -> None:
    bound = np.sqrt(cramer_rao_bound(Plant(), SELF_TRUE, self_test(None), [np.zeros(2)], SELF_SIGMA).diagonal())
    print(f"\nThe paper's self-test, {seeds} seeds; the bound's deviations of a, b, c: {listed(bound)}\n")
    print("| filter | median a, b, c | off, % | median error ÷ bound | RMS error ÷ bound | stated sigma ÷ spread |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, settings in SELF_WAYS.items():
        found = [self_test_trial(settings, seed) for seed in range(seeds)]
        values, stated = np.array([f[0] for f in found]), np.sqrt([f[1].diagonal() for f in found])
        median, error = np.median(values, axis=0), np.abs(values - SELF_TRUE)
        columns = [
            median,
            100.0 * (median / SELF_TRUE - 1.0),
            np.median(error, axis=0) / bound,
            np.sqrt(np.mean(error**2, axis=0)) / bound,
            np.median(stated, axis=0) / np.std(values, axis=0),
        ]
        print(f"| {name} | {' | '.join(listed(c) for c in columns)} |", flush=True)


def listed(values: Floats) -> str:
    return ", ".join(f"{v:.3g}" if abs(v) < 100.0 else f"{v:.0f}" for v in values)


def consistency_trial(seed: int) -> tuple[bool, float, Floats]:
    """Return whether NIS is in its band, the whiteness test's p, and RMS errors: measured, filtered, smoothed angle."""
    kinds = SERIES["steps"]
    records, start, _ = drawn(kinds, seed)
    estimate = fit_ekf(records, start, settings_for(records, start, SIGMA))
    true = exact(kinds)[0].angle
    angles = records[0].angle, estimate.filtered[0].state[:, 0], smooth(estimate.filtered)[0].state[:, 0]
    rms = np.array([np.sqrt(np.mean((angle - true) ** 2)) for angle in angles])
    return innovation_consistency(estimate).holds, innovation_whiteness(estimate.normalised).p_value, rms


def print_consistency(seeds: int, pool: ProcessPoolExecutor) -> None:
    each = list(pool.map(consistency_trial, range(seeds)))
    holds, p, rms = (np.array(part) for part in zip(*each, strict=True))
    print(f"\nInnovations of the iterated filter on the steps, {seeds} seeds\n")
    print("| NIS within its 95 % band | Ljung–Box p < 0.05 | p < 0.01 | angle, ° RMS: measured | filtered | smoothed |")
    print("| --- | --- | --- | --- | --- | --- |")
    angle = " | ".join(f"{v:.4f}" for v in np.degrees(np.sqrt(np.mean(rms**2, axis=0))))
    print(
        f"| {100 * holds.mean():.1f} % | {100 * np.mean(p < 0.05):.1f} % | {100 * np.mean(p < 0.01):.1f} % | {angle} |"
    )


SYS2_LEVELS = {"fitted": (1.0, 0.0, 0.5, -0.5, -1.0, 0.0, 0.8, 0.2), "held out": (0.3, 0.9, -0.2, -0.9, 0.0, 1.0)}


def sys2_steps(series: str, rate: float, sigma: float, seed: int) -> Record:
    """Return a series of steps, one per 1.5 s, of the paper's SYS2; a command of 1° turns the head by 23.6°."""
    levels = SYS2_LEVELS[series]
    command = Command(np.array([0.0, *(0.51 + 1.5 * np.arange(len(levels)))]), np.radians([0.0, *levels]))
    times = np.arange(0.0, 0.5 + 1.5 * len(levels), 1.0 / rate)
    exact = respond(SYS2_NUMERATOR, SYS2_DENOMINATOR, times, command.time, command.angle)
    noisy = exact + np.random.default_rng(seed).normal(0.0, sigma, len(times))
    return Record(series, times, noisy, command, True, np.full(len(times), np.nan))


def sys2_trial(rate: float, sigma: float, seed: int) -> tuple[Floats, Floats, Floats]:
    """Return the errors of poles and zeros over their sigmas, e'P⁻¹e/6, and held-out RMS errors of SYS1 and SYS2."""
    record = sys2_steps("fitted", rate, sigma, seed)
    fits = {name: identify_records([record], Rig(), way).fit for name, way in (("SYS1", "oe2"), ("SYS2", "oe3"))}
    p, covariance = fits["SYS2"].parameters, fits["SYS2"].covariance
    off = []
    for true, found in zip(poles_and_zeros(SYS2, 0.0 * covariance), poles_and_zeros(p, covariance), strict=True):
        error = found.value - true.value
        with np.errstate(divide="ignore", invalid="ignore"):
            off += [*(error.real / found.sigma[:, 0])[[0, -1]], (error.imag / found.sigma[:, 1])[-1]]
    compared = compare_models(sys2_steps("held out", rate, sigma, seed + 10**6), fits)
    return (
        np.array(off),
        error_consistency((p - SYS2)[None], covariance[None]).mean,
        np.array([*compared.rmse.values()]),
    )


def print_sys2(seeds: int, pool: ProcessPoolExecutor) -> None:
    print(f"\nSYS2 from a series of steps, and its prediction of another series, {seeds} seeds\n")
    sigmas = "bound's sigma of the real pole; of the pair, re and im; of the zeros, re and im, 1/s"
    print(f"| frames/s | noise, ° | {sigmas} | errors within 1.96 sigma | NEES per degree (95 % band)", end=" ")
    print("| held out, ° RMS: SYS1 | SYS2 |")
    print("| --- " * 7 + "|")
    for rate, sigma_deg in ((15.0, 0.2), (30.0, 0.2), (30.0, 0.02)):
        sigma = np.radians(sigma_deg)
        each = pool.map(sys2_trial, [rate] * seeds, [sigma] * seeds, range(seeds))
        off, nees, rms = (np.array(part) for part in zip(*each, strict=True))
        exact = sys2_steps("fitted", rate, 0.0, 0)
        bound = cramer_rao_bound(ThirdOrder(), SYS2, [exact], [np.zeros(3)], sigma)
        poles, zeros = (roots.sigma for roots in poles_and_zeros(SYS2, bound))
        bounds = "; ".join(listed(v) for v in (poles[0, :1], poles[-1], zeros[-1]))
        real = off[np.isfinite(off)]
        tested = consistency(6.0 * float(nees.sum()), 6 * seeds)
        held_out = " | ".join(f"{np.degrees(np.sqrt(v)):.3f}" for v in np.mean(rms**2, axis=0))
        band = f"{tested.mean:.3f} ({tested.lower:.2f} to {tested.upper:.2f})"
        print(
            f"| {rate:g} | {sigma_deg} | {bounds} | {100 * np.mean(np.abs(real) < 1.96):.0f} % | {band} | {held_out} |",
            flush=True,
        )


def main(seeds: int) -> None:
    print(f"{date.today():%d %B %Y}, version {anglecam.__version__}")
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        print_efficiency(seeds, pool)
        print_consistency(seeds, pool)
        print_sys2(max(1, seeds // 3), pool)
    print_self_test(min(seeds, 200))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
