"""The paper's filter."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.estimate.ekf import PAPER, fit_ekf, settings_for
from support.motion import Plant as TruePlant
from support.series import session


def test_the_filter_finds_a_b_c_from_a_start_that_is_half_off_and_knows_how_well():
    normalised = []
    for seed in range(6):
        records = session(TruePlant(), seed, sigma_deg=0.2)
        start = np.array([13.0, 300.0, 300.0])
        estimate = fit_ekf(records, start, settings_for(records, start, np.radians(0.2)))
        assert estimate.parameters == pytest.approx([26.0, 524.0, 508.0], rel=0.05)
        normalised.append((estimate.parameters - [26.0, 524.0, 508.0]) / np.sqrt(np.diag(estimate.covariance)))
    assert np.std(normalised) < 1.6


def test_innovations_are_as_large_as_the_filter_says():
    records = session(TruePlant(), 7, sigma_deg=0.2)
    start = np.array([26.0, 524.0, 508.0])
    estimate = fit_ekf(records, start, settings_for(records, start, np.radians(0.2)))
    assert np.std(np.concatenate(estimate.normalised)) == pytest.approx(1.0, abs=0.1)


def test_the_papers_own_settings_and_start_lead_to_its_model():
    records = session(TruePlant(), 8, sigma_deg=0.05)
    estimate = fit_ekf(records, np.array([5.0, 531.0, 520.0]), PAPER)
    assert estimate.parameters == pytest.approx([26.0, 524.0, 508.0], rel=0.05)
