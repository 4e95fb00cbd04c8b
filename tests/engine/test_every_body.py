"""Films in which several things move: each that turns is measured, whatever it hangs on; others are listed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.rig import Rig
from anglecam.measurement.clip import Measurement, measure_clip
from anglecam.video.open_film import open_film
from anglecam.workflow.clip import write_measurement
from support import things

FIRST = 25.0 * np.sin(2 * np.pi * np.arange(60) / 40.0)
SECOND = 18.0 * np.sin(2 * np.pi * np.arange(60) / 27.0 + 1.0)
GREY, DARK, BROWN = (110, 112, 110), (60, 60, 60), (40, 42, 90)
Draw = Callable[[np.ndarray, float, float], None]


def _sticks(scene, first, second):
    things.bar(scene, (80.0, 30.0), things.hanging((80.0, 30.0), 100.0, first), 14.0, DARK)
    things.bar(scene, (240.0, 30.0), things.hanging((240.0, 30.0), 100.0, second), 14.0, DARK)


def _links(scene, first, second):
    joint = things.hanging((160.0, 30.0), 90.0, first)
    things.bar(scene, (160.0, 30.0), joint, 14.0, GREY)
    things.bar(scene, joint, things.hanging(joint, 80.0, second), 12.0, BROWN)


def _stick_and_cart(scene, first, second):
    x = 160.0 + 200.0 * second
    things.bar(scene, (x - 25.0, 215.0), (x + 25.0, 215.0), 24.0, DARK)
    things.bar(scene, (160.0, 20.0), things.hanging((160.0, 20.0), 120.0, first), 14.0, GREY)


def _stick(scene, first, second):
    things.stick(GREY, 12.0)(scene, first)


def _measured(folder, draw: Draw, second=SECOND, *, every_body: bool = True, rig: Rig | None = None) -> Measurement:
    others = iter(np.radians(second))
    film = things.film(folder / "clip.mkv", lambda scene, angle: draw(scene, angle, next(others)), FIRST)
    return measure_clip(open_film(film), rig or Rig(), every_body=every_body)


def _error(angle, truth_deg):
    """Return the RMS error of angles, rad, degrees; zero is free."""
    error = np.degrees(angle) - truth_deg
    return float(np.sqrt(np.nanmean((error - np.nanmedian(error)) ** 2)))


def test_two_sticks_are_measured_each_about_its_pivot(tmp_path):
    measured = _measured(tmp_path, _sticks)
    first, second = measured.bodies
    assert first.series.ok.all()
    assert second.series.ok.all()
    assert _error(first.series.angle, FIRST) < 0.1
    assert _error(second.series.angle, SECOND) < 0.1
    assert np.median(np.degrees(second.series.sigma)) < 0.2
    assert np.hypot(*(np.array(second.pivot_px) - (240.0, 30.0))) < 1.5
    assert (first.joint_to, second.joint_to) == (None, None)
    assert min(first.posterior, second.posterior) > 0.99
    assert np.degrees(second.amplitude) == pytest.approx(18.0, abs=0.2)


def test_of_two_hinged_links_both_angles_are_measured(tmp_path):
    measured = _measured(tmp_path, _links, 1.6 * SECOND)
    upper, lower = measured.bodies
    assert lower.joint_to == 1
    assert lower.series.ok.all()
    assert _error(upper.series.angle, FIRST) < 0.2
    assert _error(lower.series.angle, 1.6 * SECOND) < 0.2
    assert _error(lower.relative, 1.6 * SECOND - FIRST) < 0.3
    off = np.degrees(lower.series.angle) - 1.6 * SECOND
    assert np.sqrt(np.mean(((off - np.median(off)) / np.degrees(lower.series.sigma)) ** 2)) < 1.5
    joint = np.column_stack(things.hanging((160.0, 30.0), 90.0, np.radians(FIRST)))
    wander = lower.series.pivot_px - joint
    assert np.sqrt(((wander - np.median(wander, axis=0)) ** 2).mean()) < 0.5


def test_a_cart_beside_a_stick_translates(tmp_path):
    measured = _measured(tmp_path, _stick_and_cart)
    stick, cart = measured.bodies
    assert _error(stick.series.angle, FIRST) < 0.1
    assert (cart.moves, cart.pivot_px, cart.amplitude, cart.series) == ("translates", None, 0.0, None)
    assert measured.several is None


def test_beside_one_stick_nothing_is_found_and_what_an_earlier_call_found_goes(tmp_path):
    measured = _measured(tmp_path, _stick)
    assert len(measured.bodies) == 1
    earlier = tmp_path / "clip.b2.angles.csv"
    earlier.write_text("time_s,angle_deg\n0,1\n")
    write_measurement(measured, None, tmp_path)
    assert not earlier.exists()
    assert (tmp_path / "clip.angles.csv").exists()


def test_the_declared_body_is_the_first(tmp_path):
    measured = _measured(tmp_path, _sticks, rig=Rig(body=2), every_body=False)
    first, second = measured.bodies
    assert _error(measured.series.angle, SECOND) < 0.1
    assert measured.series.name == "clip"
    assert first.pivot_px[0] == pytest.approx(240.0, abs=1.5)
    assert (second.number, second.series) == (2, None)
    assert measured.several is None


def test_a_body_that_is_not_there_is_no_first_body(tmp_path):
    with pytest.raises(InputError, match=r"clip\.mkv: body: 2 is declared in rig\.yaml, but only 1 are seen to move"):
        _measured(tmp_path, _stick, rig=Rig(body=2), every_body=False)


@pytest.mark.parametrize(("draw", "count"), [(_sticks, 2), (_stick, 1)], ids=["two", "one"])
def test_a_line_says_that_two_things_turn(tmp_path, draw, count):
    measured = _measured(tmp_path, draw, every_body=False)
    assert len(measured.bodies) == count
    assert [body.series for body in measured.bodies[1:]] == [None] * (count - 1)
    said = [note for note in measured.notes if note.startswith("two things turn: one about 80,30")]
    assert len(said) == count - 1
