"""Without a hint a film is measured anew where the hint did not help, and only what the hint means counts."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.engine.hints import Hints, agrees_with_click, agrees_with_pivot
from anglecam.io.rig import Rig
from anglecam.measurement.without_hint import without_hints


@pytest.mark.parametrize(
    ("hinted", "bare"),
    [
        ({"mouth": {"at": [30, 40], "frame": 2}}, {}),
        ({"mouth": {"box": [30, 40, 50, 60]}, "pivot": {"near": [5, 5]}}, {}),
        ({"pivot": {"near": [5, 5], "marker": "ring"}}, {"pivot": {"marker": "ring"}}),
        ({"mouth": {"at": [30, 40]}, "pivot": {"at": [5, 5]}}, {"pivot": {"at": [5, 5]}}),
        ({"mouth": {"rgb": [200, 30, 20]}, "pivot": {"near": [5, 5]}}, {"mouth": {"rgb": [200, 30, 20]}}),
    ],
)
def test_places_of_mark_and_pivot_are_hints_and_a_colour_and_a_declared_pivot_are_none(hinted, bare):
    assert without_hints(Rig.model_validate(hinted)) == Rig.model_validate(bare)


@pytest.mark.parametrize("declared", [{}, {"mouth": {"rgb": [200, 30, 20]}}, {"pivot": {"at": [5, 5]}}])
def test_a_rig_without_hints_is_not_tried_twice(declared):
    assert without_hints(Rig.model_validate(declared)) is None


def test_what_turns_is_meant_if_it_is_within_three_standard_uncertainties_of_the_hint():
    pivot = Hints(pivot_px=np.array([100.0, 100.0]))
    assert agrees_with_pivot(np.array([180.0, 100.0]), np.eye(2), pivot)
    assert not agrees_with_pivot(np.array([195.0, 100.0]), np.eye(2), pivot)
    assert agrees_with_pivot(np.array([195.0, 100.0]), 900.0 * np.eye(2), pivot)
    click = Hints(mark_px=np.array([50.0, 50.0, 50.0, 50.0]), mark_frame=3)
    assert agrees_with_click(np.array([70.0, 50.0]), 0.0, click)
    assert not agrees_with_click(np.array([80.0, 50.0]), 0.0, click)
    assert agrees_with_click(np.array([80.0, 50.0]), 12.0, click)
    assert agrees_with_pivot(np.zeros(2), np.eye(2), click)
    assert agrees_with_click(np.zeros(2), 0.0, pivot)
