"""Parameters are no more certain than the pivot of each recording and a declared neutral allow."""

from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.identify_records import identify_records
from anglecam.identification.noise import Noise
from anglecam.identification.output_error import fit_output_error
from anglecam.identification.systematic import full_sigma
from anglecam.io.rig import Rig
from anglecam.models.plant import Plant
from support.motion import Plant as TruePlant
from support.series import session

TRUE = np.array([26.0, 524.0, 508.0])
EXACT = session(TruePlant(), 0, sigma_deg=0.0)
OWN = np.radians(0.001)
"""Noise independent from frame to frame, rad."""
PIVOT = 1e-3
"""Standard uncertainty of the pivot, lever arms."""


def spread_of(fits):
    found = [((fit.parameters - TRUE) / sigma, (fit.parameters - TRUE) / fit.sigma) for fit, sigma in fits]
    return np.sqrt(np.mean(np.array(found) ** 2, axis=0))


def fitted(records):
    fit = fit_output_error(Plant(), records, [TRUE])
    return fit, full_sigma(fit, records, Noise(OWN, 0.0, 0.1, "stated"))


def test_the_parameters_uncertainty_includes_a_wrong_pivot_in_every_recording():
    rng = np.random.default_rng(1)
    fits = []
    for _ in range(20):
        records = []
        for r in EXACT:
            along, across = PIVOT * rng.normal(size=2)
            wrong = along * np.sin(r.angle) + across * (1 - np.cos(r.angle))
            sigma = np.sqrt(OWN**2 + PIVOT**2 * (2 - 2 * np.cos(r.angle)))
            records.append(replace(r, angle=r.angle + wrong + OWN * rng.normal(size=len(wrong)), sigma=sigma))
        fits.append(fitted(records))
    full, noise_alone = spread_of(fits)
    assert np.all((full > 0.6) & (full < 1.45)), full  # 99 % limits of a standard deviation over 20 draws
    assert np.all(noise_alone[1:] > 2.0), noise_alone


def test_the_parameters_uncertainty_includes_a_wrong_declared_neutral():
    rng = np.random.default_rng(2)
    fits = []
    for _ in range(20):
        off = 5 * OWN * rng.normal()
        records = [
            replace(
                r,
                angle=r.angle + off + OWN * rng.normal(size=len(r.time)),
                sigma=np.full(len(r.time), np.hypot(OWN, 5 * OWN)),
                zero_known=True,
            )
            for r in EXACT
        ]
        fits.append(fitted(records))
    assert np.all(spread_of(fits)[0] < 1.45)


def test_stated_uncertainty_beyond_the_scatter_counts_as_common_to_all_frames():
    common = replace(EXACT[0], sigma=np.full(len(EXACT[0].time), 5 * OWN), zero_known=True)
    noise = OWN * np.random.default_rng(3).normal(size=len(common.time))
    records = [replace(common, angle=common.angle + noise)]
    torque = Plant().with_effect(effect("constant_torque"))
    fit = fit_output_error(torque, records, [np.append(TRUE, 0.0)])
    sigma = full_sigma(fit, records, Noise(5 * OWN, 0.0, 0.1, "stated"))  # as if all of it were independent
    assert sigma[3] == pytest.approx(TRUE[1] * np.sqrt(24.0) * OWN, rel=0.05)


def test_the_filters_uncertainties_include_the_pivots():
    sigma = [np.sqrt(OWN**2 + PIVOT**2 * (2 - 2 * np.cos(r.angle))) for r in EXACT]
    noise = np.random.default_rng(4)
    records = [
        replace(r, angle=r.angle + OWN * noise.normal(size=len(r.time)), sigma=s)
        for r, s in zip(EXACT, sigma, strict=True)
    ]
    filtered, optimal = (identify_records(records, Rig(), name) for name in ("ekf", "oe2"))
    assert filtered.sigmas == pytest.approx(optimal.sigmas, rel=0.1)


def test_without_stated_uncertainty_only_the_scatter_counts():
    unstated = [replace(r, sigma=np.full(len(r.time), np.nan)) for r in EXACT]
    records = [replace(r, angle=r.angle + OWN * np.cos(1e4 * r.time)) for r in unstated]
    fit, sigma = fitted(records)
    assert sigma == pytest.approx(fit.sigma)


def test_the_parameters_uncertainty_includes_rounding_to_the_steps_of_an_encoder():
    # the body rests on steps for most of the time, where the error of the rounding repeats from frame to frame
    step, fits = np.radians(0.088), []
    rng = np.random.default_rng(3)
    for seed in range(12):
        records = []
        for r in session(TruePlant(), seed, sigma_deg=0.005):
            zero = step * rng.uniform(-0.5, 0.5)
            records.append(replace(r, angle=step * np.round((r.angle - zero) / step) + zero))
        fits.append(fitted(records))
    full, noise_alone = spread_of(fits)
    assert np.all(full < 1.6), full  # 99 % limit of a standard deviation over 12 draws
    assert np.any(noise_alone > full), noise_alone
