"""A folder with two tiny clips and a rig file, as the page opens it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from anglecam.view.folder import open_folder
from anglecam.view.serve import application
from support.tiny import tiny_clip

PORT, TOKEN = 4711, "secret"


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = tmp_path / "lab"
    for seed, name in enumerate(("nod.avi", "swing.avi")):
        tiny_clip(folder / name, seed)
    (folder / "rig.yaml").write_text(
        "# of the laboratory\nfacing: left\nleast_measured: 0.25\nheld_out: [swing]\npivot: {marker: ring}\n"
    )
    return folder


@pytest.fixture
def open_page() -> Callable[[Path], TestClient]:
    """Return what opens a folder as the page does, with the token in a header."""

    def opened(path: Path) -> TestClient:
        app = application(open_folder(path), PORT, TOKEN)
        return TestClient(app, base_url=f"http://127.0.0.1:{PORT}", headers={"x-anglecam-token": TOKEN})

    return opened


@pytest.fixture
def page(lab: Path, open_page: Callable[[Path], TestClient]) -> TestClient:
    """Return the server of the tiny lab."""
    return open_page(lab)
