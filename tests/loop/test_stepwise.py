"""The smallest first effect in a film exceeds the errors of the measurement."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from anglecam.loop.policy import DEFAULT
from anglecam.loop.stepwise import smallest_first_effect

CAMERA = 2e-4


@pytest.mark.parametrize(
    ("left", "phi", "times"),
    [
        (CAMERA, 0.0, 1.0),  # all of the stated uncertainty scatters from frame to frame
        (0.6 * CAMERA, 0.0, 1.6),  # the other 0.8 of it does not, and might follow the motion
        (CAMERA, 0.8, 1.6),  # nor does what resembles the frame before
        (0.0, 0.0, 2.0),
        (5.0 * CAMERA, 0.0, 1.0),
    ],
)
def test_a_first_effect_must_exceed_the_uncertainty_and_twice_the_part_that_can_follow_the_motion(left, phi, times):
    task = SimpleNamespace(camera=CAMERA, policy=DEFAULT)
    first = SimpleNamespace(cross_validated=SimpleNamespace(rmse=0.0))
    assert smallest_first_effect(task, first, SimpleNamespace(rmse=left, phi=phi)) == pytest.approx(times * CAMERA)
    coarse = SimpleNamespace(cross_validated=SimpleNamespace(rmse=1e4 * CAMERA))
    assert smallest_first_effect(task, coarse, SimpleNamespace(rmse=left, phi=phi)) == pytest.approx(50.0 * CAMERA)
