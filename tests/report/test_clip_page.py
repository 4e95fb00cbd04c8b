"""The page of a measured clip: its film, its numbers, and nothing that depends on when it was made."""

from __future__ import annotations

import shutil
from html import unescape

import matplotlib.pyplot as plt
import numpy as np
import pytest

from anglecam.data.series import AngleSeries
from anglecam.report.clip_page import write_thumbnail
from anglecam.report.figures import angle_panel, plot_series
from anglecam.report.origin import Run
from anglecam.workflow.clip import measure_source, open_source, write_clip_page, write_measurement
from support.browser import Watched, chromium
from support.films import SWING


@pytest.fixture(scope="module")
def measured(films, tmp_path_factory):
    folder = tmp_path_factory.mktemp("film")
    shutil.copy(films.film(SWING), folder)
    (folder / "rig.yaml").write_text(f"mouth: {{rgb: {list(SWING.look.lips_rgb)}}}\n")
    (folder / "swing.command.csv").write_text("time_s,command_deg\n0,0\n0.5,4\n")
    source = open_source(folder / "swing.avi")
    return source, measure_source(source)


def write(measured, out, run=None):
    source, measurement = measured
    write_clip_page(source, measurement, write_measurement(measurement, source.command, out), out, run)
    return out / "swing.html"


def test_the_page_has_pictures_numbers_and_the_origin(measured, tmp_path):
    _, measurement = measured
    page = unescape(
        write(measured, tmp_path, Run("anglecam measure swing.avi", "2026-11-25T10:00:00+00:00")).read_text()
    )
    assert page.count('<li class="picture') == len(measurement.series.time)  # a short film is shown whole
    assert "turning point" in page
    assert "the command changes" in page
    assert f"measured in {measurement.series.ok.sum()} of 45 frames" in page
    assert "2026-11-25 10:00:00 UTC" in page
    for name in ("swing.avi", "swing.command.csv"):
        assert f'<th scope="row">{name}</th>' in page


def test_the_page_draws_velocity_and_acceleration_and_states_the_common_part_as_a_scale(measured, tmp_path):
    series, page = measured[1].series, unescape(write(measured, tmp_path).read_text())
    for name, unit in (("velocity", "°/s"), ("acceleration", "°/s²")):
        assert f'data-plot="{name}"' in page
        assert f"{name}, {unit}" in page
    assert f"the amplitude could be off by {100.0 * series.common_share:.2g} %" in page


def test_equal_inputs_give_equal_pages_where_no_date_is_stated(measured, tmp_path):
    pages = [write(measured, tmp_path / name).read_bytes() for name in ("once", "again")]
    assert pages[0] == pages[1]


def test_the_page_works_on_a_narrow_screen(measured, tmp_path):
    path = write(measured, tmp_path)
    with chromium() as browser:
        watched = Watched(browser, path, 390)
        assert watched.overflow() == 0
        watched.page.get_by_label("Next frame of swing").click()
        assert watched.page.locator(".picture.shown").get_attribute("data-frame") == "1"
        whole = watched.page.locator(".picture.shown svg").get_attribute("viewBox")
        watched.page.get_by_label("magnify the mark").check()
        assert float(watched.page.locator(".picture.shown svg").get_attribute("viewBox").split()[2]) < float(
            whole.split()[2]
        )
        assert (watched.said, watched.foreign()) == ([], [])


def test_a_thumbnail_is_small(measured, tmp_path):
    source, measurement = measured
    write_thumbnail(tmp_path, measurement, source.film)
    assert 200 < (tmp_path / "swing.thumb.webp").stat().st_size < 20_000
    write_thumbnail(tmp_path / "nowhere", measurement, None)  # tracks without their clip have none


@pytest.mark.parametrize(
    "draw", [lambda series, path: plot_series(series, path), lambda series, path: angle_panel(series)]
)
def test_the_angle_is_shaded_with_what_is_known_and_not_with_the_worst_case(tmp_path, monkeypatch, draw):
    n, half = 30, []
    bounds = {6.0: np.full(n, 0.05), 10.0: np.full(n, 0.1)}
    series = AngleSeries("a", np.arange(n) / 30, np.zeros(n), np.full(n, 1e-3), ("ok",) * n, bounds=bounds)
    real = plt.Axes.fill_between

    def noted(axes, x, low, high, **how):
        half.append((np.ptp([low, high]) / 2.0, how["label"]))
        return real(axes, x, low, high, **how)

    monkeypatch.setattr(plt.Axes, "fill_between", noted)
    draw(series, tmp_path / "a.png")
    assert half == [(pytest.approx(1.96 * np.degrees(1e-3)), "95 % interval (1.96 σ)")]
