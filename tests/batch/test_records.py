"""Job records: a record only ever describes results that are in place, whatever interrupts the batch."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from dataclasses import replace

import pytest

from anglecam.batch.database import RecordDatabase
from anglecam.batch.lock import locked, start_run
from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.publish import finish, publish, recover
from anglecam.batch.records import ClipRecord, SessionRecord
from anglecam.batch.row import OK, Row
from anglecam.batch.run import Options
from anglecam.errors import RigError
from support.measured_here import run_batch
from support.tiny import results, tiny_lab

QUIET = Options(jobs=1, quiet=True)
CLIP = ClipRecord(
    os.fsdecode(b"/lab/not-utf8-\xff.avi"),
    Row("/lab/a.avi", size_bytes=3, rate_hz=29.97, status=OK),
    os.fsdecode(b"not-utf8-\xff"),
    {"size": 3, "content": 1_700_000_000_000_000_001, "inode": [7, 1_700_000_000_000_000_003]},
    True,
    {os.fsdecode(b"not-utf8-\xff.png"): 5},
)
SESSION = SessionRecord("/lab", "abc", "", cause="no model", problems=("a: bad", "b: bad"), wall_time_s=0.1)


@pytest.fixture
def folder(tmp_path):
    folder = OutputFolder(tmp_path / "out")
    folder.database_file.parent.mkdir(parents=True)
    return folder


def test_records_are_read_as_they_were_saved(folder):
    with RecordDatabase(folder.database_file) as database:
        assert database.read_all(ClipRecord) == []
        database.save(CLIP, SESSION)
        database.save(replace(CLIP, removed=True))
    with RecordDatabase(folder.database_file) as database:
        assert database.read_all(ClipRecord) == [replace(CLIP, removed=True)]
        assert database.read_all(SessionRecord) == [SESSION]
        database.delete(ClipRecord, CLIP.address)
        assert database.find(ClipRecord, CLIP.address) is None


def test_a_transaction_that_a_kill_interrupts_is_rolled_back(folder):
    with RecordDatabase(folder.database_file) as database:
        database.save(CLIP)
    script = """
import os, signal, sqlite3, sys
connection = sqlite3.connect(sys.argv[1], isolation_level=None)
connection.execute("PRAGMA journal_mode = TRUNCATE")
connection.execute("PRAGMA cache_size = 1")  # changed pages reach the file before the transaction ends
connection.execute("BEGIN")
connection.execute("UPDATE clips SET cause = 'changed'")
connection.executemany("INSERT INTO clips (address) VALUES (?)", [(bytes(500) + bytes([k]),) for k in range(200)])
os.kill(os.getpid(), signal.SIGKILL)
"""
    killed = subprocess.run([sys.executable, "-c", script, folder.database_file], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert folder.database_file.with_name("batch.sqlite-journal").stat().st_size > 0
    with RecordDatabase(folder.database_file) as database:
        assert database.read_all(ClipRecord) == [CLIP]


@pytest.mark.parametrize("damage", [b"not a database" * 1000, None])
def test_a_damaged_database_or_that_of_another_version_is_made_anew(folder, damage):
    with RecordDatabase(folder.database_file) as database:
        database.save(CLIP)
    if damage is None:
        with sqlite3.connect(folder.database_file) as connection:
            connection.execute("ALTER TABLE clips DROP COLUMN cause")
            connection.execute("PRAGMA user_version = 1")
        connection.close()
    else:
        folder.database_file.write_bytes(damage)
    with RecordDatabase(folder.database_file) as database:
        assert database.read_all(ClipRecord) == []
        database.save(CLIP)
        assert database.read_all(ClipRecord) == [CLIP]


def test_a_database_that_another_program_holds_is_named_in_one_line(folder, monkeypatch):
    monkeypatch.setattr("anglecam.batch.database._WAIT_S", 0.05)
    with RecordDatabase(folder.database_file) as database:
        database.save(CLIP)
    holder = sqlite3.connect(folder.database_file, isolation_level=None)
    holder.execute("BEGIN EXCLUSIVE")
    file = folder.database_file
    with (
        RecordDatabase(file) as database,
        pytest.raises(RigError, match=rf"^--out {folder.path}: {file} cannot be read \(database is locked\)$"),
    ):
        database.read_all(ClipRecord)
    holder.close()


def finished_clip(folder, run, content, before=None):
    """Return a finished job with one result, ``a.png``."""
    work = folder.unfinished(run) / content.decode()
    work.mkdir(parents=True)
    (work / "a.png").write_bytes(content)
    record = ClipRecord("/lab/a.avi", Row("/lab/a.avi", status=OK, wall_time_s=0.5), "a")
    return finish(record, {"a.png": work / "a.png"}, before, work, folder)


def test_results_that_cannot_be_recorded_leave_the_old_record_with_the_old_results(folder):
    with RecordDatabase(folder.database_file) as database:
        old = publish(finished_clip(folder, "one", b"old"), folder, database)
        database._connection.execute("PRAGMA query_only = ON")  # every write fails, as on a full disk
        new = publish(finished_clip(folder, "one", b"newer", old.record), folder, database)
        assert new.record == old.record
        assert new.trouble.cause.startswith("the results cannot be written (")
        assert database.read_all(ClipRecord) == [old.record]
    assert (folder.path / "a.png").read_bytes() == b"old"
    assert not list(folder.unfinished("one").iterdir())


class Killed(BaseException):
    """Stands for a kill."""


@pytest.mark.parametrize("instant", ["before", "after the old record is deleted", "after a result is moved"])
def test_a_publication_that_a_kill_interrupts_is_completed_by_the_next_batch(folder, monkeypatch, instant):
    with RecordDatabase(folder.database_file) as database:
        old = publish(finished_clip(folder, "one", b"old"), folder, database)
        new = finished_clip(folder, "two", b"newer", old.record)
        with monkeypatch.context() as patch:
            if instant == "after the old record is deleted":
                patch.setattr("pathlib.Path.replace", kill)
            elif instant == "after a result is moved":
                patch.setattr(database, "save", kill)
            if instant != "before":
                with pytest.raises(Killed):
                    publish(new, folder, database)
        recorded = database.read_all(ClipRecord)
        assert all(folder.has(record.files) for record in recorded)
        assert recorded == ([old.record] if instant == "before" else [])
        recover("two", folder, database)
        assert database.read_all(ClipRecord) == [new.record]
        assert folder.has(new.record.files)
    assert (folder.path / "a.png").read_bytes() == b"newer"


def kill(*args, **kwargs):
    raise Killed


def test_what_an_interrupted_run_left_damaged_is_not_recovered(folder):
    with RecordDatabase(folder.database_file) as database:
        finished_clip(folder, "one", b"damaged")
        (folder.unfinished("one") / "damaged" / "a.png").write_bytes(b"short")
        finished_clip(folder, "one", b"unreadable")
        (folder.unfinished("one") / "unreadable" / "result.json").write_text('{"record": {"row": {}, "other": 1}}')
        recover("one", folder, database)
        assert database.read_all(ClipRecord) == []
    assert not (folder.path / "a.png").exists()


def test_a_clip_that_was_finished_but_not_published_is_not_measured_again(tmp_path):
    lab, out = tiny_lab(tmp_path / "lab", ["a.avi", "b.avi"]), tmp_path / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("anglecam.batch.run.publish", kill)
        with pytest.raises(Killed):
            run_batch([str(lab)], out, QUIET)
    left = list((out / ".anglecam" / "unfinished").glob("*/*/result.json"))
    assert left
    assert not list(out.glob("*.angles.csv"))
    written = {path: path.stat().st_mtime_ns for path in (left[0].parent / "out").iterdir()}
    assert not run_batch([str(lab)], out, QUIET).problems
    assert {(out / path.name).stat().st_mtime_ns for path in written} == set(written.values())
    run_batch([str(lab)], tmp_path / "unbroken", QUIET)
    assert results(out) == results(tmp_path / "unbroken")


def test_only_the_last_run_is_recovered_and_only_if_it_was_interrupted(folder):
    with locked(folder) as interrupted:
        assert interrupted is None
        start_run(folder)
    with contextlib.suppress(Killed), locked(folder):
        run = start_run(folder)
        kill()
    with contextlib.suppress(Killed), locked(folder) as interrupted:
        assert interrupted == run
        kill()  # before its own run has started
    with locked(folder) as interrupted:
        assert interrupted == run
        start_run(folder)
    with locked(folder) as interrupted:
        assert interrupted is None


def test_an_output_folder_of_a_former_version_is_measured_anew(tmp_path):
    lab, out = tiny_lab(tmp_path / "lab", ["a.avi"]), tmp_path / "out"
    run_batch([str(lab)], tmp_path / "new", QUIET)
    run_batch([str(lab)], out, QUIET)
    shutil.rmtree(out / ".anglecam")
    (out / ".anglecam" / "clips").mkdir(parents=True)
    (out / ".anglecam" / "clips" / "0123.json").write_text('{"address": "a.avi"}')
    (out / ".anglecam" / "lock").write_text("process 1 on host\n0123456789abcdef\n")
    (out / "a.angles.csv").write_text("old")
    assert not run_batch([str(lab)], out, QUIET).problems
    assert results(out) == results(tmp_path / "new")
