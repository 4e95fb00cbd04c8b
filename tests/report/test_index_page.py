"""The index of a batch as a page: links to what exists, sorted by number and filtered by words."""

from __future__ import annotations

from dataclasses import asdict
from html import unescape

import pytest

from anglecam.batch.row import Row
from anglecam.report.index_page import index_html
from anglecam.report.page_names import page_name
from support.browser import Watched, chromium


def row(name, **more):
    return asdict(Row(f"/lab/mon/{name}.avi", series=f"mon/{name}.angles.csv", status="ok", **more))


ROWS = [
    row("a", share_measured=1.0, median_sigma_deg=0.01, frames=9, width_px=64, height_px=48),
    row("b <i>#", share_measured=0.25, median_sigma_deg=0.002, frames=100, width_px=64, height_px=48),
    row("c", share_measured=0.5, median_sigma_deg=0.2, frames=20, model="mon/model.json", verdict="nothing_missing"),
    asdict(Row("/lab/tue/d.avi", cause="no mouth found")),
]


@pytest.fixture(scope="module")
def index(tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    (folder / "mon").mkdir()
    for name in ("a.html", "b <i>#.html", "report.html"):
        (folder / "mon" / name).write_text("page")
    (folder / "index.html").write_text(index_html(ROWS, folder))
    return folder / "index.html"


def test_what_exists_is_linked_and_names_are_text(index):
    text = index.read_text()
    assert 'href="mon/a.html"' in text
    assert 'href="mon/b%20%3Ci%3E%23.html"' in text
    assert 'href="mon/report.html">nothing missing' in text
    assert "c.html" not in text
    assert "<i>#" not in text
    assert "b <i>#.avi" in unescape(text)


def test_a_page_of_a_clip_does_not_replace_another_page():
    assert {page_name(name) for name in ("index", "report")}.isdisjoint({"index.html", "report.html"})


def test_rows_are_sorted_by_number_and_filtered_by_words_and_status(index):
    with chromium() as browser:
        watched = Watched(browser, index)
        page = watched.page

        def names():
            return [text.partition(".")[0][:1] for text in page.locator("tbody tr:visible th").all_inner_texts()]

        page.get_by_role("button", name="frames").click()
        assert names() == ["a", "c", "b", "d"]  # 9, 20, 100, none
        page.get_by_role("button", name="frames").click()
        assert names() == ["b", "c", "a", "d"]
        page.get_by_role("button", name="median σ, °").click()
        assert names() == ["b", "a", "c", "d"]
        page.locator("#words").fill("mouth tue")
        assert names() == ["d"]
        assert page.locator("#count").inner_text() == "1 of 4 clips"
        page.locator("#words").fill("")
        page.locator("#status").select_option("ok")
        assert names() == ["b", "a", "c"]
        page.set_viewport_size({"width": 390, "height": 800})
        assert watched.overflow() == 0
        assert (watched.said, watched.foreign()) == ([], [])
