"""Bounds, starts and steps follow the plant's speed and the motion's width; truth by SciPy's integration."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.effects import effect
from anglecam.loop.close import close_records
from support.closing import close_without_rivals

A, B, C, K3 = 40.0, 1.8e5, 1.9e5, 2.3e5
"""A circuit of 68 Hz with a cubic spring, similar to the Silverbox; 1 rad for a volt."""
SIGMA = 2e-4
"""rad."""


@cache
def oscillation(name: str, seed: int) -> Record:
    """Return the response to random levels of 8 ms, at 600 Hz."""
    rng = np.random.default_rng(seed)
    edges = np.arange(0.02, 0.9, 0.008)
    levels = rng.uniform(-0.35, 0.35, len(edges))
    time = np.arange(0.0, 0.9, 1.0 / 600.0)

    def rate(t, state, u):
        return [state[1], C * u - A * state[1] - B * state[0] - K3 * state[0] ** 3]

    angle, state = np.zeros(len(time)), np.zeros(2)
    for start, stop, u in zip(edges, [*edges[1:], 0.9], levels, strict=True):
        inside = (time >= start) & (time < stop)
        found = solve_ivp(rate, (start, stop), state, args=(u,), rtol=1e-9, atol=1e-12, t_eval=[*time[inside], stop])
        angle[inside], state = found.y[0, :-1], found.y[:, -1]
    angle += SIGMA * rng.standard_normal(len(time))
    command = Command(np.append(0.0, edges), np.append(0.0, levels))
    return Record(name, time, angle, command, True, np.full(len(time), SIGMA))


def scaled(record: Record, factor: float) -> Record:
    """Return the recording in another unit of the angle."""
    command = Command(record.command.time, factor * record.command.angle)
    return Record(record.name, record.time, factor * record.angle, command, True, factor * record.sigma)


@pytest.mark.parametrize("factor", [pytest.param(1.0, marks=pytest.mark.sweep), 0.05])
def test_a_cubic_spring_of_a_fast_oscillator_is_named_in_any_unit_of_the_angle(factor):
    records = [scaled(oscillation(name, seed), factor) for name, seed in (("one", 0), ("other", 1))]
    verdict = close_without_rivals(records, held_out=["other"])
    assert verdict.verdict == "attributed"
    assert [accepted.effect.id for accepted in verdict.accepted] == ["stiffening_spring"]
    place = verdict.after.model.names.index("k3_per_s2")
    expected = K3 / factor**2
    assert abs(verdict.after.parameters[place] - expected) < 4.0 * verdict.after.sigma[place] + 0.01 * expected
    assert verdict.after_held_out.rmse < 1.2 * factor * SIGMA


def test_bounds_and_starts_are_widened_with_the_value_and_never_narrowed():
    spring = effect("stiffening_spring").parameters[0]
    wide = spring.at_scale(10.0, 0.1)
    assert wide.upper == pytest.approx(1e4 * spring.upper)
    assert wide.starts == pytest.approx(tuple(1e4 * start for start in spring.starts))
    delay = effect("dead_time").parameters[0]
    assert delay.at_scale(10.0, 1.0) == delay
    limit = effect("rate_limit").parameters[0]  # its reciprocal is fitted, so a small limit is a large value
    assert limit.at_scale(1.0, 0.1).upper == pytest.approx(10.0 * limit.upper)


def test_a_body_that_never_moves_lacks_nothing():
    at_rest = replace(oscillation("rest", 0), angle=np.full(540, 0.2))
    assert close_records([at_rest]).verdict == "nothing_missing"
