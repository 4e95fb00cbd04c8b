"""The report in a browser: one cursor through angle, residual and film, on a wide and on a narrow screen."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from anglecam.data.series import AngleSeries
from anglecam.loop.verdict_json import verdict_as_dict
from anglecam.report.page import write_report
from support.browser import Watched, chromium

BITS, HEIGHT, WIDTH = 14, 48, 14 * 8


def numbered(k):
    """Return a picture that shows a number in binary, as bright bars."""
    bars = [(k >> bit & 1) * 200 + 20 for bit in range(BITS)]
    return np.repeat(np.repeat(np.array(bars, np.uint8), WIDTH // BITS)[None], HEIGHT, axis=0)[..., None].repeat(3, 2)


def number_in(source):
    """Read the number back from the data URI of a picture."""
    raw = np.frombuffer(base64.b64decode(source.partition(",")[2]), np.uint8)
    bars = cv2.imdecode(raw, cv2.IMREAD_GRAYSCALE).mean(axis=0).reshape(BITS, -1).mean(axis=1) > 120
    return sum(int(on) << bit for bit, on in enumerate(bars))


def film_of(picture):
    """Return a film whose k-th frame is ``picture(k)``."""
    return SimpleNamespace(frames=lambda only: (SimpleNamespace(index=k, image=picture(k)) for k in sorted(only)))


def filmed(record, first_frame=0):
    """Return a record as a series that was measured in a film."""
    n = len(record.time)
    pivot = np.tile([30.0, 24.0], (n, 1))
    mark = pivot + 40.0 * np.column_stack([np.cos(record.angle), -np.sin(record.angle)])
    bounds = {r: np.full(n, np.arcsin(r / 40.0)) for r in (6.0, 10.0)}
    return AngleSeries(
        record.name, record.time, record.angle, np.full(n, 1e-3), ("ok",) * n,
        record.angle, mark, pivot, bounds, first_frame=first_frame,
    )  # fmt: skip


@pytest.fixture(scope="module")
def verdict(dragged):
    return dragged


@pytest.fixture(scope="module")
def report(verdict, tmp_path_factory):
    """Return the report of recordings; the first begins with frame 7 of its film."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    series = [filmed(r, first_frame=7 if k == 0 else 0) for k, r in enumerate(verdict.fitted)]
    films = {s.name: film_of(numbered) for s in series[:-1]}
    write_report(path, "rig", verdict, verdict_as_dict(verdict), None, series, [], [], films=films)
    return path


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


@pytest.fixture
def opened(browser, report):
    watched = Watched(browser, report)
    yield watched
    watched.page.close()


def shown_picture(page, recording=0):
    """Return the frame number of the picture that is shown, and the number that it shows."""
    picture = page.locator(f'section.recording[data-recording="{recording}"] .picture.shown')
    return int(picture.get_attribute("data-frame")), number_in(picture.locator("image").get_attribute("href"))


def place_of(page, figure, time, span):
    """Return the place in the window of a time in a diagram."""
    box = figure.locator(".u-over").bounding_box()
    return box["x"] + box["width"] * (time - span[0]) / (span[1] - span[0]), box["y"] + box["height"] / 2


def cursor_times(page, recording):
    """Return the time at the cursor of every visible diagram of a recording, as the legends state it."""
    shown = page.locator(f'.curve.live[data-recording="{recording}"] .legend li:first-child b')
    return [text for text in shown.all_inner_texts() if text]


def test_the_cursor_moves_through_all_curves_and_the_slider(opened, verdict):
    page, time = opened.page, verdict.fitted[0].time
    figure = page.locator('section.recording[data-recording="0"] .curve[data-plot="angle"]')
    figure.scroll_into_view_if_needed()
    row = len(time) // 3
    page.mouse.move(*place_of(page, figure, time[row], (time[0], time[-1])))
    times = cursor_times(page, 0)
    assert len(times) == 6  # angle, residual; prediction; residual; error, and on a finer scale
    assert len(set(times)) == 1
    assert float(times[0].split()[0]) == pytest.approx(time[row], abs=2.0 * verdict.fitted[0].interval)
    slider = page.locator('section.recording[data-recording="0"] input[type=range]')
    assert abs(int(slider.input_value()) - row) <= 2
    slider.focus()
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    assert set(cursor_times(page, 0)) == {f"{time[1]:.3f} s"}
    assert slider.get_attribute("aria-valuetext").startswith(f"frame {7 + 1}, {time[1]:.3f} s, ")


def test_a_click_on_the_largest_residual_shows_its_frame(opened, verdict):
    page, record = opened.page, verdict.fitted[0]
    row = int(np.argmax(np.abs(verdict.before.residuals[0])))
    figure = page.locator('.curve[data-plot="residual"][data-recording="0"]')
    figure.scroll_into_view_if_needed()
    page.mouse.move(5, 5)
    page.mouse.click(*place_of(page, figure, record.time[row], (record.time[0], record.time[-1])))
    frame, pictured = shown_picture(page)
    assert frame == pictured + 7
    assert abs(pictured - row) <= 1  # a pixel of the diagram is less than two frames
    picture = page.locator('section.recording[data-recording="0"] .picture.shown')
    assert picture.locator("circle.bound").count() == 2
    mark = [float(picture.locator(".line").get_attribute(name)) for name in ("x2", "y2")]
    expected = 30.0 + 40.0 * np.cos(record.angle[pictured]), 24.0 - 40.0 * np.sin(record.angle[pictured])
    assert mark == pytest.approx(expected, abs=0.01)
    assert page.locator(".film.docked").count() == 1  # the film was out of view, so that it came along
    page.locator(".undock:visible").click()
    assert page.locator(".film.docked").count() == 0


def test_the_picture_next_to_the_cursor_says_how_far_away_it_is(opened):
    page = opened.page
    section = page.locator('section.recording[data-recording="0"]')
    rows = [int(p.get_attribute("data-row")) for p in section.locator(".picture").all()]
    k = int(np.argmax(np.diff(rows)))
    assert rows[k + 1] - rows[k] >= 3, "every frame has a picture"
    section.locator("input[type=range]").evaluate(
        "(slider, row) => { slider.value = row; slider.dispatchEvent(new Event('input')); }", rows[k] + 1
    )
    assert shown_picture(page) == (7 + rows[k], rows[k])
    assert section.locator(".away").inner_text() == (
        f"The cursor is at frame {7 + rows[k] + 1}; the nearest picture is 1 earlier."
    )


def test_worst_case_bounds_are_drawn_on_demand_only(opened):
    page = opened.page
    entry = page.locator('section.recording[data-recording="0"] .legend li', has_text="mark off by 6 px")
    assert entry.is_hidden()
    page.locator("#bounds").check()
    assert entry.is_visible()
    page.locator("#recording").select_option(index=1)
    assert page.locator('section.recording[data-recording="1"] .legend li', has_text="mark off by 6 px").is_visible()


def test_a_recording_without_a_film_has_curves_and_no_pictures(opened, verdict):
    page, last = opened.page, len(verdict.fitted) - 1
    page.locator("#recording").select_option(index=last)
    section = page.locator(f'section.recording[data-recording="{last}"]')
    assert section.locator(".uplot").count() == 2
    assert section.locator(".film").is_hidden()


@pytest.mark.parametrize("width", [pytest.param(1280, marks=pytest.mark.sweep), 390])
def test_nothing_is_asked_of_the_network_and_nothing_lies_beside_the_screen(browser, report, width):
    watched = Watched(browser, report, width)
    assert watched.overflow() == 0
    watched.page.locator("#recording").select_option(index=1)
    watched.page.locator("#bounds").check()
    assert watched.overflow() == 0
    assert watched.said == []
    assert watched.foreign() == []
    watched.page.close()


def test_the_page_is_complete_without_scripts(browser, report, verdict):
    context = browser.new_context(java_script_enabled=False, viewport={"width": 390, "height": 900})
    page = context.new_page()
    page.goto(report.as_uri())
    assert page.evaluate("document.scrollingElement.scrollWidth") <= 390
    assert page.locator(".drawn svg:visible").count() >= 4 * len(verdict.fitted)
    assert page.locator(".picture.chosen:visible").count() > 0
    assert page.locator(".controls:visible").count() == 0
    context.close()


def test_a_report_of_ten_thousand_frames_is_small(verdict, tmp_path):
    n = 10_000
    rng = np.random.default_rng(1)
    time = np.arange(n) / 30.0
    record = replace(verdict.fitted[0], time=time, angle=0.2 * np.sin(2.0 * time), sigma=np.full(n, 1e-3))
    residual = rng.normal(0.0, 1e-3, n)
    before = replace(verdict.before, residuals=(residual,))
    predicted = replace(verdict.before_held_out, records=(record,), residuals=(residual,))
    long = replace(
        verdict, verdict="nothing_missing", accepted=(), fitted=(record,), before=before, after=before,
        before_held_out=predicted, after_held_out=predicted,
    )  # fmt: skip
    film = film_of(lambda k: rng.integers(0, 255, (480, 640, 3), np.uint8))  # nothing compresses worse
    path = tmp_path / "report.html"
    result = verdict_as_dict(verdict) | {"effects": []}
    write_report(path, "long", long, result, None, [filmed(record)], [], [], films={record.name: film})
    assert len(re.findall('<li class="picture', path.read_text())) == 60
    assert path.stat().st_size < 15e6
