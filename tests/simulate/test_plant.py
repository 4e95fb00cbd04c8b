"""The compiled integrator against closed forms and against an event-based oracle that shares nothing with it."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.effects import LEDGER, effect
from anglecam.session import Command
from anglecam.simulate.plant import Plant
from support.motion import Plant as TruePlant
from support.motion import Recording, command_rows, move

TIME = np.arange(0.0, 8.0, 1 / 30)


@pytest.mark.parametrize(
    ("true", "effect_id", "value"),
    [
        (TruePlant(), None, None),
        (TruePlant(dead_time_s=0.0437), "dead_time", 0.0437),
        (TruePlant(quadratic_drag=2.0), "quadratic_drag", 2.0),
        (TruePlant(coulomb=6.0), "coulomb_friction", 6.0),
    ],
)
@pytest.mark.parametrize("kind", ["steps", "triangle", "chirp"])
def test_prediction_agrees_with_the_oracle(true, effect_id, value, kind):
    recording = Recording(kind, kind)
    rows = command_rows(recording, np.random.default_rng(0))
    plant = Plant() if effect_id is None else Plant((effect(effect_id),))
    parameters = np.array([true.a, true.b, true.c] + ([] if value is None else [value]))
    command = Command(rows[:, 0], np.radians(rows[:, 1]))
    predicted = plant.predict(parameters, TIME, command, np.zeros(2))
    assert np.degrees(predicted) == pytest.approx(move(true, recording, TIME, rows), abs=2e-3)


def test_effects_at_their_null_change_nothing():
    command = Command(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.3, -0.2]))
    base = Plant().predict(np.array([26.0, 524.0, 508.0]), TIME, command, np.array([0.1, 0.5]))
    nulls = np.concatenate([e.null for e in LEDGER])
    full = Plant(LEDGER).predict(np.array([26.0, 524.0, 508.0, *nulls]), TIME, command, np.array([0.1, 0.5]))
    assert np.array_equal(base, full)


def test_prediction_is_smooth_in_the_dead_time():
    command = Command(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.3, -0.2]))
    plant = Plant((effect("dead_time"),))

    def at(tau: float) -> np.ndarray:
        return plant.predict(np.array([26.0, 524.0, 508.0, tau]), TIME, command, np.zeros(2))

    fine, coarse = (at(0.03 + 1e-5) - at(0.03 - 1e-5)) / 2e-5, (at(0.03 + 1e-3) - at(0.03 - 1e-3)) / 2e-3
    assert np.max(np.abs(fine - coarse)) < 0.02 * np.max(np.abs(fine))


def test_every_entry_of_the_ledger_says_what_a_reader_needs():
    ids = {e.id for e in LEDGER}
    assert ids >= {"dead_time", "coulomb_friction", "quadratic_drag"}
    for entry in LEDGER:
        assert entry.station in ("command", "actuator", "load", "camera")
        assert all((entry.summary, entry.equation, entry.relaxes, entry.separating_experiment, entry.source))
        assert sum(port is not None for port in (entry.shift_command, entry.load, entry.dry)) == 1
        for p in entry.parameters:
            assert p.lower <= p.null <= p.upper
            assert all(p.lower <= start <= p.upper for start in p.starts)
