"""The integrator and each effect are compiled once for all processes, and an effect that is added compiles alone."""

from __future__ import annotations

import subprocess
import sys
from copy import copy
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from anglecam.data.command import Command
from anglecam.effects import LEDGER, Effect, Parameter, effect, ports
from anglecam.identification import kalman
from anglecam.models.integrator import integrate
from anglecam.models.pieces import PORTS
from anglecam.models.plant import Plant
from support.starts import first_start

TIME = np.arange(0.0, 3.0, 1 / 30)
COMMAND = Command(np.array([0.0, 0.51, 1.9]), np.array([0.0, 0.3, -0.2]))
BASE, FIRST = (26.0, 524.0, 508.0), np.array([0.1, 0.5])
INSIDE = tuple(e for e in LEDGER if e.port in PORTS)
ELSEWHERE = """
from anglecam.effects import LEDGER
from anglecam.identification import kalman
from anglecam.models.integrator import integrate
from anglecam.models.pieces import PORTS
print(sum(integrate.stats.cache_misses.values()) + sum(kalman._flow.stats.cache_misses.values()))
print([e.id for e in LEDGER if e.port in PORTS and getattr(e, e.port).cache_hits != 1])
"""


def run(*effects, parameters=None):
    values = [first_start(e) for e in effects] if parameters is None else parameters
    return Plant(effects).predict(np.concatenate([BASE, *values]), TIME, COMMAND, FIRST)


def test_another_process_finds_the_compiled_integrator_and_every_effect():
    said = subprocess.run([sys.executable, "-c", ELSEWHERE], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["0", "[]"]


def test_the_integrator_is_compiled_for_one_signature_whatever_the_effects():
    for entries in (INSIDE, INSIDE[:1], ()):
        run(*entries)
    assert len(integrate.signatures) == len(kalman._flow.signatures) == 1


@ports.load
def _steady(time, theta, omega, abc, parameters):
    return parameters[0]


MINE = Effect("steady", "load", "", "", "", (Parameter("push", "p", 0.0, -9.0, 9.0, (1.0,)),), (), "", "", load=_steady)


def test_an_effect_that_somebody_adds_acts_beside_those_of_the_ledger():
    torque = effect("constant_torque")
    pushed = run(MINE, effect("dead_zone"), parameters=([2.0], [0.02]))
    assert np.array_equal(pushed, run(torque, effect("dead_zone"), parameters=([2.0], [0.02])))
    assert np.max(np.abs(pushed - run(effect("dead_zone"), parameters=([0.02],)))) > 1e-3


@pytest.mark.parametrize("port", PORTS)
def test_the_order_in_which_effects_are_listed_changes_nothing(port):
    entries = [e for e in INSIDE if e.port == port] + [effect("backlash")]
    for pair in combinations(entries, 2):
        assert np.array_equal(run(*pair), run(*reversed(pair)), equal_nan=True)


def test_friction_of_no_size_is_no_friction():
    friction = effect("coulomb_friction")
    drag = effect("quadratic_drag")
    assert np.array_equal(run(friction, drag, parameters=([0.0] * 4, [1.0])), run(drag, parameters=([1.0],)))


@pytest.mark.parametrize("beside", ["quadratic_drag", "elastic_coupling", "load_dependent_friction"])
@pytest.mark.parametrize("effect_id", [e.id for e in INSIDE if any(p.staged for p in e.parameters)])
def test_an_omitted_staged_parameter_is_zero_whatever_acts_beside_it(effect_id, beside):
    whole, other = effect(effect_id), effect(beside)
    kept = tuple(p for p in whole.parameters if not p.staged)
    values = first_start(whole)[: len(kept)]
    zeros = np.zeros(len(whole.parameters) - len(kept))
    shorter = run(replace(whole, parameters=kept), other, parameters=(values, first_start(other)))
    assert np.array_equal(shorter, run(whole, other, parameters=(np.append(values, zeros), first_start(other))))


def test_a_command_and_instants_that_cannot_be_written_to_are_taken():
    time = TIME.copy()
    time.setflags(write=False)
    assert np.array_equal(Plant().predict(np.array(BASE), time, COMMAND, FIRST), run())


def test_what_is_kept_of_a_plant_holds_no_addresses_of_this_process():
    plant = Plant((effect("quadratic_drag"),))
    parameters = np.array([*BASE, 1.0])
    expected = plant.run(parameters, TIME, COMMAND, FIRST)
    assert "pieces" in vars(plant)
    copied = copy(plant)  # it takes what pickle takes
    assert "pieces" not in vars(copied)
    np.testing.assert_array_equal(copied.run(parameters, TIME, COMMAND, FIRST), expected)
