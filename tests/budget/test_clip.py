"""A clip's budget is validated where the geometry is linear and not elsewhere, and its bounds are the paper's."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from anglecam.budget.clip import budget_as_dict, budget_of, implied_lever, pixel_bound
from anglecam.budget.gum import propagate
from support.nod import N, nod_sources


@pytest.fixture(autouse=True)
def million_trials(monkeypatch):
    """Draw a quarter of the trials, which decide these comparisons as all do."""
    monkeypatch.setattr("anglecam.budget.clip.propagate", partial(propagate, most=1_000_000))


def test_the_budget_states_degrees_and_is_validated_where_uncertainties_are_known():
    budget = budget_of("nod", nod_sources()[0])
    one = budget.typical
    assert one.combined.standard == pytest.approx(math.degrees(np.median(budget.sigma)), rel=0.02)
    assert budget.worst.combined.standard == pytest.approx(math.degrees(budget.sigma.max()))
    for frame in (budget.typical, budget.worst):
        assert frame.comparison.agrees
        assert frame.linearity.agrees
        assert frame.drawn.estimate == pytest.approx(frame.angle_deg, abs=0.01 * frame.combined.standard)
    content = budget_as_dict(budget)
    assert sum(t["share"] for t in content["rms"]["terms"]) == pytest.approx(1.0)
    assert content["typical"]["terms"][0]["sensitivity_unit"] == "°/px"
    assert content["rms"]["sigma_deg"] == pytest.approx(math.degrees(math.sqrt(np.mean(budget.sigma**2))))


def test_few_degrees_of_freedom_fail_the_comparison_and_not_the_linearity():
    budget = budget_of("nod", nod_sources(pivot_dof=6.0, noise_dof=5.0)[0])
    assert not budget.worst.comparison.agrees
    assert budget.worst.linearity.agrees
    assert budget.worst.drawn.high - budget.worst.drawn.low > 2.0 * budget.worst.combined.expanded


def test_linearisation_fails_for_a_short_lever():
    sources, _ = nod_sources(noise=0.6, lever_px=np.full(N, 3.0))
    assert not budget_of("short", sources).worst.linearity.agrees


def test_pixel_bounds_are_the_papers_at_the_papers_levers():
    assert implied_lever(6.0, 0.28) == pytest.approx(1228.0, abs=0.5)
    assert implied_lever(10.0, 0.68) == pytest.approx(842.6, abs=0.1)
    six = pixel_bound(6.0, implied_lever(10.0, 0.68))
    assert math.degrees(six.worst) == pytest.approx(0.408, abs=5e-4)
    assert six.standard == pytest.approx(six.worst / 2.0, rel=1e-4)
    both = pixel_bound(10.0, 100.0)
    assert both.worst_both == pytest.approx(math.asin(0.2))
    rng = np.random.default_rng(1)
    place = np.sqrt(rng.random((2, 200_000))) * 10.0 * np.exp(2j * np.pi * rng.random((2, 200_000)))
    assert both.standard * 100.0 == pytest.approx(place[0].imag.std(), rel=0.01)
    assert both.standard_both * 100.0 == pytest.approx((place[0] - place[1]).imag.std(), rel=0.01)
