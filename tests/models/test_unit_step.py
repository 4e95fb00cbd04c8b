"""Step figures of the paper's models, recomputed."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.models.plant import Plant
from anglecam.models.third_order import ThirdOrder
from anglecam.models.unit_step import step_figures


def test_sys1_overshoots_by_11_5_percent():
    p = np.array([25.9786, 523.7292, 507.5597])
    figures = step_figures(Plant(), p, np.roots([1.0, *p[:2]]), p[2] / p[1])
    assert figures.overshoot == pytest.approx(0.115, abs=0.0005)
    assert figures.rise_time == pytest.approx(0.078, abs=0.0005)
    assert figures.settling_time == pytest.approx(0.26, abs=0.005)
    assert figures.steady_state == pytest.approx(0.969, abs=0.0005)


def test_sys2_overshoots_by_10_04_percent():
    numerator = 47.3859 * np.array([1.0, 56.8, 980.1])
    denominator = np.poly([-13.22, *np.roots([1.0, 12.29, 149.0])])
    p = np.array([*denominator[1:], *numerator])
    figures = step_figures(ThirdOrder(), p, np.roots(denominator), p[5] / p[2])
    assert figures.overshoot == pytest.approx(0.1004, abs=0.0001)
    assert figures.rise_time == pytest.approx(0.166, abs=0.0005)
    assert figures.settling_time == pytest.approx(0.48, abs=0.005)
    assert figures.steady_state == pytest.approx(23.58, abs=0.005)


def test_an_unstable_model_has_no_step_figures():
    p = np.array([-1.0, 10.0, 10.0])
    assert np.isnan(step_figures(Plant(), p, np.roots([1.0, -1.0, 10.0]), 1.0).overshoot)
