"""Windows: for which plants recordings are cut, how, and the effect on the fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.effects import effect
from anglecam.identification.multiple_shooting import drifts, loses_step, windows
from anglecam.identification.output_error import fit_output_error
from anglecam.models.plant import Plant

TIME = np.arange(0.0, 20.0, 0.02)
SWING = Plant((effect("gravity_geometry"),), driven=False)
HANGING = np.array([0.06, 64.0, 64.0, np.pi])
"""a, b, G and θ0 of a pendulum whose only stiffness comes from its weight."""


def record(plant, parameters, state, command=None):
    angle = plant.predict(np.array(parameters), TIME, command, np.array(state))
    return Record("one", TIME, angle, command, False, np.full(len(TIME), np.nan))


@pytest.mark.parametrize(
    ("a", "b", "cut"),
    [
        (26.0, 524.0, False),
        (0.06, 64.0, False),
        (4.0, 0.0, True),
        (4.0, -0.2, True),
        (4.0, 0.1, True),
        (0.0, 0.0, True),
    ],
)
def test_only_a_plant_that_neither_oscillates_nor_returns_drifts(a, b, cut):
    free = Record("one", TIME, np.zeros(len(TIME)), None, False, np.full(len(TIME), np.nan))
    assert drifts(np.array([a, b]), [free]) == cut


def test_windows_of_a_drifting_plant_hold_every_frame_once_and_last_two_time_constants():
    pushed = Command(np.arange(0.0, 20.0, 1.0), np.resize([0.1, -0.1], 20))
    whole = record(Plant(), [4.0, 0.0, 10.0], [0.0, 0.0], pushed)
    parts = windows([whole], np.array([4.0, 0.0, 10.0]))
    np.testing.assert_array_equal(np.concatenate([part.time for part in parts]), TIME)
    assert len(parts) == 40
    assert all(part.zero_known and part.name == "one" and part.command is pushed for part in parts)


def test_a_wide_swing_with_which_a_linear_model_loses_step_is_fitted_through_windows():
    whole = record(SWING, HANGING, [-1.6, 0.0])
    linear = fit_output_error(Plant(driven=False), [whole], [np.array([0.1, 52.0])])
    assert loses_step(linear, [whole])
    start = np.append(linear.parameters, [0.3, np.pi])
    near = fit_output_error(SWING, windows([whole], linear.parameters), [start])
    found = fit_output_error(SWING, [whole], [near.parameters])
    np.testing.assert_allclose(found.parameters, HANGING, atol=1e-3)
    assert not loses_step(found, [whole])


def test_a_model_whose_free_run_runs_away_loses_step():
    whole = record(SWING, HANGING, [-1.6, 0.0])
    linear = fit_output_error(Plant(driven=False), [whole], [np.array([0.1, 52.0])])
    (residual,) = linear.residuals
    assert loses_step(replace(linear, residuals=(np.full_like(residual, np.nan),)), [whole])
