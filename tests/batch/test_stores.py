"""Clips in an object store: the same results as from a folder."""

from __future__ import annotations

import fsspec
import numpy as np
import pytest

from anglecam.batch.run import Options
from anglecam.camera.calibration import Calibration, write_calibration
from anglecam.errors import RigError
from support.measured_here import run_batch
from support.tiny import results, tiny_lab

QUIET = Options(jobs=2, quiet=True)


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Return three clips, one of them with a rig file, a calibration and a command."""
    folder = tiny_lab(tmp_path_factory.mktemp("lab"), ["a.avi", "mon/b.avi", "tue/c.avi"])
    (folder / "tue" / "rig.yaml").write_text("facing: left\ncamera: {calibration: lens/camera.yaml}\n")
    (folder / "tue" / "lens").mkdir()
    calibration = Calibration(
        None, np.array([[400.0, 0.0, 79.5], [0.0, 400.0, 59.5], [0.0, 0.0, 1.0]]), np.array([-0.05, 0, 0, 0])
    )
    write_calibration(calibration, folder / "tue" / "lens" / "camera.yaml")
    (folder / "mon" / "empty.mp4").touch()
    return folder


@pytest.fixture(scope="module")
def from_folder(lab, tmp_path_factory):
    out = tmp_path_factory.mktemp("folder")
    run_batch([str(lab)], out, QUIET)
    return results(out)


def same_but_for_addresses(found, folder, address, expected):
    """Compare results; the paths in the index are rewritten first."""
    assert found.keys() == expected.keys()
    tables = {
        name: found[name].replace(address.encode(), str(folder).encode()) for name in ("index.csv", "index.parquet")
    }
    page = {"index.html": expected["index.html"]}  # states the addresses in several forms
    assert found | tables | page == expected


def test_clips_in_memory_give_the_same_results_as_clips_in_a_folder(lab, from_folder, tmp_path):
    fsspec.filesystem("memory").put(str(lab), "/lab", recursive=True)
    result = run_batch(["memory://lab"], tmp_path, QUIET)
    assert [str(p) for p in result.problems] == ["memory://lab/mon/empty.mp4: empty file"]
    same_but_for_addresses(results(tmp_path), lab, "memory://lab", from_folder)
    with pytest.raises(RigError, match="Dask's workers cannot see"):
        run_batch(["memory://lab"], tmp_path, Options(jobs=1, quiet=True, dask="local"))


def test_clips_in_s3_give_the_results_of_clips_in_a_folder_and_are_fetched_once(
    lab, from_folder, tmp_path, monkeypatch
):
    pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server").ThreadedMotoServer("127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    try:
        store = fsspec.filesystem("s3")
        store.mkdir("lab")
        store.put(f"{lab}/", "lab/day", recursive=True)
        result = run_batch(["s3://lab/day"], tmp_path, QUIET)
        assert [str(p) for p in result.problems] == ["s3://lab/day/mon/empty.mp4: empty file"]
        same_but_for_addresses(results(tmp_path), lab, "s3://lab/day", from_folder)
        fetched = []
        monkeypatch.setattr("anglecam.batch.clip_job.fetch", lambda address, to: fetched.append(address))
        run_batch(["s3://lab/day"], tmp_path, QUIET)
        assert fetched == []  # by the store, no clip has changed
        monkeypatch.undo()
    finally:
        server.stop()


def test_a_clip_whose_store_does_not_answer_is_measured_by_the_next_batch(tmp_path, monkeypatch):
    tiny_lab(tmp_path / "lab", ["a.avi", "b.avi"])
    kind = type(fsspec.filesystem("memory"))
    fsspec.filesystem("memory").put(str(tmp_path / "lab"), "/moody", recursive=True)
    get_file = kind.get_file

    def refuse(store, path, *args, **kwargs):
        if path.endswith("a.avi"):
            raise RuntimeError("503: slow down\nand more")
        return get_file(store, path, *args, **kwargs)

    monkeypatch.setattr(kind, "get_file", refuse)
    result = run_batch(["memory://moody"], tmp_path / "out", QUIET)
    assert [str(p) for p in result.problems] == ["memory://moody/a.avi: cannot be read (503: slow down)"]
    monkeypatch.undo()
    assert not run_batch(["memory://moody"], tmp_path / "out", QUIET).problems
