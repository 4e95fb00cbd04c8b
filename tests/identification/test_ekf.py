"""The paper's filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.identification import ekf
from anglecam.identification.ekf import PAPER, fit_ekf, settings_for
from anglecam.identification.identify_records import identify_records
from anglecam.identification.output_error import fit_output_error
from anglecam.identification.smoothing import smooth
from anglecam.io.rig import Rig
from anglecam.models.plant import Plant
from support.cramer_rao import cramer_rao_bound
from support.motion import Plant as TruePlant
from support.motion import Recording
from support.series import record, session
from support.transfer import respond

TRUE = np.array([26.0, 524.0, 508.0])
SIGMA = np.radians(0.2)


def fitted(records, start, sigma=SIGMA):
    return fit_ekf(records, np.array(start), settings_for(records, np.array(start), sigma))


def test_the_filter_finds_a_b_c_from_a_start_50_percent_off_with_errors_of_their_stated_size():
    normalised = []
    for seed in range(4):
        records = session(TruePlant(), seed, sigma_deg=0.2)
        estimate = fitted(records, [13.0, 300.0, 300.0])
        assert estimate.parameters == pytest.approx(TRUE, rel=0.05)
        normalised.append((estimate.parameters - TRUE) / np.sqrt(np.diag(estimate.covariance)))
    assert np.std(normalised) < 1.6


@pytest.mark.parametrize("factors", [(0.2, 0.2, 1.8), (1.8, 1.8, 0.2), (0.2, 1.8, 1.8), (1.8, 0.2, 0.2)])
def test_from_80_percent_off_it_converges_to_the_minimum_of_output_error_and_states_its_covariance(factors):
    records = [record(TruePlant(), Recording("steps"), np.random.default_rng(3), sigma_deg=0.2)]
    estimate = fitted(records, TRUE * factors)
    fit = fit_output_error(Plant(), records, [TRUE])
    bound = cramer_rao_bound(Plant(), fit.parameters, records, fit.nuisance, SIGMA)
    assert estimate.settled
    assert np.abs(estimate.parameters - fit.parameters) == pytest.approx(
        0.0, abs=0.01 * np.sqrt(bound.diagonal().min())
    )
    assert estimate.covariance == pytest.approx(bound, rel=0.01)


def test_innovations_have_the_variance_that_the_filter_states():
    records = session(TruePlant(), 7, sigma_deg=0.2)
    estimate = fitted(records, TRUE)
    assert np.std(np.concatenate(estimate.normalised)) == pytest.approx(1.0, abs=0.1)


def test_irregular_and_missing_frames_are_filtered():
    full = record(TruePlant(), Recording("steps"), np.random.default_rng(0), sigma_deg=0.0, rate_hz=1000.0)
    normalised = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        frames = np.sort(rng.choice(len(full.time), 200, replace=False))
        frames = frames[(full.time[frames] < 3.0) | (full.time[frames] > 3.4)]
        angle = full.angle[frames] + rng.normal(0.0, SIGMA, len(frames))
        records = [replace(full, time=full.time[frames], angle=angle, sigma=full.sigma[frames], zero_known=True)]
        estimate = fitted(records, [15.0, 300.0, 300.0])
        normalised.append((estimate.parameters - TRUE) / np.sqrt(np.diag(estimate.covariance)))
    assert 0.6 < np.std(normalised) < 1.4  # 99 % of a standard deviation over 20 draws of what is nearly two numbers


def test_an_undeclared_zero_is_an_additional_state():
    records = session(TruePlant(), 5, sigma_deg=0.2)
    shifts = np.radians([3.0, -2.0, 1.0, 0.0, 5.0])
    records = [replace(r, angle=r.angle + shift) for r, shift in zip(records, shifts, strict=True)]
    estimate = fitted(records, [13.0, 300.0, 300.0])
    assert np.all(np.abs(estimate.parameters - TRUE) < 4.0 * np.sqrt(np.diag(estimate.covariance)))
    for one, shift in zip(smooth(estimate.filtered), shifts, strict=True):
        assert abs(one.state[0, 5] - shift) < 4.0 * np.sqrt(one.covariance[0, 5, 5]) < np.radians(0.2)


def test_a_free_swing_determines_a_and_b_but_not_c():
    swing = Recording("release", "release", amplitude_deg=15.0, rest_s=0.0)
    records = [record(TruePlant(a=0.4, b=30.0), swing, np.random.default_rng(0), sigma_deg=0.1)]
    estimate = fitted(records, [1.0, 20.0, 0.0], np.radians(0.1))
    assert estimate.parameters[:2] == pytest.approx([0.4, 30.0], rel=0.02)
    assert estimate.parameters[2] == estimate.covariance[2, 2] == 0.0


def test_the_papers_settings_and_start_lead_to_its_model():
    records = session(TruePlant(), 8, sigma_deg=0.05)
    estimate = fit_ekf(records, np.array([5.0, 531.0, 520.0]), PAPER)
    assert estimate.parameters == pytest.approx(TRUE, rel=0.05)


def test_a_second_pass_with_process_noise_is_refused():
    records = session(TruePlant(), 8)
    with pytest.raises(ValueError, match="process variance"):
        fit_ekf(records, TRUE, replace(PAPER, passes=2))


class TestSelfTestOfThePaper:
    """a = 4, b = 45, c = 1000, σ = 0.5, start 3, 40, 900.

    A unit step of it ends at c/b = 22.2, the 22° of Fig. 10: the angle is in degrees, the step of height 1 at the first
    frame. At the paper's 15 frames a second 4 s hold all of the motion.
    """

    true, start, sigma = np.array([4.0, 45.0, 1000.0]), np.array([3.0, 40.0, 900.0]), 0.5

    def step(self, rng):
        time = np.arange(0.0, 4.0, 1.0 / 15.0)
        angle = respond(np.array([1000.0]), np.array([1.0, 4.0, 45.0]), time, np.zeros(1), np.ones(1))
        noisy = angle + rng.normal(0.0, self.sigma, len(time))
        return Record("step", time, noisy, Command(np.zeros(1), np.ones(1)), True, np.full(len(time), np.nan))

    @pytest.mark.parametrize("draws", [40, pytest.param(100, marks=pytest.mark.sweep)])
    def test_the_error_and_the_stated_sigma_equal_the_bound(self, draws):
        found = [fitted([self.step(np.random.default_rng(seed))], self.start, self.sigma) for seed in range(draws)]
        values, stated = np.array([f.parameters for f in found]), np.array([f.covariance.diagonal() for f in found])
        records = [self.step(np.random.default_rng(0))]
        bound = np.sqrt(cramer_rao_bound(Plant(), self.true, records, [np.zeros(2)], self.sigma).diagonal())
        # at most three deviations of each over the draws: of a normal error the median is uncertain by 1.25/√n, the
        # median of its size, 0.674, by 0.79/√n, and the deviation by 0.71/√n
        three = 3.0 / np.sqrt(draws)
        assert np.all(np.median(np.abs(values - self.true), axis=0) < (0.674 + 0.75 * three) * bound)
        assert np.all(np.abs(np.median(values, axis=0) - self.true) < 1.25 * three * bound)
        assert np.sqrt(np.median(stated, axis=0)) / np.std(values, axis=0) == pytest.approx(1.0, abs=0.66 * three)

    def test_the_papers_settings_underestimate_every_parameter_but_not_b_and_c_where_c_is_free(self):
        settings = replace(PAPER, measurement_variance=0.5)
        free = replace(settings, initial_variance=(1000.0,) * 4 + (1e6,))
        records = [[self.step(np.random.default_rng(seed))] for seed in range(60)]
        held_back = np.median([fit_ekf(r, self.start, settings).parameters for r in records], axis=0) / self.true
        let_go = np.median([fit_ekf(r, self.start, free).parameters for r in records], axis=0) / self.true
        assert np.all((held_back > 0.9) & (held_back < 0.98)), held_back  # 900 is three deviations of √1000 away
        assert np.all(let_go[1:] > 1.0), let_go


def test_a_diverging_pass_is_rejected_and_the_filter_ends_at_the_result_of_output_error():
    records = session(TruePlant(), 4)[:-1]
    by_filter, by_output_error = (identify_records(records, Rig(), name) for name in ("ekf", "oe2"))
    assert by_filter.values == pytest.approx(by_output_error.values, rel=1e-4)
    assert np.all(np.isfinite(by_filter.sigmas))


def test_a_filter_that_did_not_settle_states_no_uncertainty(monkeypatch):
    monkeypatch.setattr(ekf, "SETTLED", 0.0)  # then no pass settles
    model = identify_records(session(TruePlant(), 1, sigma_deg=0.2)[:1], Rig(), "ekf")
    assert np.all(np.isnan(model.sigmas))
    assert "did not settle" in model.doubts[0]


def test_only_declared_values_replace_the_start_from_the_grid(monkeypatch):
    records, seen = session(TruePlant(2.0, 40.0, 38.0), 1, sigma_deg=0.2)[:1], []
    original = ekf.fit_ekf
    monkeypatch.setattr(ekf, "fit_ekf", lambda r, start, settings: seen.append(start) or original(r, start, settings))
    for model in ({}, {"gravity_deg": 90.0}, {"b": 41.0}):
        identify_records(records, Rig.model_validate({"model": model}), "ekf")
    assert seen[0] == pytest.approx(seen[1])
    assert seen[2] == pytest.approx([seen[0][0], 41.0, seen[0][2]])


@pytest.mark.parametrize("start", [[26.0, 1e12, 508.0], [-1e12, 524.0, 508.0]])
def test_a_start_from_which_the_filter_diverges_ends(start):
    estimate = fitted(session(TruePlant(), 0, sigma_deg=0.2)[:1], start)
    assert np.all(np.isfinite(estimate.parameters))


def test_angles_without_noise_or_motion_are_filtered():
    exact = session(TruePlant(), 0, sigma_deg=0.0)[:1]
    still = [replace(exact[0], angle=np.zeros(len(exact[0].time)))]
    for records in (exact, still):
        assert np.all(np.isfinite(fitted(records, TRUE, 0.0).parameters))
