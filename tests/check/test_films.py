"""Predictions from the first seconds of small films against what the whole films give."""

from __future__ import annotations

import json
import math
import sys
from functools import cache

import numpy as np
import pytest

from anglecam.cli import app as cli
from anglecam.errors import InputError
from anglecam.workflow.check import MOST, check_clip
from anglecam.workflow.clip import measure_source, open_source
from support import things
from support.films import Thing

LIKE = 1.5
"""Factor on sigma: these films go on as they begin, and hold their prediction better than others."""
TIME = np.arange(165) / things.RATE_HZ
SWING_DEG = 25.0 * np.exp(-0.1 * TIME) * np.cos(2.0 * np.pi * 0.8 * TIME)
"""Of 165 frames `check` reads 121."""
RED, PIVOT = (190, 30, 35), (160.0, 20.0)
BALLS = {
    "large": (RED, 14.0, PIVOT, 160.0),
    "small": (RED, 6.0, PIVOT, 160.0),
    "short": (RED, 10.0, PIVOT, 80.0),
    "pale": ((190, 120, 120), 10.0, PIVOT, 160.0),
}
"""A ball of several sizes, lengths and colours."""
THINGS = {name: Thing("ball", ball, tuple(SWING_DEG), f"{name}.avi") for name, ball in BALLS.items()}
IN_SWEEP = ("small", "short", "pale")


@pytest.fixture(scope="module")
def predicted(films):
    """Return a function that predicts what measuring one of `THINGS` gives, once for each."""

    def predict(name):
        path = films.film(THINGS[name])
        if name == "large":
            return check_clip(path)
        with pytest.MonkeyPatch.context() as patch:  # sizes take most of the time, and are asserted of one film
            patch.setattr("anglecam.workflow.check.smallest_sizes", lambda *_: ())
            return check_clip(path)

    return cache(predict)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.sweep if name in IN_SWEEP else ()) for name in THINGS]
)
def test_sigma_of_the_whole_film_is_predicted(films, predicted, name):
    series = films.measured(THINGS[name]).series
    ok, found = series.ok, predicted(name)
    achieved = float(np.sqrt(np.mean(series.sigma[ok] ** 2)))
    assert 1.0 / LIKE < found.whole.sigma / achieved < LIKE
    error = (series.angle - np.radians(SWING_DEG))[ok]
    assert np.std(error) < 2.0 * found.whole.sigma
    assert found.frames_read == 121
    assert found.frames_read <= MOST


def test_the_terms_combine_to_the_sigma_that_measure_states(films, predicted):
    found = predicted("large")
    series = measure_source(open_source(films.film(THINGS["large"]), frames=(0, 120))).series
    assert found.part.sigma == pytest.approx(float(np.sqrt(np.mean(series.sigma[series.ok] ** 2))), rel=0.02)


@pytest.mark.parametrize("name", ["small", pytest.param("short", marks=pytest.mark.sweep)])
def test_a_small_mark_and_a_short_lever_scatter_more(predicted, name):
    assert predicted(name).whole.scatter > predicted("large").whole.scatter


def test_a_pale_mark_is_advised_more_contrast(predicted):
    assert predicted("pale").contrast_grey < 0.7 * predicted("large").contrast_grey
    advised = {one.change: one for one in predicted("pale").advice}
    assert 0.0 < advised["contrast"].sigma_factor < 1.0
    assert "contrast" in advised
    assert "codec" not in advised  # FFV1 loses nothing


def test_a_larger_mark_brings_about_what_is_advised(predicted):
    # from a radius of 6 px to 14 px: more than twice the diameter
    advised = next(one for one in predicted("small").advice if one.change == "larger_mark")
    achieved = predicted("large").whole.noise / predicted("small").whole.noise
    assert advised.sigma_factor == pytest.approx(math.sqrt(0.5), abs=0.05)
    assert 0.5 * advised.sigma_factor < achieved < 1.5 * advised.sigma_factor


def test_sizes_are_those_of_a_swing(predicted):
    sizes = predicted("large").sizes
    assert sizes is not None
    frequency = math.sqrt(sizes.parameters[1]) / (2.0 * math.pi)
    assert frequency == pytest.approx(0.8, rel=0.01)
    ids = {one.effect.id for one in sizes.smallest}
    assert {"coulomb_friction", "quadratic_drag"} <= ids
    assert "dead_time" not in ids  # a free swing has no command


@pytest.fixture
def status(monkeypatch, capsys):
    """Return a function that calls anglecam as a user does and gives (exit status, output, standard error)."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["anglecam", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            cli.main()
        said = capsys.readouterr()
        return int(left.value.code or 0), said.out, said.err

    return call


def test_the_command_prints_tables_and_writes_its_file(films, tmp_path, status):
    command = tmp_path / "steps.csv"
    command.write_text("time_s,command_deg\n0,0\n1,10\n2.3,-10\n3.7,5\n5,0\n")
    code, said, err = status("check", films.film(THINGS["small"]), "--command", command, "--out", tmp_path)
    assert code == 0, err
    for words in ("sigma of a frame", "what would help", "dead_time", "a mark of twice the diameter"):
        assert words in said
    found = json.loads((tmp_path / "small.check.json").read_text())
    assert found["read"]["frames"] == 121
    low, high = found["sigma_deg"]["whole_interval_90"]
    assert low < found["sigma_deg"]["whole"] < high
    whole = math.sqrt(sum(term**2 for term in found["terms_deg"].values()))
    assert whole == pytest.approx(found["sigma_deg"]["whole"])
    delay = next(one for one in found["smallest"] if one["id"] == "dead_time")
    assert delay["unit"] == "s"
    assert 0.0 < delay["smallest"] < 0.1
    assert found["session"]["duration_s"] == pytest.approx(6.0)
    assert all(one["sigma_factor"] > 0.0 for one in found["advice"])


def test_a_clip_in_which_nothing_turns_is_one_line_that_says_what_would_mend_it(tmp_path, status):
    still = things.film(tmp_path / "still.avi", things.ball((190, 30, 35), 10.0), np.zeros(70))
    code, _, err = status("check", still)
    assert code == 1
    assert len(err.strip().splitlines()) == 1
    assert "still.avi" in err
    assert "rig.yaml" in err or "--from" in err


def test_measure_refuses_a_clip_in_the_words_of_check(tmp_path, status):
    places = np.linspace(-60.0, 60.0, 70)

    def on_a_rail(scene, angle):
        things.disc(scene, (160.0 + np.degrees(angle), 120.0), 10.0, (40, 60, 160))

    cart = things.film(tmp_path / "cart.avi", on_a_rail, places)
    (code, _, checked), (other, _, measured) = status("check", cart), status("measure", cart, "--out", tmp_path / "out")
    assert code == other == 1
    assert checked == measured
    assert "rig.yaml" in checked or "--from" in checked


def test_no_advice_on_filming_is_given_for_a_file_that_cannot_be_read(films, monkeypatch):
    def lost(film, rig, command, progress, every_body):
        raise InputError("large.avi: Input/output error") from OSError(5, "Input/output error")

    monkeypatch.setattr("anglecam.workflow.clip.measure_clip", lost)
    with pytest.raises(InputError, match=r"^large\.avi: Input/output error$"):
        check_clip(films.film(THINGS["large"]))


def test_a_file_that_is_no_film_is_one_line(tmp_path, status):
    (tmp_path / "no.avi").write_text("no film")
    code, _, err = status("check", tmp_path / "no.avi")
    assert code == 1
    assert len(err.strip().splitlines()) == 1
