"""The page for each verdict: it holds the sentence, the figures and the numbers of ``loop.json``."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from anglecam.data.command import Command
from anglecam.data.series import AngleSeries
from anglecam.effects import effect
from anglecam.effects.unit_names import split_unit
from anglecam.identification.identify_records import identify_records
from anglecam.identification.output_error import fit_output_error
from anglecam.io.command_csv import read_command
from anglecam.io.rig import Rig
from anglecam.loop.next_experiment.design import Experiment
from anglecam.loop.verdict import Accepted
from anglecam.loop.verdict_json import next_experiment, verdict_as_dict, write_next_command
from anglecam.report import page
from anglecam.report.page import p_in_words, validation_in_words, write_report
from anglecam.report.session_tables import model_table
from anglecam.report.wording import sentence


@pytest.fixture(scope="module")
def model(dragged):
    """Return the base model of the same recordings."""
    return identify_records(dragged.fitted, Rig(), "oe2")


@pytest.fixture
def write(model, tmp_path):
    """Return a function that writes the page of a verdict on those recordings and returns its text."""

    def page(found, experiment=None, problems=(), models=(model,)):
        series = [AngleSeries(r.name, r.time, r.angle, r.sigma, ("ok",) * len(r.time)) for r in found.fitted]
        path = tmp_path / "report.html"
        result = verdict_as_dict(found, experiment)
        write_report(path, "a <b> & c", found, result, experiment, series, models, problems)
        return path.read_text()

    return page


def labels_of_figures(page):
    """Return what each figure of a page shows."""
    return Counter(label.partition(":")[0] for label in re.findall(r'<figure[^>]* aria-label="([^"]*)"', page))


@pytest.mark.parametrize("verdict", ["nothing_missing", "unexplained"])
def test_the_page_states_the_verdict(write, dragged, verdict):
    found = replace(dragged, verdict=verdict, accepted=(), after=dragged.before, after_held_out=dragged.before_held_out)
    text = write(found)
    page = unescape(text)
    figures = labels_of_figures(page)
    assert [figures[f"{what} of {r.name} over time"] for r in found.fitted for what in ("Angle", "Residual")] == [1] * 6
    assert figures["Residual"] == figures["Prediction error"] == len(found.fitted)
    assert figures["Residual torque"] == (4 if verdict == "unexplained" else 0)
    assert figures["The effect as fitted"] == 0
    assert f"{np.degrees(found.before_held_out.rmse):.4f}" in page
    assert sentence(found) in page
    assert "No further recording is needed" not in page
    assert ("The best candidate is" in page) == (verdict == "unexplained")
    assert ("This recording would show whether it acts" in page) == (verdict == "unexplained")
    assert ("Detectable effects" in page) == (verdict == "nothing_missing")
    assert "a <b> & c" in page
    assert "a <b>" not in text  # a session's name is text, not markup


def test_a_filter_that_did_not_settle_has_one_wording_on_page_and_terminal(write, dragged, model):
    unsettled = replace(model, settled=False, covariance=np.full_like(model.covariance, np.nan))
    page = unescape(write(dragged, models=[unsettled]))
    assert page.count(unsettled.no_uncertainty) == 1
    assert "did not settle" in unsettled.no_uncertainty
    assert f'<td data-label="a, 1/s">{unsettled.values[0]:.4g}</td>' in page
    assert unsettled.no_uncertainty in unsettled.doubts[0]
    console = Console(width=160, file=None)
    with console.capture() as capture:
        console.print(model_table([unsettled]))
    assert capture.get().count("no uncertainty") == len(unsettled.names)
    assert model.no_uncertainty == ""
    assert "no uncertainty" not in unescape(write(dragged))


def test_what_is_held_out_is_named(dragged):
    text = validation_in_words(replace(dragged, held_out=dragged.fitted[-1:]))
    name = dragged.fitted[-1].name
    assert text == f"These recordings are declared as held out; they were predicted and never fitted: {name}."


def test_without_held_out_recordings_the_page_names_block_cross_validation(write, dragged):
    page = unescape(write(dragged, problems=[ValueError("swing.avi: no mouth")]))
    assert sentence(dragged) in page
    left_out = 0.3 * 2.0 * np.pi / np.sqrt(dragged.before.parameters[1])
    assert f"blocks of {left_out:.2g} s, one in every {5.0 * left_out:.2g} s, were predicted by a model" in page
    figures = labels_of_figures(page)
    assert figures["The effect as fitted"] == 1
    assert figures["Prediction error"] == 2 * len(dragged.fitted)  # before and after, and after on a finer scale
    assert "swing.avi: no mouth" in page
    assert re.search(r"− q·θ̇·\|θ̇\|</i> with q = [\d.]+ ± [\d.]+", page)
    assert "No further recording is needed to distinguish this effect from others." in page
    for record in dragged.fitted:
        assert f"<figcaption>{record.name}</figcaption>" in page


def test_every_candidate_has_a_prediction_error(dragged):
    result = verdict_as_dict(dragged)
    assert len(result["candidates"]) == len(dragged.candidates)
    assert all(np.isfinite(c["held_out_rmse_deg"]) for c in result["candidates"])
    untried = [c for c, one in zip(result["candidates"], dragged.candidates, strict=True) if one.held_out is None]
    assert all(c["held_out_rmse_deg"] > result["rmse_deg"]["after"]["held_out"] for c in untried)


def test_rivals_are_named_with_the_command_to_play_next(write, dragged):
    (found,) = dragged.accepted
    plant = dragged.before.model.with_effect(effect("dead_time"))
    start = np.append(dragged.before.parameters, 0.01)
    rival = fit_output_error(plant, dragged.fitted, [start], phi=dragged.after.phi)
    doubted = replace(dragged, accepted=(Accepted(found.effect, {"dead_time": rival}),))
    command = Command(np.array([0.0, 0.5, 2.0]), np.radians([0.0, 10.0, 0.0]))
    pair = ("quadratic_drag", "dead_time")
    experiment = Experiment(command, "one step to 10° and back", 4.0, {pair: 5.0})
    page = unescape(write(doubted, experiment))
    assert "(or dead time, which these recordings cannot distinguish from it)" in sentence(doubted)
    assert "Record this next:</b> one step to 10° and back, 4 s in all" in page
    assert "next.command.csv" in page
    assert labels_of_figures(page)["The next experiment"] == 2
    (stated,) = verdict_as_dict(doubted, experiment)["effects"]
    assert stated["alias_set"] == list(pair)
    assert stated["separating_experiment"].startswith(found.effect.separating_experiment)
    assert stated["separating_experiment"].endswith("one step to 10° and back, 4 s (next.command.csv)")
    # no command is named if none separates them
    helpless = replace(experiment, separations={pair: 1.0})
    assert verdict_as_dict(doubted, helpless)["effects"][0]["separating_experiment"] == (
        found.effect.separating_experiment
    )


def test_a_command_that_separates_nothing_is_not_written_and_an_old_one_is_deleted(tmp_path):
    command = Command(np.array([0.0, 0.5]), np.radians([0.0, 10.0]))
    telling = Experiment(command, "one step", 4.0, {("backlash", "dead_zone"): 5.0})
    write_next_command(telling, tmp_path)
    read = read_command(tmp_path / "next.command.csv")
    assert read.angle == pytest.approx(command.angle)
    for other in (replace(telling, separations={("backlash", "dead_zone"): 1.0}), replace(telling, command=None), None):
        write_next_command(telling, tmp_path)
        write_next_command(other, tmp_path)
        assert not (tmp_path / "next.command.csv").exists()


def test_no_experiment_is_proposed_without_rivals(dragged):
    assert all(not a.rivals for a in dragged.accepted)
    assert next_experiment(dragged) is None


def test_a_camera_effect_is_attributed_to_the_camera_and_not_to_the_mechanism(dragged):
    found = replace(dragged, accepted=(Accepted(effect("angle_drift"), {}),))
    assert "an effect of the camera and not of the mechanism" in sentence(found)
    assert "camera" not in sentence(dragged)


@pytest.mark.parametrize(
    ("name", "parted"),
    [
        ("half_width_deg", ("half width", "deg")),
        ("friction_deg_per_s2", ("friction", "deg/s2")),
        ("q_per_rad", ("q", "1/rad")),
        ("row_time_s", ("row time", "s")),
        ("shortening", ("shortening", "")),
    ],
)
def test_a_parameters_name_is_split_from_its_unit(name, parted):
    assert split_unit(name) == parted


@pytest.mark.parametrize(
    ("p", "words"), [(0.0, "at most 1 of 1000"), (0.004, "4 of 1000"), (0.03, "3 of 100"), (0.3, "3 of 10")]
)
def test_a_p_value_is_stated_as_a_number_of_sessions(p, words):
    assert p_in_words(p) == words


@pytest.mark.parametrize(("sigma_deg", "text"), [(np.nan, "1.2346"), (0.0, "1.2346"), (0.0002, "1.23457")])
def test_degrees_have_the_digits_that_the_noise_leaves_meaning(sigma_deg, text):
    verdict = SimpleNamespace(noise=SimpleNamespace(sigma=np.radians(sigma_deg)))
    assert page._degrees_filter(verdict)(1.2345678) == text
