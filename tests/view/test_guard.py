"""Nobody but the person at this machine gets an answer, and no file outside the opened folder leaves it."""

from __future__ import annotations

from pathlib import Path

import pytest
from starlette.testclient import TestClient

from anglecam.errors import RigError
from anglecam.view.folder import open_folder
from anglecam.view.serve import application
from support.tiny import tiny_clip

PORT, TOKEN = 4711, "secret"
HOST = f"http://127.0.0.1:{PORT}"
HEADER = {"x-anglecam-token": TOKEN}
ROUTES = ["/", "/static/view.js", "/api/folder", "/api/clips/0", "/api/clips/0/frames/0.png", "/api/rig"]


@pytest.fixture
def stranger(lab: Path) -> TestClient:
    """Return a browser that does not know the token."""
    return TestClient(application(open_folder(lab), PORT, TOKEN), base_url=HOST, follow_redirects=False)


@pytest.mark.parametrize("path", ROUTES)
def test_without_the_token_everything_is_refused(stranger: TestClient, path: str) -> None:
    assert stranger.get(path).status_code == 403
    assert stranger.get(path, headers={"x-anglecam-token": "guess"}).status_code == 403
    assert stranger.get(path, params={"token": "guess"}).status_code == 403


@pytest.mark.parametrize("path", ROUTES)
def test_another_host_name_is_refused_even_with_the_token(stranger: TestClient, path: str) -> None:
    for host in ("evil.example:4711", "127.0.0.1", "127.0.0.1:80", "localhost.evil.example:4711"):
        assert stranger.get(path, headers=HEADER | {"host": host}).status_code == 403
    assert stranger.get(path, headers=HEADER | {"host": "localhost:4711"}).status_code == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:8888", "null", "https://127.0.0.1:4711"])
def test_another_page_is_refused_even_with_the_token(stranger: TestClient, lab: Path, origin: str) -> None:
    before = (lab / "rig.yaml").read_bytes()
    answer = stranger.put("/api/rig", headers=HEADER | {"origin": origin}, json={"sections": {"facing": "right"}})
    assert answer.status_code == 403
    assert (lab / "rig.yaml").read_bytes() == before
    assert stranger.get("/api/rig", headers=HEADER | {"origin": HOST}).status_code == 200


def test_the_printed_address_gives_a_cookie_that_scripts_and_other_sites_do_not_get(stranger: TestClient) -> None:
    entry = stranger.get("/", params={"token": TOKEN})
    assert (entry.status_code, entry.headers["location"]) == (303, "/")
    cookie = entry.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    page = stranger.get("/")
    assert page.status_code == 200
    assert "default-src 'none'" in page.headers["content-security-policy"]
    assert page.headers["cross-origin-resource-policy"] == "same-origin"


@pytest.mark.parametrize(
    "path",
    [
        "/static/../src/view.ts",
        "/static/..%2f..%2fpackage.json",
        "/static/%2e%2e/package.json",
        "/static//etc/passwd",
        "/result/../rig.yaml",
        "/result/..%2frig.yaml",
        "/result/report.html",
        "/api/clips/2",
        "/api/clips/-1",
        "/api/clips/..%2f0",
        "/api/clips/0/frames/8.png",
        "/api/clips/0/frames/0.yaml",
        "/api/clips/0/frames/0/model.png",
        "/rig.yaml",
    ],
)
def test_there_is_nothing_outside_the_list(page: TestClient, path: str) -> None:
    assert page.get(path).status_code == 404


def test_a_link_out_of_the_folder_is_not_followed(page: TestClient, lab: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    tiny_clip(outside / "other.avi", 3)
    (outside / "report.html").write_text("secret")
    (outside / "rig.yaml").write_text("facing: left\n")
    (lab / "linked.avi").symlink_to(outside / "other.avi")
    assert [clip.name for clip in open_folder(lab).clips] == ["nod.avi", "swing.avi"]
    # links that are made while the page is open
    (lab / "nod.avi").unlink()
    (lab / "nod.avi").symlink_to(outside / "other.avi")
    (lab / "result").symlink_to(outside)
    (lab / "rig.yaml").unlink()
    (lab / "rig.yaml").symlink_to(outside / "rig.yaml")
    for path in ("/api/clips/0", "/api/clips/0/frames/0.png", "/result/report.html", "/api/rig", "/api/folder"):
        answer = page.get(path)
        assert answer.status_code == 422, path
        assert "a link leads out" in answer.json()["problem"]
    assert page.post("/api/jobs", json={"kind": "measure", "clip": 1}).status_code == 422


def test_a_clip_alone_shows_no_other(lab: Path) -> None:
    folder = open_folder(lab / "swing.avi")
    assert [clip.name for clip in folder.clips] == ["swing.avi"]
    assert not folder.is_session


def test_what_cannot_be_opened_is_one_line(tmp_path: Path) -> None:
    for path, cause in ((tmp_path / "none", "no such file"), (tmp_path, "no clip")):
        with pytest.raises(RigError, match=cause):
            open_folder(path)
