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

pytestmark = pytest.mark.sweep  # links and examples of the pages are checked in `tests/test_docs.py`
ROOT = Path(__file__).parents[1]
OFFLINE = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
"""A proxy that nobody answers at."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))
        for name, proxy in OFFLINE.items():
            patch.setenv(name, proxy)
        done = subprocess.run(
            [sys.executable, ROOT / "docs" / "build_site.py", out], capture_output=True, text=True, check=False
        )
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
