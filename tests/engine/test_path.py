"""Of look-alike poses the steadiest way is chosen, and how sure that is."""

from __future__ import annotations

import numpy as np

from anglecam.engine.path import middle, most_from_motion, steadiest_path, unsteadiness

TRUE = np.radians(7.0) * np.arange(40)


def _poses(order):
    return [(turn + 2.0 * np.pi / order * np.arange(order) + np.pi) % (2.0 * np.pi) - np.pi for turn in TRUE]


def test_a_wheel_of_five_like_spokes_goes_on_as_before():
    rng = np.random.default_rng(3)
    gains = [rng.normal(0.0, 0.5, 5) for _ in range(40)]
    gains[0][0] += 10.0  # only the first frame tells them apart
    path, margin = steadiest_path(_poses(5), gains, np.arange(40) / 30.0, 0.01)
    assert (path == 0).all()
    assert margin.min() > 0.0


def test_a_sudden_turn_is_followed_where_the_picture_shows_it():
    turns, gains = _poses(2), [np.array([0.0, 0.0]) for _ in range(40)]
    for k in range(20, 40):
        gains[k] = np.array([0.0, 40.0])
    path, _ = steadiest_path(turns, gains, np.arange(40) / 30.0, 0.01)
    assert (path[:20] == path[0]).all()
    assert (path[20:] == 1).all()


def test_frames_without_a_pose_are_left_out():
    turns, gains = _poses(3), [np.zeros(3) for _ in range(40)]
    turns[7], gains[7] = np.zeros(0), np.zeros(0)
    path, margin = steadiest_path(turns, gains, np.arange(40) / 30.0, 0.01)
    assert path[7] == -1
    assert np.isinf(margin[7])
    assert len({*path.tolist()} - {-1}) == 1


def test_a_body_is_hidden_where_only_something_like_it_is_seen():
    true = 0.02 * np.arange(40)
    turns = [np.array([angle]) for angle in true]
    gains = [np.array([30.0])] * 40
    for k in (17, 18, 19):
        turns[k], gains[k] = np.array([true[k] - 0.4]), np.array([3.0])
    path, _ = steadiest_path(turns, gains, np.arange(40) / 30.0, 0.005)
    np.testing.assert_array_equal(np.flatnonzero(path < 0), [17, 18, 19])


def test_a_body_that_jumps_is_not_hidden():
    true = np.where(np.arange(40) < 20, 0.0, 0.5)
    path, _ = steadiest_path([np.array([a]) for a in true], [np.array([30.0])] * 40, np.arange(40) / 30.0, 0.005)
    assert (path == 0).all()


def test_a_turn_that_the_picture_rules_out_by_more_than_motion_can_say_is_on_no_way():
    rng = np.random.default_rng(6)
    for _ in range(20):
        turns = [np.array([angle, rng.uniform(-np.pi, np.pi)]) for angle in TRUE % (2.0 * np.pi) - np.pi]
        gains = [rng.normal(0.0, 20.0, 2) for _ in TRUE]
        turns[15], gains[15] = turns[15][:2], np.array([0.0, -most_from_motion(0.01) - 1.0])
        path, _ = steadiest_path(turns, gains, np.arange(40) / 30.0, 0.01)
        assert path[15] != 1


def test_a_way_that_jumps_to_a_look_alike_and_back_is_less_steady():
    time = np.arange(40) / 30.0
    jumps = TRUE.copy()
    jumps[20:25] += np.radians(72.0)
    assert unsteadiness(TRUE, time, 0.01) < 0.01
    assert unsteadiness(jumps, time, 0.01) > 0.5
    hidden = np.where((np.arange(40) > 20) & (np.arange(40) < 24), np.nan, TRUE)
    assert unsteadiness(hidden, time, 0.01) < 0.01


def test_the_middle_of_angles_is_the_same_all_around_the_circle():
    off = np.radians([-4.0, -1.0, 0.0, 1.0, 4.0, 170.0])
    for turn in np.radians(np.arange(-180.0, 181.0, 30.0)):
        around = (off + turn + np.pi) % (2.0 * np.pi) - np.pi
        assert abs(np.angle(np.exp(1j * (middle(around) - turn)))) < np.radians(1.5)
