"""A mark whose outline rotates with its place is seen square on; otherwise the view is slanted."""

import numpy as np
import pytest

from anglecam.vision.mark.outline_turn import outline_bend, outline_turn
from anglecam.vision.mark.segment import Region

TURN = np.radians(np.concatenate([np.linspace(-15, 15, 60), np.linspace(15, -15, 60)]))


def marks(direction, noise=0.0, axes=(9.0, 6.0)):
    """Return regions with the longer axis at ``direction`` (n,), their moments scattered by a share ``noise``."""
    rng = np.random.default_rng(0)
    regions = []
    for at in direction:
        R = np.array([[np.cos(at), -np.sin(at)], [np.sin(at), np.cos(at)]])
        scatter = noise * rng.normal(size=(2, 2))
        moments = R @ np.diag(np.square(axes)) @ R.T * (1.0 + scatter + scatter.T)
        regions.append(Region(np.zeros(2), 100.0, moments, np.eye(2), np.zeros((0, 2), np.int32), True))
    return regions


@pytest.mark.parametrize("share", [-0.4, 0.0, 0.2])
def test_the_share_is_found_within_its_uncertainty(share):
    found, sigma = outline_turn(marks(2.0 + (1.0 + share) * TURN, noise=0.03), 0.3 + TURN)
    assert sigma < 0.03
    assert abs(found - share) < 3.0 * sigma


def test_an_axis_that_crosses_the_end_of_its_range_is_unwrapped():
    found, _ = outline_turn(marks(np.pi / 2 + TURN), TURN)
    assert found == pytest.approx(0.0, abs=1e-6)


def test_a_round_mark_a_mark_at_rest_and_a_mark_in_few_frames_give_no_share():
    assert outline_turn(marks(TURN, axes=(7.0, 6.9)), TURN) is None
    assert outline_turn(marks(np.zeros(40)), np.zeros(40)) is None
    assert outline_turn(marks(TURN[:5]), TURN[:5]) is None


def test_an_axis_that_is_not_seen_for_half_a_turn_is_unwrapped_beside_the_line():
    line = np.concatenate([TURN[:60], np.pi + TURN[60:]])
    found, _ = outline_turn(marks(line), np.unwrap(line))
    assert found == pytest.approx(0.0, abs=1e-6)


def test_a_mark_that_bends_differs_from_noise_and_from_a_slanted_view():
    bend = np.radians(3.0) * np.sin(np.linspace(0.0, 12.0, len(TURN)))
    bent = outline_bend(marks(TURN + bend, noise=0.03), TURN)
    assert bent == pytest.approx(bend.std(), rel=0.2)
    assert outline_bend(marks(1.2 * TURN, noise=0.03), TURN) < 0.2 * bent
