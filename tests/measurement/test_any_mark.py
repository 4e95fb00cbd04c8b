"""Things of any colour are found by how they move, or where somebody points at them, without any other hint."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.rig import Rig
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from support.things import ball, film, hanging, stick, wheel

TIME = np.arange(50) / 30.0
SWING = 22.0 * np.exp(-0.2 * TIME) * np.cos(2.0 * np.pi * TIME / 1.1)
TURNS = np.degrees(7.0 * TIME + 0.5 * np.sin(3.0 * TIME))
"""Two full turns of the wheel."""
DARK, WHITE, GREEN = (35, 35, 38), (245, 245, 245), (60, 165, 65)


def _errors(path, truth, **declared):
    """Return the error of every frame against the truth, each relative to its mean, and sigma; degrees."""
    series = measure_clip(open_film(path), Rig.model_validate(declared)).series
    assert series.ok.mean() > 0.9
    truth = truth[series.ok]
    angle = np.degrees(series.angle[series.ok])
    return angle - angle.mean() - truth + truth.mean(), np.degrees(series.sigma[series.ok])


@pytest.mark.parametrize(
    ("thing", "truth"),
    [
        pytest.param(ball(DARK, 12.0), SWING, id="dark ball", marks=pytest.mark.sweep),
        pytest.param(ball(WHITE, 12.0), SWING, id="white ball", marks=pytest.mark.sweep),
        pytest.param(ball(GREEN, 4.0), SWING, id="small green ball"),
        pytest.param(stick((110, 110, 112), 8.0), SWING, id="grey stick", marks=pytest.mark.sweep),
        pytest.param(wheel(DARK), TURNS, id="wheel"),
    ],
)
def test_a_thing_of_any_colour_is_measured_to_a_tenth_of_a_degree_without_a_hint(thing, truth, tmp_path):
    error, sigma = _errors(film(tmp_path / "thing.avi", thing, truth), truth)
    assert error.std() < 0.1
    assert np.abs(error / sigma).max() < 5.0


def test_a_declared_grey_some_tens_of_levels_off_is_found(tmp_path):
    path = film(tmp_path / "grey.avi", ball(DARK, 12.0), SWING)
    error, sigma = _errors(path, SWING, mark={"rgb": [65, 60, 55]})
    assert error.std() < 0.1
    assert np.abs(error / sigma).max() < 5.0


@pytest.mark.parametrize("way", ["at", pytest.param("box", marks=pytest.mark.sweep)])
def test_of_two_balls_the_one_that_is_pointed_at_is_measured(way, tmp_path):
    one, other = ball(DARK, 9.0, (90.0, 20.0), 150.0), ball(DARK, 9.0, (230.0, 20.0), 150.0)

    def both(scene, angle):
        one(scene, angle)
        other(scene, 0.6 * angle)

    path = film(tmp_path / "two.avi", both, SWING)
    for pivot, share in (((90.0, 20.0), 1.0), ((230.0, 20.0), 0.6)):
        x, y = hanging(pivot, 150.0, np.radians(share * SWING[7]))
        place = [round(x), round(y)] if way == "at" else [x - 12.0, y - 12.0, x + 12.0, y + 12.0]
        error, _ = _errors(path, share * SWING, mark={way: place, "frame": 7})
        assert error.std() < 0.1


def test_a_pivot_above_the_picture_is_found_or_fixed(tmp_path):
    pivot = (150.0, -300.0)
    path = film(tmp_path / "above.avi", ball(DARK, 12.0, pivot, 480.0), 0.6 * SWING)
    error, sigma = _errors(path, 0.6 * SWING)
    assert np.abs(error / sigma).max() < 5.0
    error, sigma = _errors(path, 0.6 * SWING, pivot={"at": pivot, "sigma_px": 0.5})
    assert error.std() < 0.02
    assert np.abs(error / sigma).max() < 5.0


def test_a_frame_that_the_film_does_not_have_is_named(tmp_path):
    path = film(tmp_path / "short.avi", ball(DARK, 12.0), SWING[:20])
    with pytest.raises(InputError, match=r"short\.avi: the mark is declared in frame 99, which the film does not have"):
        measure_clip(open_film(path), Rig.model_validate({"mark": {"at": [160, 180], "frame": 99}}))
