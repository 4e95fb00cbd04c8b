"""The compiled integrator against closed forms and against an event-based reference that shares no code with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from anglecam.data.camera_evidence import View
from anglecam.data.command import Command
from anglecam.data.runs import runs_of
from anglecam.effects import LEDGER, effect
from anglecam.effects.effect import PORTS
from anglecam.loop.screen import starts_of
from anglecam.models import pieces
from anglecam.models.plant import Plant
from support.motion import Plant as TruePlant
from support.motion import Recording, command_rows, move
from support.series import session
from support.starts import SEEN, first_start

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
    # an effect inside the equation of motion is integrated in steps; the others then change nothing
    stepped = Plant((effect("dead_zone"),)).predict(
        np.array([26.0, 524.0, 508.0, 0.0]), TIME, command, np.array([0.1, 0.5])
    )
    assert full == pytest.approx(stepped, abs=1e-14)
    assert np.degrees(np.abs(base - full)).max() < 1e-4
    outside = tuple(e for e in LEDGER if e.port not in pieces.PORTS)
    nulls = np.concatenate([e.null for e in outside])
    part = Plant(outside).predict(np.array([26.0, 524.0, 508.0, *nulls]), TIME, command, np.array([0.1, 0.5]))
    assert part == pytest.approx(base, abs=1e-14)


@pytest.mark.parametrize("lag", [0.0, 1e-4, 0.003, 0.05])
@pytest.mark.parametrize("abc", [(26.0, 524.0, 508.0), (0.0, 0.0, 2.0), (300.0, 9e4, 9e4), (-1.0, -3.0, 5.0)])
def test_the_linear_plant_is_exact_to_rounding(abc, lag):
    command = Command(np.array([0.0, 0.4, 0.41]), np.array([0.1, 0.3, -0.2]))
    time = np.linspace(0.0, 0.8, 25)
    plant = Plant((effect("actuator_lag"),))
    angle = plant.predict(np.array([*abc, lag]), time, command, np.array([0.1, 0.5]))
    # θ, ω, v and a constant under the matrix exponential
    a, b, c = abc
    state, now, expected = np.array([0.1, 0.5, 0.1, 1.0]), 0.0, [0.1]
    for stop in np.unique([*time, *command.time])[1:]:
        u = float(command.at(np.array([now]))[0])
        matrix = np.zeros((4, 4))
        matrix[0, 1] = 1.0
        matrix[1, :3] = -b, -a, c
        if lag:
            matrix[2, 2], matrix[2, 3] = -1.0 / lag, u / lag
        else:
            state[2] = u
        state, now = expm(matrix * (stop - now)) @ state, stop
        if stop in time:
            expected.append(state[0])
    assert angle == pytest.approx(np.array(expected), rel=1e-9, abs=1e-11)


def test_prediction_is_smooth_in_the_dead_time():
    command = Command(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.3, -0.2]))
    plant = Plant((effect("dead_time"),))

    def at(tau: float) -> np.ndarray:
        return plant.predict(np.array([26.0, 524.0, 508.0, tau]), TIME, command, np.zeros(2))

    fine, coarse = (at(0.03 + 1e-5) - at(0.03 - 1e-5)) / 2e-5, (at(0.03 + 1e-3) - at(0.03 - 1e-3)) / 2e-3
    assert np.max(np.abs(fine - coarse)) < 0.02 * np.max(np.abs(fine))


def test_every_entry_of_the_ledger_is_complete():
    ids = {e.id for e in LEDGER}
    assert ids >= {"dead_time", "coulomb_friction", "quadratic_drag"}
    for entry in LEDGER:
        assert entry.station in ("command", "actuator", "load", "camera")
        assert all((entry.summary, entry.equation, entry.relaxes, entry.separating_experiment, entry.source))
        assert sum(getattr(entry, port) is not None for port in PORTS) == 1
        assert (entry.states > 0) == (entry.port in ("lag", "dynamics"))
        tried = starts_of(entry, SEEN)
        assert all(start[0] != entry.null[0] for start in tried)
        assert all(np.all((entry.bounds[0] <= start) & (start <= entry.bounds[1])) for start in tried)
        for p in entry.parameters:
            assert p.symbol in entry.equation
            assert p.lower <= p.null <= p.upper


@pytest.mark.parametrize("ids", [(), ("coulomb_friction",), ("rolling_shutter", "pivot_offset"), ("backlash",)])
def test_several_runs_are_those_that_follow_one_another(ids):
    effects = tuple(effect(name) for name in ids)
    parameters = np.array([26.0, 524.0, 508.0, *(x for e in effects for x in first_start(e))])
    plant, view = Plant(effects), View(0.3, 120.0, (10.0, 40.0))
    records = [replace(one, view=view) for one in session(TruePlant(), 0)]
    first = np.array([[0.01 * i, 0.1] for i in range(len(records))])
    angle, motion = plant.predict_all(parameters, runs_of(records), first)
    each = [plant.predict(parameters, r.time, r.command, s, view) for r, s in zip(records, first, strict=True)]
    assert list(angle) == list(np.concatenate(each))
    assert list(motion[: len(records[0].time), 0]) == list(
        plant.run(parameters, records[0].time, records[0].command, first[0])[:, 0]
    )


@pytest.mark.parametrize("name", [None, "coulomb_friction", "dead_zone", "stiffening_spring"])
def test_a_run_that_is_told_of_a_near_one_is_the_same(name):
    effects = () if name is None else (effect(name),)
    parameters = np.array([26.0, 524.0, 508.0, *(x for e in effects for x in first_start(e))])
    runs, first = runs_of(session(TruePlant(), 0)), np.zeros((5, 2))
    plant = Plant(effects)
    near = plant.predict_all(parameters, runs, first)[1]
    told, alone = (plant.predict_all(parameters, runs, first + 1e-7, each)[0] for each in (near, None))
    assert list(told) == list(alone)
