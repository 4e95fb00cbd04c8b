"""The budget's page and file agree, and Fig. 8 shows the worst positions in a frame of the user's clip."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from functools import partial
from html import unescape

import numpy as np
import pytest
from rich.console import Console

from anglecam.budget.gum import Comparison, propagate
from anglecam.io.command_csv import read_command
from anglecam.io.rig import read_rig
from anglecam.measurement.clip import measure_clip
from anglecam.report.budget_page import budget_table, stated, write_budget, write_page
from anglecam.report.figure8 import touching_point
from anglecam.video.open_film import open_film
from support.browser import Watched, chromium
from support.drawn import Look, Recording, draw_session

TRIALS = 100_000
"""Of the Monte Carlo, which `tests/budget` tests in full: up to four million would take most of the time here."""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("nod <b>")
    clips = [Recording("stairs", "stairs", duration_s=1.5, amplitude_deg=12.0)]
    truth = draw_session(
        folder, look=Look(), recordings=clips, seed=4, mouth="declared", rig={"pixel_error_px": [6, 10, 3]}
    )["stairs"]
    rig, command = read_rig(folder / "rig.yaml"), read_command(folder / "stairs.command.csv")
    measured = measure_clip(open_film(truth.clip), rig, command)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("anglecam.budget.clip.propagate", partial(propagate, most=TRIALS))
        budget = write_budget(open_film(truth.clip), measured, rig, folder / "out")
    return budget, measured, folder / "out"


def test_the_file_states_every_term_with_its_unit(written):
    _, measured, out = written
    content = json.loads((out / "stairs.budget.json").read_text())
    for name in ("typical", "worst"):
        frame = content[name]
        joined = math.sqrt(sum(t["contribution_deg"] ** 2 for t in frame["terms"]))
        assert joined == pytest.approx(frame["combined_deg"])
        assert frame["sigma_deg"] == pytest.approx(math.degrees(measured.series.sigma[frame["frame"]]), rel=1e-6)
        assert frame["expanded_deg"] == pytest.approx(frame["coverage_factor"] * frame["combined_deg"])
        assert sum(t["share"] for t in frame["terms"]) == pytest.approx(1.0)
        for t in frame["terms"]:
            assert t["contribution_deg"] == pytest.approx(abs(t["sensitivity"]) * t["standard_uncertainty"])
            assert t["sensitivity_unit"] == f"°/{t['unit']}"
    assert content["lever_px"] == pytest.approx(Look().lever_px, abs=1.0)
    assert [b["radius_px"] for b in content["bounds"]] == [3.0, 6.0, 10.0]
    assert [round(p["implied_lever_px"]) for p in content["paper"]] == [1228, 843]
    assert content["rms"]["sigma_deg"] <= content["worst"]["sigma_deg"]


def test_the_page_holds_the_numbers_and_the_figures(written):
    budget, _, out = written
    text = (out / "stairs.budget.html").read_text()
    page = unescape(text)
    assert page.partition("<script")[0].count("<svg") == 2 + 2 + 1  # over the clip, distributions, Fig. 8
    assert page.count("data:image/png;base64") >= 6  # the six panels
    assert "http://" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "")
    assert "src=" not in page
    assert f"{math.degrees(budget.bounds[-1].worst):.3f}" in page
    assert "0.408°" in page
    for term in budget.terms_over_time:
        assert term.name in page
    read = re.sub(r"data:image/[^\"]+", "", page)  # encoded pictures contain every short word
    assert "None" not in read
    assert "nan" not in read.replace("provenance", "")


@pytest.mark.parametrize("width", [pytest.param(1280, marks=pytest.mark.sweep), 390])
def test_no_table_is_cut(written, width):
    _, _, out = written
    with chromium() as browser:
        watched = Watched(browser, out / "stairs.budget.html", width)
        tables = "[...document.querySelectorAll('main .scroll')].map(e => e.scrollWidth - e.clientWidth)"
        assert watched.page.evaluate(tables) == [0] * watched.page.locator("main table").count()
        assert watched.overflow() == 0


def test_the_table_shows_terms_bounds_and_expanded_uncertainty(written):
    budget, _, _ = written
    console = Console(width=160, record=True, file=None)
    with console.capture() as capture:
        console.print(budget_table(budget))
    shown = capture.get()
    assert stated(budget.typical) in shown
    for name in (budget.terms_over_time[0].name, "pivot", "expanded, 95 %", "6 px, worst case", "10 px, standard"):
        assert name in shown


def test_page_and_table_state_one_interval_and_by_monte_carlo_if_the_linear_budget_is_not_validated(written, tmp_path):
    budget, _, _ = written
    drawn = replace(budget.typical.drawn, low=budget.typical.angle_deg - 0.46, high=budget.typical.angle_deg + 0.43)
    skewed = replace(budget.typical, drawn=drawn, comparison=Comparison(tolerance=0.005, low=0.02, high=0.01))
    budget = replace(budget, typical=skewed)
    write_page(tmp_path / "b.html", budget, None)
    page = (tmp_path / "b.html").read_text()
    console = Console(width=160, record=True, file=None)
    with console.capture() as capture:
        console.print(budget_table(budget))
    for shown in (page, capture.get()):
        assert stated(skewed) in shown
        assert "the linear budget is not validated" in shown
        assert re.search(r"−0\.460* … \+0\.430*", shown)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_worst_position_lies_on_the_circle_and_turns_the_line_by_the_bound(side):
    pivot, mouth = np.array([240.0, 300.0]), np.array([420.0, 260.0])
    end = touching_point(pivot, mouth, 10.0, side)
    assert np.hypot(*(end - mouth)) == pytest.approx(10.0)
    (ax, ay), (bx, by) = mouth - pivot, end - pivot
    turned = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    assert turned == pytest.approx(side * math.asin(10.0 / np.hypot(ax, ay)))
