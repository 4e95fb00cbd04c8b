"""The server's answers: exact frames, the stages as measuring computes them, the rig file, jobs."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient

from anglecam.io.rig import read_rig
from anglecam.io.series_csv import read_series, write_series
from anglecam.io.session import rig_beside
from anglecam.measurement.mark_pass import seek_mark
from anglecam.video.open_film import open_film
from anglecam.vision.mark.segment import LARGEST_SHARE, SMALLEST_SHARE, find_regions
from anglecam.workflow.clip import measure_source, open_source
from support.encoded import encode
from support.tiny import FRAMES


def _decoded(content: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)


def _ended(page: TestClient, job: int) -> dict[str, Any]:
    """Wait for a job."""
    until = time.monotonic() + 300.0
    while time.monotonic() < until:
        state = page.get(f"/api/jobs/{job}").json()
        if state["status"] != "running":
            return state
        time.sleep(0.1)
    raise TimeoutError(state)


def test_frame_n_is_the_one_that_pyav_decodes_as_its_nth(open_page: Callable[[Path], TestClient], lab: Path) -> None:
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 255, (64, 96, 3), np.uint8), (0, 0), 2.0)
    options = {"g": "10", "bf": "3", "sc_threshold": "0"}
    encode(lab / "nod.mp4", (np.roll(wall, k, axis=1) for k in range(30)), options=options)
    (lab / "nod.avi").unlink()
    with av.open(str(lab / "nod.mp4")) as container:
        frames = list(container.decode(video=0))
    opened = open_page(lab)
    described = opened.get("/api/clips/0").json()
    assert len(described["times"]) == len(frames) == 30
    for number in (29, 0, 15, 14, 3):
        shown = _decoded(opened.get(f"/api/clips/0/frames/{number}.png").content)
        np.testing.assert_array_equal(shown, frames[number].to_ndarray(format="bgr24"))
        assert described["times"][number] == pytest.approx(frames[number].time, abs=1e-9)
        quick = _decoded(opened.get(f"/api/clips/0/frames/{number}.jpg").content)
        assert np.abs(quick.astype(int) - shown).mean() < 6.0


def test_the_stages_are_those_of_measuring(page: TestClient, lab: Path) -> None:
    learnt = page.post("/api/clips/0/mark", json={"sections": {}}).json()
    film = open_film(lab / "nod.avi")
    mark = seek_mark(film, rig_beside(lab))
    assert tuple(learnt["rgb"]) == mark.model.mean_rgb
    image = list(film.frames())[5].image
    assert image is not None
    areas = SMALLEST_SHARE * mark.area_px2, LARGEST_SHARE * mark.area_px2
    regions = find_regions(image, mark.model, areas, mark.opening_px)
    found = page.get("/api/clips/0/frames/5/found", params={"mark": learnt["key"]}).json()
    assert found["status"] == "ok"
    chosen = found["regions"][0]
    assert chosen["mark"]
    assert chosen["centre_px"] in [region.centre_px.tolist() for region in regions]

    def stage(name: str) -> np.ndarray:
        return _decoded(page.get(f"/api/clips/0/frames/5/{name}.png", params={"mark": learnt["key"]}).content)

    np.testing.assert_array_equal(stage("fraction"), mark.model.fraction_map(image))
    threshold, edges, fill = stage("threshold"), stage("edges"), stage("fill")
    assert set(np.unique(threshold)) == set(np.unique(edges)) == set(np.unique(fill)) == {0, 255}
    outline = np.array(chosen["outline_px"])
    inside = cv2.drawContours(np.zeros_like(fill), [outline.reshape(-1, 1, 2)], -1, 255, cv2.FILLED)
    assert (fill[inside > 0] == 255).all()
    assert (fill >= edges).all()
    x, y = np.round(chosen["centre_px"]).astype(int)
    assert threshold[y, x] == 255


def test_the_mark_is_learnt_again_when_the_settings_change(page: TestClient) -> None:
    first = page.post("/api/clips/0/mark", json={"sections": {}}).json()["key"]
    assert page.post("/api/clips/0/mark", json={"sections": {}}).json()["key"] == first
    green = page.post("/api/clips/0/mark", json={"sections": {"mark": {"rgb": [0, 250, 0]}}})
    assert green.status_code == 200
    assert "no mark found" in green.json()["none"]
    assert page.get("/api/clips/0/frames/0/found", params={"mark": "other"}).status_code == 422


def test_saving_keeps_every_key_that_was_there(page: TestClient, lab: Path) -> None:
    rig = page.get("/api/rig").json()
    assert rig["has_comments"]
    change = {"mark": {"at": [12.3, 45.6], "frame": 2}, "neutral": -3.5, "frames": {"from": 1, "to": 6}}
    saved = page.put("/api/rig", json={"sections": change, "version": rig["version"]})
    assert saved.status_code == 200
    declared = read_rig(lab / "rig.yaml")
    assert declared.mouth.at == (12.3, 45.6)
    assert (declared.neutral, declared.frames.first, declared.frames.last) == (-3.5, 1, 6)
    assert (declared.facing, declared.least_measured, declared.held_out) == ("left", 0.25, ("swing",))
    assert declared.pivot.marker == "ring"
    assert not saved.json()["has_comments"]
    again = page.put("/api/rig", json={"sections": {"neutral": None}, "version": saved.json()["version"]})
    assert "neutral" not in again.json()["sections"]
    assert read_rig(lab / "rig.yaml").frames.last == 6


def test_mouth_and_mark_stay_one_key(page: TestClient, lab: Path) -> None:
    (lab / "rig.yaml").write_text("mouth: {rgb: [190, 35, 40]}\n")
    rig = page.get("/api/rig").json()
    assert rig["sections"] == {"mark": {"rgb": [190, 35, 40]}}
    page.put("/api/rig", json={"sections": {"mark": {"box": [1, 2, 30, 40], "frame": 0}}, "version": rig["version"]})
    assert read_rig(lab / "rig.yaml").mouth.box == (1, 2, 30, 40)


@pytest.mark.parametrize(
    ("sections", "cause"),
    [
        ({"mark": {"at": [1, 2], "rgb": [1, 2, 3]}}, "declare only one"),
        ({"frames": {"from": 9, "to": 3}}, "comes before"),
        ({"pivot": {"at": [1, 2], "near": [1, 2]}}, "declare only one"),
        ({"facing": "up"}, "facing"),
        ({"camera": {"calibration": "/etc/passwd"}}, "cannot be changed here"),
        ({"colour": "red"}, "cannot be changed here"),
    ],
)
def test_what_is_not_valid_is_not_saved(page: TestClient, lab: Path, sections: dict, cause: str) -> None:
    before, version = (lab / "rig.yaml").read_bytes(), page.get("/api/rig").json()["version"]
    answer = page.put("/api/rig", json={"sections": sections, "version": version})
    assert answer.status_code == 422
    assert cause in answer.json()["problem"]
    assert (lab / "rig.yaml").read_bytes() == before


def test_a_file_that_was_edited_meanwhile_is_not_overwritten(page: TestClient, lab: Path) -> None:
    version = page.get("/api/rig").json()["version"]
    (lab / "rig.yaml").write_text("facing: right\n")
    answer = page.put("/api/rig", json={"sections": {"neutral": 1.0}, "version": version})
    assert "another program has changed it" in answer.json()["problem"]
    assert (lab / "rig.yaml").read_text() == "facing: right\n"


def test_a_job_measures_as_the_command_line_does(page: TestClient, lab: Path, tmp_path: Path) -> None:
    assert page.get("/api/clips/0/series").json() is None
    job = page.post("/api/jobs", json={"kind": "measure", "clip": 0}).json()
    assert page.post("/api/jobs", json={"kind": "measure", "clip": 1}).status_code == 422  # one at a time
    state = _ended(page, job["id"])
    assert state["status"] == "done", state
    assert state["done"] == state["total"] == FRAMES
    write_series(measure_source(open_source(lab / "nod.avi")).series, tmp_path / "nod.angles.csv")
    written = lab / "result" / "nod.angles.csv"
    assert written.read_bytes() == (tmp_path / "nod.angles.csv").read_bytes()
    series, expected = page.get("/api/clips/0/series").json(), read_series(written)
    np.testing.assert_allclose(series["angle_deg"], np.degrees(expected.angle))
    assert series["status"] == list(expected.status)
    assert series["outdated"] == []
    assert page.get("/api/folder").json()["clips"][0]["measured"]


def test_a_job_that_fails_says_why_in_one_line(page: TestClient, lab: Path) -> None:
    (lab / "nod.avi").write_text("no film")
    state = _ended(page, page.post("/api/jobs", json={"kind": "measure", "clip": 0}).json()["id"])
    assert state["status"] == "failed"
    assert "nod.avi: not a readable video file" in state["problem"]


def test_a_cancelled_job_ends_and_leaves_nothing_unfinished(page: TestClient, lab: Path) -> None:
    job = page.post("/api/jobs", json={"kind": "close"}).json()["id"]
    state = page.delete(f"/api/jobs/{job}").json()
    assert state["status"] == "cancelled"
    assert _ended(page, job)["status"] == "cancelled"
    results = lab / "result"
    assert not results.exists() or [p.name for p in results.iterdir() if p.name.startswith(".")] == []
    follower = page.post("/api/jobs", json={"kind": "measure", "clip": 1}).json()
    assert _ended(page, follower["id"])["status"] == "done"


def test_without_a_rig_file_everything_works_and_saving_makes_one(page: TestClient, lab: Path) -> None:
    (lab / "rig.yaml").unlink()
    assert page.get("/api/rig").json() == {"sections": {}, "version": "", "has_comments": False}
    assert page.get("/api/clips/0/series").json() is None
    assert page.post("/api/clips/0/mark", json={"sections": {}}).status_code == 200
    state = _ended(page, page.post("/api/jobs", json={"kind": "measure", "clip": 0}).json()["id"])
    assert state["status"] == "done", state
    assert len(page.get("/api/clips/0/series").json()["angle_deg"]) == FRAMES
    saved = page.put("/api/rig", json={"sections": {"neutral": 2.5}, "version": ""})
    assert saved.json()["sections"] == {"neutral": 2.5}
    assert read_rig(lab / "rig.yaml").neutral == 2.5


def test_a_wrong_rig_file_is_one_line_and_frames_are_still_seen(page: TestClient, lab: Path) -> None:
    (lab / "rig.yaml").write_text("colour: red\n")
    assert "unknown key colour" in page.get("/api/rig").json()["problem"]
    assert page.get("/api/clips/0/frames/0.png").status_code == 200
