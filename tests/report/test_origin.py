"""A page states the hashes of its inputs, and a date only where a run has one."""

from __future__ import annotations

import hashlib

from anglecam.report.origin import Run, now, origin_of


def test_inputs_are_named_with_the_hash_that_sha256sum_prints(tmp_path):
    clip = tmp_path / "swing.avi"
    clip.write_bytes(b"film")
    (tmp_path / "not fetched again.avi").touch()
    made = origin_of([clip, clip, tmp_path / "missing.yaml", tmp_path / "not fetched again.avi"])
    assert [(i.name, i.size, i.sha256) for i in made.inputs] == [("swing.avi", 4, hashlib.sha256(b"film").hexdigest())]


def test_a_folder_of_pictures_has_the_hash_of_the_list_of_its_files(tmp_path):
    folder = tmp_path / "film"
    folder.mkdir()
    for k in (2, 1):
        (folder / f"{k}.png").write_bytes(bytes([k]))
    listed = "".join(f"{hashlib.sha256(bytes([k])).hexdigest()}  {k}.png\n" for k in (1, 2))
    (found,) = origin_of([folder]).inputs
    assert (found.name, found.size, found.sha256) == ("film/", 2, hashlib.sha256(listed.encode()).hexdigest())


def test_a_run_has_a_date_which_source_date_epoch_sets_and_a_batch_has_none(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    made = origin_of([], Run("anglecam measure a.avi", now()))
    assert (made.date, made.command) == ("1970-01-02T00:00:00+00:00", "anglecam measure a.avi")
    assert (origin_of([]).date, origin_of([]).command) == (None, None)
