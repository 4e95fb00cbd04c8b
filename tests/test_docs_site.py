"""The documentation site builds without a warning or the network, the notebook runs, and every link leads on."""

from __future__ import annotations

import re
import subprocess
import sys
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import pytest

from anglecam.effects import LEDGER

ROOT = Path(__file__).parents[1]
OFFLINE = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
"""A proxy that nobody answers at."""
GREY = """
import sys
from pathlib import Path

import build_site
from PIL import Image


def draw(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("stick", "stick-overlay", "step", "linkage", "gallery"):
        Image.new("L", (64, 48), 128).save(folder / f"{name}.png")


build_site.pictures.draw = draw
build_site.build(Path(sys.argv[1]))
"""
"""Builds the site without what takes half of the time."""


@pytest.fixture(scope="module", params=["drawn in advance", pytest.param("as a whole", marks=pytest.mark.sweep)])
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site, with grey pictures in place of those that the programs draw, or, in the sweep, as a whole."""
    out = tmp_path_factory.mktemp("site")
    program = [ROOT / "docs" / "build_site.py"] if request.param == "as a whole" else ["-c", GREY]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", f"{ROOT}:{ROOT / 'docs'}")
        for name, proxy in OFFLINE.items():
            patch.setenv(name, proxy)
        done = subprocess.run([sys.executable, *program, out], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return out / "site"


def test_every_page_is_there_with_its_title(site):
    pages = {path.relative_to(site).as_posix() for path in site.rglob("*.html")}
    effects = {f"effects/{effect.id}.html" for effect in LEDGER}
    sources = {
        path.relative_to(ROOT / "docs").with_suffix(".html").as_posix() for path in (ROOT / "docs").rglob("*.md")
    }
    assert effects | sources | {"tutorials/notebook.html", "reference/api.html", "reference/keys.html"} <= pages
    assert all("<h1" in (site / page).read_text() for page in effects | sources)


def test_no_page_fetches_anything_from_elsewhere(site):
    fetched = re.compile(r"""<(?:script|img|iframe|link)\b[^>]*?\b(?:src|href)=["']?(?:https?:)?//[^"'> ]+""")
    outside = [
        path.name
        for path in site.rglob("*.html")
        for hit in fetched.finditer(path.read_text())
        if "canonical" not in hit[0]
    ]
    assert outside == []


def test_every_link_and_picture_leads_to_a_file(site):
    missing = []
    for path in site.rglob("*.html"):
        for address in re.findall(r"""(?:href|src)=["']?([^"'> ]+)""", path.read_text()):
            target = unquote(unescape(address)).split("#")[0]
            if path.name == "404.html" or not target or re.match(r"[a-z]+:|//", target):
                continue
            if not (path.parent / target).exists():
                missing.append(f"{path.relative_to(site)}: {address}")
    assert missing == []


def test_the_notebook_was_executed(site):
    page = (site / "tutorials" / "notebook.html").read_text()
    assert "40 of 40" in page
    assert list((site / "tutorials").glob("notebook-*.png"))


def test_functions_and_types_are_documented(site):
    page = (site / "reference" / "api.html").read_text()
    assert all(f'id="anglecam.api.{name}"' in page for name in ("measure", "identify", "close_loop"))
