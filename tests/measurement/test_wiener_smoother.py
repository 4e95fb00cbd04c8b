"""The smoother against the same least-squares problem solved at once, and against what is exact."""

import math

import numpy as np
import pytest

from anglecam.measurement.wiener_smoother import smooth


def _transition(interval: float, p: int) -> np.ndarray:
    return np.array(
        [[interval ** (j - i) / math.factorial(j - i) if j >= i else 0.0 for j in range(p)] for i in range(p)]
    )


def _process(interval: float, intensity: float, p: int) -> np.ndarray:
    left = [p - 1 - i for i in range(p)]
    return np.array(
        [
            [intensity * interval ** (a + b + 1) / ((a + b + 1) * math.factorial(a) * math.factorial(b)) for b in left]
            for a in left
        ]
    )


def _at_once(time, value, variance, intensity, p):
    """Minimise Σ(y − θ)²/r + Σ wᵀQ⁻¹w over all states together, with nothing known of the first one."""
    n = len(time)
    rows, right = np.zeros((n + (n - 1) * p, n * p)), np.zeros(n + (n - 1) * p)
    for k in range(n):
        rows[k, k * p], right[k] = 1.0 / np.sqrt(variance[k]), value[k] / np.sqrt(variance[k])
        if k > 0:
            interval = time[k] - time[k - 1]
            root = np.linalg.cholesky(_process(interval, intensity[k], p))
            step = np.hstack([-_transition(interval, p), np.eye(p)])
            rows[n + (k - 1) * p : n + k * p, (k - 1) * p : (k + 1) * p] = np.linalg.solve(root, step)
    orthogonal, triangle = np.linalg.qr(rows)
    mean = np.linalg.solve(triangle, orthogonal.T @ right)
    variances = (np.linalg.inv(triangle) ** 2).sum(axis=1)
    return mean.reshape(n, p), variances.reshape(n, p)


@pytest.mark.parametrize("p", [2, 3, 4, 5])
def test_the_smoother_solves_the_least_squares_problem_of_all_frames(p):
    rng = np.random.default_rng(p)
    time = np.cumsum(rng.uniform(0.3, 2.0, 25))
    value = 20.0 * np.sin(0.7 * time) + rng.standard_normal(25)
    variance, intensity = rng.uniform(0.5, 2.0, 25), 10.0 ** rng.uniform(-2, 2, 25)
    mean, variances = smooth(time, value, variance, np.full(p, 1e6), intensity)
    expected, expected_variance = _at_once(time, value, variance, intensity, p)
    assert np.abs((mean - expected) / np.sqrt(expected_variance)).max() < 1e-4
    assert variances == pytest.approx(expected_variance, rel=1e-4)


def test_a_gap_of_a_million_intervals_leaves_all_variances_positive():
    time = np.r_[np.arange(40.0), 1e6 + np.arange(40.0)]
    mean, variances = smooth(time, np.zeros(80), np.ones(80), np.full(5, 1e9), np.array(1e-6))
    assert (variances > 0.0).all()
    assert np.isfinite(mean).all()
    # the frames before the gap know nothing of those after it
    alone = smooth(time[:40], np.zeros(40), np.ones(40), np.full(5, 1e9), np.array(1e-6))[1]
    assert variances[:40] == pytest.approx(alone, rel=1e-3)


def test_without_process_noise_the_variance_is_that_of_a_fitted_parabola():
    time = np.arange(50.0)
    shapes = np.vander(time - time[20], 3, increasing=True)
    expected = np.diag(np.linalg.inv(shapes.T @ shapes)) * np.array([1.0, 1.0, 4.0])  # θ̈ is twice the third coefficient
    variances = smooth(time, np.zeros(50), np.ones(50), np.full(3, 1e6), np.array(1e-30))[1]
    assert variances[20] == pytest.approx(expected, rel=1e-5)
