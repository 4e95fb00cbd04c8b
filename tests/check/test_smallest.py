"""Effects of twice the predicted smallest size are detected, of 0.3 times not.

`benchmarks/check_films.py sizes` counts both over more sessions.
"""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.check.smallest import best_command, duration_of, smallest_sizes
from anglecam.data.command import Command
from benchmarks.check_films import SCATTER, TRUE, plan, session_with
from support.closing import close_without_rivals

TRIED = ("dead_time", "coulomb_friction", "backlash")


@pytest.fixture(scope="module")
def sizes():
    return {one.effect.id: one for one in smallest_sizes(plan(), TRUE, SCATTER, SCATTER)}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "dead_time" else pytest.mark.sweep) for name in TRIED]
)
def test_twice_the_smallest_size_is_detected_and_a_third_of_it_is_not(sizes, name):
    large, small = (close_without_rivals(session_with(sizes[name], multiple, 0)) for multiple in (2.0, 0.3))
    assert large.verdict != "nothing_missing"
    assert small.verdict == "nothing_missing"


def test_sizes_grow_with_the_uncertainty(sizes):
    coarse = {one.effect.id: one.size for one in smallest_sizes(plan(), TRUE, 4.0 * SCATTER, 4.0 * SCATTER)}
    assert coarse["dead_time"] == pytest.approx(4.0 * sizes["dead_time"].size, rel=0.3)
    assert coarse["coulomb_friction"] > 2.0 * sizes["coulomb_friction"].size


@pytest.mark.sweep  # `check` proposes a command in `test_films.py`
def test_a_command_that_shows_more_keeps_within_the_limits(sizes):
    found = best_command(plan(), TRUE, SCATTER)
    assert found is not None
    assert found.factor < 1.0
    assert np.abs(found.command.angle).max() <= np.radians(12.0) + 1e-6


def test_a_recording_lasts_as_long_as_its_command():
    command = Command(np.array([0.0, 3.0]), np.zeros(2))
    assert duration_of(command, 20.0) == 4.0
    assert duration_of(None, 20.0) == 20.0
