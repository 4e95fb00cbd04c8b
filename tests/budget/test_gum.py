"""The GUM's arithmetic against the worked examples of the GUM and its Supplement 1."""

from __future__ import annotations

import math

import numpy as np
import pytest

from anglecam.budget.gum import Term, combine, compare, numerical_tolerance, propagate, shortest_interval, widening


def _term(contribution, dof=math.inf, distribution="normal"):
    return Term("x", "1", 0.0, contribution, distribution, 1.0, dof)


def _uniform(rng, sigma, m):
    return (rng.random(m) - 0.5) * sigma * math.sqrt(12.0)


def test_effective_degrees_of_freedom_are_those_of_the_end_gauge():
    # JCGM 100, H.1.6: contributions in nm; u_c = 32 nm, ν_eff = 16.7
    combined = combine([_term(25.0, 18.0), _term(9.7, 25.6), _term(2.9, 50.0), _term(16.6, 2.0)])
    assert combined.standard == pytest.approx(31.7, abs=0.1)
    assert combined.dof == pytest.approx(16.7, abs=0.5)
    assert combined.coverage_factor == pytest.approx(2.11, abs=0.01)
    assert combined.expanded == pytest.approx(combined.coverage_factor * combined.standard)
    assert sum(combined.shares) == pytest.approx(1.0)


def test_known_uncertainties_give_the_normal_coverage_factor():
    combined = combine([_term(3.0), Term("y", "px", 0.0, 2.0, "uniform", -2.0)])
    assert combined.standard == pytest.approx(5.0)
    assert combined.dof == math.inf
    assert combined.coverage_factor == pytest.approx(1.95996, abs=1e-4)


def test_uncertainties_as_small_as_nanodegrees_keep_their_degrees_of_freedom():
    assert combine([_term(1e-90, 5.0), _term(0.0, 1.0)]).dof == pytest.approx(5.0)
    assert combine([_term(0.0, 5.0)]).expanded == 0.0


@pytest.mark.parametrize(
    ("uncertainty", "digits", "tolerance"),
    [(0.00035, 2, 0.000005), (2.0, 1, 0.5), (0.0999, 2, 0.005), (0.0237, 2, 0.0005), (0.0, 2, 0.0)],
)
def test_numerical_tolerance_is_half_the_last_digit(uncertainty, digits, tolerance):
    assert numerical_tolerance(uncertainty, digits) == pytest.approx(tolerance)  # JCGM 101, 7.9.2


def test_four_uniform_inputs_of_one_width_are_drawn_as_the_supplement_has_them():
    # JCGM 101, 9.2.3: u = 2.0, 95 % within ± 3.88, the GUM ± 3.92 is validated to two digits (δ = 0.05)
    drawn = propagate(lambda rng, m: sum(_uniform(rng, 1.0, m) for _ in range(4)))
    assert drawn.standard == pytest.approx(2.0, abs=0.005)
    assert (drawn.low, drawn.high) == pytest.approx((-3.88, 3.88), abs=0.02)
    found = compare(0.0, combine([_term(1.0, distribution="uniform")] * 4), drawn)
    assert found.tolerance == pytest.approx(0.05)
    assert found.agrees


def test_one_wide_uniform_input_is_not_validated():
    # JCGM 101, 9.2.4: u = 10.1, 95 % within ± 17.0 where the GUM says ± 19.9
    drawn = propagate(lambda rng, m: rng.standard_normal((3, m)).sum(axis=0) + _uniform(rng, 10.0, m))
    combined = combine([_term(1.0)] * 3 + [_term(10.0, distribution="uniform")])
    assert combined.expanded == pytest.approx(19.9, abs=0.05)
    assert (drawn.low, drawn.high) == pytest.approx((-17.0, 17.0), abs=0.1)
    assert drawn.error <= drawn.tolerance
    assert not compare(0.0, combined, drawn).agrees


def test_trials_are_added_until_the_error_is_within_the_tolerance():
    few = propagate(lambda rng, m: 1.0 + 0.011 * rng.standard_normal(m))
    many = propagate(lambda rng, m: 1.0 + 0.024 * rng.standard_normal(m))
    for drawn in (few, many):
        assert drawn.error <= drawn.tolerance == pytest.approx(0.0001)  # a fifth of δ = 0.0005
    assert many.trials > 3 * few.trials  # a finer demand, relative to the width
    short = propagate(lambda rng, m: 0.099 * rng.standard_normal(m), most=50_000)
    assert short.trials == 50_000
    assert short.error > short.tolerance


def test_the_stated_error_is_the_scatter_between_seeds():
    results = [propagate(lambda rng, m: rng.standard_normal(m), seed=seed, most=200_000) for seed in range(30)]
    ends = np.array([(r.low, r.high) for r in results])
    stated = np.median([r.error for r in results])
    assert np.std(ends, axis=0).max() < 1.5 * stated


def test_the_shortest_interval_of_a_skewed_distribution_starts_at_its_mode():
    rng = np.random.default_rng(2)
    low, high = shortest_interval(np.sort(rng.exponential(size=500_000)))
    assert low == pytest.approx(0.0, abs=1e-4)
    assert high == pytest.approx(-math.log(0.05), abs=0.02)
    low, high = shortest_interval(np.sort(rng.standard_normal(500_000)))
    assert (low, high) == pytest.approx((-1.96, 1.96), abs=0.015)


def test_an_uncertain_uncertainty_widens_a_normal_to_students_t():
    rng = np.random.default_rng(3)
    drawn = rng.standard_normal(400_000) * widening(rng, 8.0, 400_000)
    assert drawn.var() == pytest.approx(8.0 / 6.0, rel=0.02)
    assert np.quantile(drawn, 0.975) == pytest.approx(2.306, abs=0.03)
    assert (widening(rng, math.inf, 5) == 1.0).all()
