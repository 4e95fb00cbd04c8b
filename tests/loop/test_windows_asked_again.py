"""A wide swing out of step with the linear model: once gravity's sine is in the model, the windows are needless."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from anglecam.data.record import Record
from support.closing import close_without_rivals

A, B, DRAG = 0.03, 30.0, 0.04


@pytest.fixture(scope="module")
def verdict():
    def rate(t, x):
        return [x[1], -A * x[1] - B * np.sin(x[0]) - DRAG * x[1] * abs(x[1])]

    time = np.arange(0.0, 24.0, 1 / 25)
    path = solve_ivp(rate, (0.0, 24.0), [np.radians(70.0), 0.0], t_eval=time, rtol=1e-9, atol=1e-10).y[0]
    angle = path + np.random.default_rng(3).normal(0.0, np.radians(0.1), len(time))
    return close_without_rivals([Record("swing", time, angle, None, True, np.full(len(time), np.nan))])


def test_the_final_model_runs_freely_over_the_whole_recording(verdict):
    assert [len(r.time) for r in verdict.fitted] == [600]
    assert np.degrees(verdict.before.rmse) > 5.0
    assert np.degrees(verdict.after.rmse) == pytest.approx(0.1, rel=0.1)


def test_drag_is_found_beside_gravity_and_nothing_else(verdict):
    found = [a.effect.id for a in verdict.accepted]
    assert set(found) <= {"gravity_geometry", "stiffening_spring", "quadratic_drag"}
    assert "quadratic_drag" in found
    at = list(verdict.after.model.names).index("q_per_rad")
    assert verdict.after.parameters[at] == pytest.approx(DRAG, abs=4.0 * float(verdict.after.sigma[at]))
    assert verdict.after.parameters[at] == pytest.approx(DRAG, rel=0.1)
