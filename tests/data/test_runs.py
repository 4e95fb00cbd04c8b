"""Recordings joined end to end keep what belongs to each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.data.camera_evidence import View
from anglecam.data.runs import one_run, runs_of
from support.motion import Plant as TruePlant
from support.series import session

RECORDS = session(TruePlant(), 0)
RUNS = runs_of(RECORDS)


def test_joined_recordings_split_into_what_was_joined():
    assert [list(part) for part in RUNS.split(RUNS.time)] == [list(r.time) for r in RECORDS]
    assert RUNS.first == pytest.approx([r.time[0] for r in RECORDS])
    assert [list(part) for part in RUNS.split(RUNS.owner)] == [[i] * len(r.time) for i, r in enumerate(RECORDS)]


def test_windows_of_a_recording_share_its_command():
    first, other = RECORDS[:2]
    runs = runs_of([first.between(0.0, 2.0), other, first.between(2.0, 9.0)])
    commands, numbers = runs.played
    assert commands == (first.command, other.command)
    assert list(numbers) == [0, 1, 0]


def test_a_function_of_each_run_receives_its_own_instants_and_view():
    runs = runs_of([replace(r, view=View(neutral=float(i))) for i, r in enumerate(RECORDS)])
    angle = np.sin(runs.time)

    def tilted(time, angle, values, view):
        return values[0] * (time - time[0]) + angle + view.neutral

    expected = [tilted(r.time, np.sin(r.time), [2.0], View(neutral=float(i))) for i, r in enumerate(RECORDS)]
    assert list(runs.each(tilted, runs.time, angle, np.array([2.0]))) == list(np.concatenate(expected))


def test_one_run_is_a_single_part():
    assert one_run(RECORDS[0].time, None, View()).parts == (slice(0, len(RECORDS[0].time)),)
