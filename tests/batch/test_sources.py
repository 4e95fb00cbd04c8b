"""From the arguments of a call to clips and their output paths."""

from __future__ import annotations

from pathlib import Path

import fsspec
import pytest

from anglecam.batch.output_paths import assign_clip_paths, assign_session_folders
from anglecam.batch.session_job import find_sessions
from anglecam.batch.sources import Source, find_sources
from anglecam.errors import RigError


def touch(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return folder


def names(folder, sources):
    return [source.address.removeprefix(f"{folder}/") for source in sources]


def test_a_folder_is_searched_with_all_folders_below_it_except_hidden_files_and_the_output_folder(tmp_path):
    touch(tmp_path, "b.avi", "a.MP4", "deep/er/c.mkv", "notes.txt", "._b.avi", ".trash/d.avi", "out/e.overlay.mp4")
    found, _, problems = find_sources([str(tmp_path)], tmp_path / "out")
    assert names(tmp_path, found) == ["a.MP4", "b.avi", "deep/er/c.mkv"]
    assert [source.below_root for source in found] == ["", "", "deep/er"]
    assert not problems


def test_globs_lists_and_single_clips_are_expanded(tmp_path):
    touch(tmp_path, "mon/a.avi", "tue/a.avi", "tue/b.avi", "odd[1].avi", "weird name.mov")
    (tmp_path / "list.txt").write_text(f"# the good ones\n{tmp_path}/tue\n\n{tmp_path}/weird name.mov\n")
    for asked, expected in [
        ("*/a.avi", ["mon/a.avi", "tue/a.avi"]),
        ("t?e", ["tue/a.avi", "tue/b.avi"]),
        ("**/b.avi", ["tue/b.avi"]),
        ("odd[1].avi", ["odd[1].avi"]),
    ]:
        found, _, problems = find_sources([str(tmp_path / asked)], tmp_path / "out")
        assert names(tmp_path, found) == expected
        assert not problems
    found, *_ = find_sources([f"@{tmp_path}/list.txt", str(tmp_path / "tue/a.avi")], tmp_path / "out")
    assert names(tmp_path, found) == ["tue/a.avi", "tue/b.avi", "weird name.mov"]
    assert (
        find_sources([f"file://{tmp_path}/mon"], tmp_path / "out")[0]
        == find_sources([str(tmp_path / "mon")], tmp_path / "out")[0]
    )


def test_a_missing_folder_is_an_error_of_the_call_and_an_empty_one_a_problem(tmp_path):
    for asked in (str(tmp_path / "nowhere"), f"@{tmp_path}/no-list.txt", "nonsense://lab/clips"):
        with pytest.raises(RigError, match=r"no such folder|cannot be read|no protocol"):
            find_sources([asked], tmp_path / "out")
    *_, problems = find_sources([str(tmp_path)], tmp_path / "out")
    assert [str(p) for p in problems] == [f"{tmp_path}: no clip in this folder"]


def test_clips_in_a_store_are_found_as_in_a_folder():
    store = fsspec.filesystem("memory")
    inside = "found-here"
    for name in ("b.avi", "a.avi", "deep/c.mp4", ".hidden/d.avi", "notes.txt"):
        store.pipe(f"/{inside}/{name}", b"x")
    root = f"memory://{inside}"
    found, *_ = find_sources([root], Path("/nowhere"))
    assert [s.address for s in found] == [f"{root}/a.avi", f"{root}/b.avi", f"{root}/deep/c.mp4"]
    assert [s.below_root for s in found] == ["", "", "deep"]
    globbed, *_ = find_sources([f"{root}/*/c.mp4"], Path("/nowhere"))
    assert globbed == [Source(f"{root}/deep/c.mp4", root)]
    store.rm(f"/{inside}", recursive=True)


def test_no_two_clips_share_an_output_path_and_the_first_keeps_its_path():
    sources = [
        Source("/lab/mon/a.avi", "/lab/mon"),
        Source("/lab/mon/a.mp4", "/lab/mon"),
        Source("/lab/mon/sub/b.avi", "/lab/mon"),
        Source("/lab/tue/a.avi", "/lab/tue"),
        Source("/other/tue/a.avi", "/other/tue"),
    ]
    places = assign_clip_paths(sources)
    assert places["/lab/mon/a.avi"] == "a"
    assert places["/lab/mon/a.mp4"] == "a.mp4"
    assert places["/lab/mon/sub/b.avi"] == "sub/b"
    assert places["/lab/tue/a.avi"] == "tue/a"
    assert len(set(places.values())) == len(sources)
    fewer = assign_clip_paths([sources[0], sources[3]])
    assert fewer["/lab/tue/a.avi"] == places["/lab/tue/a.avi"]  # other clips make no difference


def test_an_output_path_of_an_earlier_batch_is_not_assigned_again():
    assert assign_clip_paths([Source("/lab/tue/a.avi", "/lab/tue")], {"a": "/lab/mon/a.avi"}) == {
        "/lab/tue/a.avi": "tue/a"
    }


def test_no_output_path_leads_out_of_the_output_folder():
    odd = ["s3://bucket/lab/../../../etc/a.avi", "s3://bucket/lab/./b.avi", "s3://bucket/lab//c.avi"]
    places = assign_clip_paths([Source(address, "s3://bucket/lab") for address in odd])
    for place in places.values():
        assert not place.startswith("/")
        assert not {".", "..", ""} & set(place.split("/"))


def test_a_session_is_a_folder_with_commands_all_of_whose_clips_are_in_the_batch(tmp_path):
    touch(tmp_path, "s/a.avi", "s/b.avi", "s/a.command.csv", "plain/c.avi", "orphan/d.avi", "orphan/x.command.csv")
    found, *_ = find_sources([str(tmp_path)], tmp_path / "out")
    assert [(s[0], s[2]) for s in find_sessions(found)] == [
        (f"{tmp_path}/s", (f"{tmp_path}/s/a.avi", f"{tmp_path}/s/b.avi"))
    ]
    part, *_ = find_sources([str(tmp_path / "s/a.avi")], tmp_path / "out")
    assert not find_sessions(part)
    assert assign_session_folders([("/x/mon", "/x/mon"), ("/x/tue", "/x/tue")]) == {"/x/mon": "", "/x/tue": "tue"}
