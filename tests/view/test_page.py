"""The page as a person uses it, in Chromium: scrub, point, drag, save, measure, click on the curve."""

from __future__ import annotations

import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import uvicorn
from playwright.sync_api import Browser, Page, expect, sync_playwright

from anglecam.camera.lens import lens_from_rig
from anglecam.cli.app import main
from anglecam.io.rig import read_rig
from anglecam.io.series_csv import read_series, write_series
from anglecam.measurement.mark_pass import seek_mark
from anglecam.video.open_film import open_film
from anglecam.view.folder import open_folder
from anglecam.view.serve import application
from anglecam.view.stages import LearntMark, found_in
from anglecam.workflow.clip import measure_source, open_source
from support.tiny import FRAMES, SIZE

CHROMIUM = shutil.which("chromium")
QUIET = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
PATIENCE_MS = 60_000
TOKEN = "secret"
COMMAND = [sys.executable, "-c", "from anglecam.cli.app import main; main()", "view"]

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        yield browser
        browser.close()


@pytest.fixture
def address(lab: Path) -> Iterator[str]:
    """Serve the folder from a thread of this process until the test ends."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        config = uvicorn.Config(application(open_folder(lab), port, TOKEN), log_level="critical")
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        yield f"http://127.0.0.1:{port}/?token={TOKEN}"
        server.should_exit = True
        thread.join()


@pytest.fixture
def address_of_command(lab: Path) -> Iterator[str]:
    """Run the command until the test ends; Ctrl-C ends it without a trace."""
    run = subprocess.Popen([*COMMAND, str(lab), "--no-browser"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.stdout is not None
    found = re.search(r"http://127\.0\.0\.1:\d+/\?token=\S+", run.stdout.readline().decode())
    assert found is not None
    yield found[0]
    run.send_signal(signal.SIGINT)
    _, complaints = run.communicate(timeout=60)
    assert (run.returncode, complaints) == (0, b"")


@pytest.fixture
def page(browser: Browser, address: str) -> Iterator[Page]:
    """Open the page."""
    with _opened(browser, address) as page:
        yield page


@contextmanager
def _opened(browser: Browser, address: str) -> Iterator[Page]:
    """Open the page; nothing may be complained of, and no request may leave the machine."""
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.set_default_timeout(PATIENCE_MS)
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type != "log" else None)
    page.on("pageerror", lambda fault: complaints.append(str(fault)))
    home = address.split("/?")[0]
    page.on("request", lambda r: None if r.url.startswith((home, "blob:")) else complaints.append(r.url))
    page.goto(address)
    _expect_frame(page, 0)
    yield page
    page.close()
    assert complaints == []


def _expect_frame(page: Page, number: int) -> None:
    expect(page.locator(f"#picture[data-frame='{number}']")).to_be_visible(timeout=PATIENCE_MS)
    expect(page.locator("#frame-number")).to_have_text(f"frame {number} of {FRAMES - 1}")


def _on_screen(page: Page, at: tuple[float, float]) -> tuple[float, float]:
    """Return where the whole picture shows a place (px) on the screen."""
    box = page.locator("#picture").bounding_box()
    assert box is not None
    scale = min(box["width"] / SIZE[0], box["height"] / SIZE[1])
    left, top = (box["width"] - SIZE[0] * scale) / 2, (box["height"] - SIZE[1] * scale) / 2
    return box["x"] + left + (at[0] + 0.5) * scale, box["y"] + top + (at[1] + 0.5) * scale


def _place_of_mark(clip: Path, number: int) -> tuple[float, float]:
    film = open_film(clip)
    image = list(film.frames())[number].image
    assert image is not None
    rig = read_rig(clip.with_name("rig.yaml"))
    mark = LearntMark(seek_mark(film, rig), lens_from_rig(rig, film.size, clip))
    x, y = found_in(image, mark)["regions"][0]["centre_px"]
    return x, y


def test_the_command_shows_the_page(browser: Browser, address_of_command: str) -> None:
    with _opened(browser, address_of_command) as page:
        assert "token" not in page.url


def test_frames_are_stepped_and_scrubbed(page: Page) -> None:
    assert "token" not in page.url
    page.keyboard.press("ArrowRight")
    _expect_frame(page, 1)
    page.keyboard.press("End")
    _expect_frame(page, FRAMES - 1)
    page.get_by_role("button", name="Previous frame").click()
    _expect_frame(page, FRAMES - 2)
    page.keyboard.press("Shift+ArrowLeft")
    _expect_frame(page, 0)
    slider = page.get_by_role("slider", name="Frame")
    box = slider.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    expect(page.locator("#frame-number")).to_have_text(re.compile(r"frame [34] of 7"))


def test_what_is_clicked_dragged_and_saved_measures_as_the_command_line_does(
    page: Page, lab: Path, tmp_path: Path
) -> None:
    at = _place_of_mark(lab / "nod.avi", 1)
    page.keyboard.press("ArrowRight")
    page.get_by_role("group", name="Mark").get_by_role("button", name="Point at it").click()
    x, y = _on_screen(page, at)
    page.mouse.move(x - 40, y + 25)
    expect(page.locator("#magnifier")).to_be_visible()
    page.mouse.click(x - 40, y + 25)
    expect(page.locator("#magnifier")).to_be_hidden()
    wrong = float(page.get_by_label("Mark x, px").input_value())
    page.mouse.move(x - 40, y + 25)
    page.mouse.down()
    page.mouse.move(x, y, steps=4)
    page.mouse.up()
    placed = [float(page.get_by_label(f"Mark {axis}, px").input_value()) for axis in "xy"]
    assert wrong < placed[0] - 2.0
    np.testing.assert_allclose(placed, at, atol=0.3)
    page.get_by_label("Mark y, px").fill(f"{at[1]:.1f}")
    page.get_by_label("Mark y, px").press("Enter")
    page.get_by_label("Last frame").fill("6")
    page.get_by_label("Last frame").press("Tab")
    expect(page.get_by_text("Saving removes the comments")).to_be_visible()
    page.get_by_role("button", name="Save rig.yaml").click()
    expect(page.locator("#message")).to_have_text("rig.yaml is saved.")

    declared = read_rig(lab / "rig.yaml")
    assert declared.mouth.frame == 1
    np.testing.assert_allclose(declared.mouth.at, at, atol=0.3)
    assert (declared.frames.first, declared.frames.last) == (None, 6)
    assert (declared.facing, declared.least_measured, declared.held_out) == ("left", 0.25, ("swing",))

    page.get_by_role("button", name="Measure", exact=True).click()
    expect(page.locator("#curve canvas")).to_be_visible(timeout=5 * PATIENCE_MS)
    out = tmp_path / "nod.angles.csv"
    write_series(measure_source(open_source(lab / "nod.avi")).series, out)
    assert (lab / "result" / "nod.angles.csv").read_bytes() == out.read_bytes()
    expect(page.locator("#frame-angle")).to_have_text(re.compile(r"^-?\d+\.\d+ ± \d+\.\d+°$"))

    line = read_series(out).line
    assert line is not None
    curve = page.locator("#curve .u-over")
    curve.scroll_into_view_if_needed()
    box = curve.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + box["width"] * 0.995, box["y"] + box["height"] / 2)
    _expect_frame(page, 6)
    page.get_by_role("button", name="This frame is zero").click()
    page.get_by_role("button", name="Save rig.yaml").click()
    expect(page.locator("#message")).to_have_text("rig.yaml is saved.")
    assert read_rig(lab / "rig.yaml").neutral == pytest.approx(np.degrees(line[6]), abs=1e-4)
    page.get_by_label("worst-case bounds").check()
    expect(page.locator("#frame-angle")).to_contain_text("worst case")


def test_the_stages_are_seen_on_any_frame(page: Page) -> None:
    page.get_by_label("found").check()
    expect(page.locator("#learnt")).to_contain_text("in this frame: ok", timeout=5 * PATIENCE_MS)
    for stage in ("colour", "threshold", "Canny", "fill"):
        page.get_by_role("radio", name=stage).check()
        with page.expect_response(re.compile(r"/frames/\d+/\w+\.png\?mark=")) as answer:
            page.get_by_role("button", name="Next frame").click()
        assert answer.value.ok
    page.get_by_role("group", name="Mark").get_by_label("Colour of the mark").fill("#00fa00")
    expect(page.locator("#learnt")).to_contain_text("no mark found", timeout=5 * PATIENCE_MS)


def test_pivot_lamp_and_box_are_declared(page: Page, lab: Path) -> None:
    pivot = page.get_by_role("group", name="Pivot")
    pivot.get_by_role("button", name="Exactly here").click()
    page.mouse.click(*_on_screen(page, (40.0, 70.0)))
    page.get_by_role("group", name="Lamp").get_by_role("button", name="Point at it").click()
    page.mouse.click(*_on_screen(page, (150.0, 10.0)))
    page.get_by_role("button", name="Draw a box").click()
    page.mouse.move(*_on_screen(page, (100.0, 90.0)))
    page.mouse.down()
    page.mouse.move(*_on_screen(page, (130.0, 60.0)), steps=3)
    page.mouse.up()
    page.get_by_role("button", name="Save rig.yaml").click()
    expect(page.locator("#message")).to_have_text("rig.yaml is saved.")
    declared = read_rig(lab / "rig.yaml")
    np.testing.assert_allclose(declared.pivot.at, (40.0, 70.0), atol=0.3)
    assert (declared.pivot.marker, declared.pivot.sigma_px) == ("ring", 1.0)
    np.testing.assert_allclose(declared.sync.lamp, (150.0, 10.0), atol=0.3)
    np.testing.assert_allclose(declared.mouth.box, (100.0, 60.0, 130.0, 90.0), atol=0.3)


def test_everything_has_a_name_and_fits_a_narrow_screen(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    nameless = page.evaluate(
        """[...document.querySelectorAll('button, input, select')].filter(e => !e.closest('[hidden]') &&
        !(e.ariaLabel || e.textContent.trim() || e.labels?.length)).map(e => e.outerHTML)"""
    )
    assert nameless == []


def test_a_taken_port_is_one_line(
    address: str, lab: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    port = re.search(r":(\d+)/", address)
    assert port is not None
    monkeypatch.setattr(sys, "argv", ["anglecam", "view", str(lab), "--no-browser", "--port", port[1]])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capfd.readouterr()
    assert (ended.value.code, said.out) == (2, "")
    assert said.err == f"--port {port[1]}: Address already in use\n"
