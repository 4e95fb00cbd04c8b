"""The projected derivatives give the solution, the residual and the covariance of the whole Jacobian."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from anglecam.identification.slopes import Slopes

EDGES = np.array([0, 30, 75, 100])
RNG = np.random.default_rng(1)
SHARED, OWN, VALUES = RNG.standard_normal((100, 4)), RNG.standard_normal((100, 3)), RNG.standard_normal((100, 2))
OWN[30:75, 2] = 0.0  # this recording has no third unknown
SLOPES = Slopes(SHARED, OWN, EDGES)


def _dense(own):
    """Return the whole Jacobian: the shared columns, then each recording's own."""
    columns = np.zeros((100, 4 + 9))
    columns[:, :4] = SHARED
    for run, (i, j) in enumerate(pairwise(EDGES)):
        columns[i:j, 4 + 3 * run : 7 + 3 * run] = own[i:j]
    return columns


def test_what_no_parameter_can_follow_is_the_residual_of_least_squares():
    whole = _dense(OWN)
    left = VALUES - whole @ np.linalg.lstsq(whole, VALUES, rcond=None)[0]
    assert SLOPES.without_followed(VALUES) == pytest.approx(left, abs=1e-13)
    assert SLOPES.without_followed(VALUES[:, 0]) == pytest.approx(left[:, 0], abs=1e-13)
    assert SLOPES.rank == np.linalg.matrix_rank(whole) == 12


def test_the_projected_derivatives_give_the_shared_part_of_the_solution():
    whole = _dense(OWN)
    solution = np.linalg.lstsq(whole, VALUES[:, 0], rcond=None)[0]
    shared = np.linalg.lstsq(SLOPES.projected, VALUES[:, 0], rcond=None)[0]
    assert shared == pytest.approx(solution[:4], abs=1e-13)
    assert SLOPES.own_change(VALUES[:, 0] - SHARED @ shared).ravel() == pytest.approx(solution[4:], abs=1e-13)
    information = SLOPES.projected.T @ SLOPES.projected
    assert np.linalg.inv(information) == pytest.approx(np.linalg.pinv(whole.T @ whole)[:4, :4], rel=1e-9)


def test_a_column_that_depends_on_others_is_left_out():
    own = OWN.copy()
    own[:, 2] = own[:, 0] - 2.0 * own[:, 1]
    slopes = Slopes(np.column_stack([SHARED, own[:, 1]]), own, EDGES)
    assert slopes.rank == 4 + 2 * 3
    assert not slopes.projected[:, 4].any()
    assert not slopes.own_change(VALUES[:, 0])[:, 2].any()
