"""Perspective: the angle against a pinhole that projects points in space, and `camera_tilt` as its limit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from anglecam.data.camera_evidence import View
from anglecam.effects import effect

NOD = np.radians(np.linspace(-25.0, 25.0, 101))
TIME = np.linspace(0.0, 4.0, len(NOD))
LEVER_PX, PIVOT_PX = 200.0, (-80.0, 60.0)


def observed(name, *parameters, mirrored=False):
    view = View(math.radians(20.0), LEVER_PX, PIVOT_PX, mirrored)
    return effect(name).observation(TIME, NOD, np.array(parameters), view)


def projected(tilt, axis, closeness, height, mirrored):
    """Return the angle of the line between the pictures of the two marks, zero at rest; lengths are in lever arms."""
    turn = Rotation.from_rotvec(-tilt * np.array([math.cos(axis), math.sin(axis), 0.0])).as_matrix()
    side = -1.0 if mirrored else 1.0
    pivot = np.array([side * PIVOT_PX[0] / LEVER_PX, -PIVOT_PX[1] / LEVER_PX, 0.0])
    line = math.radians(20.0) + NOD
    mouth = np.column_stack([np.cos(line), np.sin(line), np.zeros(len(line))])

    def picture(points):
        placed = points @ turn.T + pivot
        return placed[..., :2] / (1.0 / closeness - placed[..., 2:])

    arm = picture(mouth) - picture(np.array([0.0, 0.0, height]))
    seen = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    return seen - np.interp(0.0, NOD, seen)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("parameters", [(0.3, 0.8, 0.25, 0.5), (0.2, -1.4, 0.4, -0.3), (0.0, 0.0, 0.3, 0.6)])
def test_it_is_a_pinholes_picture(parameters, mirrored):
    found = observed("perspective", *parameters, mirrored=mirrored)
    found = found - np.interp(0.0, NOD, found)
    assert found == pytest.approx(projected(*parameters, mirrored), abs=1e-9)


def test_its_limit_at_an_infinite_distance_is_a_tilt():
    assert observed("perspective", 0.3, 0.8, 0.0, 0.5) == pytest.approx(
        observed("camera_tilt", 0.3, 0.8, 0.5), abs=1e-12
    )


def test_from_a_pivot_in_the_plane_the_distance_changes_the_angle_as_another_tilt_would():
    near = observed("perspective", 0.3, 0.8, 0.3, 0.0)
    assert np.degrees(np.abs(near - observed("camera_tilt", 0.3, 0.8, 0.0))).max() > 0.3
    found = least_squares(lambda x: observed("camera_tilt", *x, 0.0) - near, [0.3, 0.8], xtol=1e-15, ftol=1e-15)
    assert np.degrees(np.abs(found.fun)).max() < 1e-6


def test_at_its_null_it_changes_nothing():
    assert observed("perspective", *effect("perspective").null) == pytest.approx(NOD, abs=1e-15)


def test_it_needs_to_know_where_the_pivot_is_in_the_picture():
    assert effect("perspective").needs(View(0.0, LEVER_PX, PIVOT_PX))
    assert not effect("perspective").needs(View(0.0, LEVER_PX, None))
    assert not effect("perspective").needs(View(0.0, LEVER_PX, PIVOT_PX, only_pivot_differs=True))
