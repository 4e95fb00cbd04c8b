"""A mouth that turns as its place does is seen square on; one that does not, at a slant."""

import numpy as np
import pytest

from anglecam.vision.mark.outline_turn import outline_turn
from anglecam.vision.mark.segment import Region

TURN = np.radians(np.concatenate([np.linspace(-15, 15, 60), np.linspace(15, -15, 60)]))


def outlines(direction, noise=0.0, axes=(9.0, 6.0)):
    """Regions whose longer axis lies at ``direction`` (n,), their moments scattered by a share ``noise``."""
    rng = np.random.default_rng(0)
    regions = []
    for at in direction:
        R = np.array([[np.cos(at), -np.sin(at)], [np.sin(at), np.cos(at)]])
        scatter = noise * rng.normal(size=(2, 2))
        moments = R @ np.diag(np.square(axes)) @ R.T * (1.0 + scatter + scatter.T)
        regions.append(Region(np.zeros(2), 100.0, moments, np.eye(2), np.zeros((0, 2), np.int32), True))
    return regions


@pytest.mark.parametrize("share", [-0.4, 0.0, 0.2])
def test_the_share_is_found_and_its_uncertainty_holds_it(share):
    found, sigma = outline_turn(outlines(2.0 + (1.0 + share) * TURN, noise=0.03), 0.3 + TURN)
    assert sigma < 0.03
    assert abs(found - share) < 3.0 * sigma


def test_an_axis_that_points_across_its_own_seam_turns_on():
    found, _ = outline_turn(outlines(np.pi / 2 + TURN), TURN)
    assert found == pytest.approx(0.0, abs=1e-6)


def test_a_round_mouth_one_at_rest_and_one_hardly_seen_tell_nothing():
    assert outline_turn(outlines(TURN, axes=(7.0, 6.9)), TURN) is None
    assert outline_turn(outlines(np.zeros(40)), np.zeros(40)) is None
    assert outline_turn(outlines(TURN[:5]), TURN[:5]) is None
