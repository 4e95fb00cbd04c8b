"""Pictures and paths of which nothing can be told say so, instead of numbers that mean nothing."""

from __future__ import annotations

import numpy as np

from anglecam.vision.pivot.circle import fit_circle
from anglecam.vision.stabilise.scenery import find_scenery


def test_a_path_that_is_all_but_a_line_has_no_circle():
    rng = np.random.default_rng(3)
    along = np.linspace(0.0, 12.0, 40)
    for bend in (0.0, 1e-9, 1e-7):
        path = np.column_stack([along, bend * along**2])
        assert fit_circle(path) is None
        circle = fit_circle(path + rng.normal(0.0, 0.02, path.shape))
        assert circle is None or np.linalg.eigvalsh(circle.centre_covariance_px2).min() > 0.0


def test_an_arc_of_two_degrees_has_one():
    angle = np.radians(np.linspace(0.0, 2.0, 60))
    path = 400.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    circle = fit_circle(path)
    assert circle is not None
    assert abs(circle.radius_px - 400.0) < 1e-3


def test_no_pictures_show_no_scenery():
    assert find_scenery([]) is None
