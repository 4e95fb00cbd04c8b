"""What is left between groups of tiles after a fit is, on average, what `fitted_terms` says."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.vision.registration.centre_equations import fitted_terms, group_scatter

TILES, GROUPS, DRAWS = 24, 6, 4000


@pytest.mark.parametrize("prior", [None, 4.0, 400.0], ids=["known pivot", "loose prior", "tight prior"])
def test_the_scatter_of_groups_is_as_expected_after_a_fit(prior):
    rng = np.random.default_rng(5)
    J = np.concatenate([rng.normal(0.0, 60.0, (TILES, 8, 1)), rng.normal(0.0, 1.0, (TILES, 8, 2))], axis=2)
    normals, groups = np.einsum("tki,tkj->tij", J, J), np.arange(TILES) % GROUPS
    free = slice(0, 1 if prior is None else 3)
    weight = np.zeros((3, 3)) if prior is None else np.diag([0.0, prior, prior])
    covariance = np.zeros((3, 3))
    covariance[free, free] = np.linalg.inv((normals.sum(axis=0) + weight)[free, free])
    total = 0.0
    for _ in range(DRAWS):
        off = np.zeros(3) if prior is None else np.array([0.0, *rng.normal(0.0, prior**-0.5, 2)])
        gradients = np.einsum("tki,tk->ti", J, rng.normal(size=(TILES, 8))) + normals @ off
        left = gradients - normals @ (covariance @ gradients.sum(axis=0))
        scatter, count = group_scatter(normals[:, None], left[:, None], groups)
        total += scatter
    assert count == GROUPS
    # the mean of so many sums of about six squares is known to 0.06
    assert total / DRAWS == pytest.approx(GROUPS - fitted_terms(normals, groups, covariance), abs=0.2)
    if prior is None:
        assert fitted_terms(normals, groups, covariance) == pytest.approx(1.0)
