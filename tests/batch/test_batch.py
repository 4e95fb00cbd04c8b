"""A folder of clips from beginning to end: results as `measure` writes them, the index, and what is measured again."""

from __future__ import annotations

import csv
import json
import os
import shutil
from dataclasses import replace

import duckdb
import pandas as pd
import pytest

from anglecam.batch.database import RecordDatabase
from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.records import ClipRecord
from anglecam.batch.run import Options
from anglecam.errors import RigError
from anglecam.io.rig import Rig
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from anglecam.workflow.clip import write_measurement
from support.measured_here import run_batch
from support.tiny import FRAMES, SIZE, results, tiny_clip, tiny_lab
from support.tiny import run_batch as run

QUIET = Options(jobs=1, quiet=True)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Return a folder of clips, two of them unreadable, the output folder of a batch, and the finished process."""
    top = tmp_path_factory.mktemp("lab")
    lab = tiny_lab(top / "clips", ["b.avi", "mon/a.avi", "mon/a.mkv.avi", "tue/a.avi"])
    (lab / "mon" / "empty.mp4").touch()
    (lab / "tue" / "text.avi").write_text("not a film\n" * 50)
    (lab / "tue" / "rig.yaml").write_text("facing: left\n")
    call = run(lab, "--out", top / "out", "--jobs", 2, "--log", top / "log.jsonl")
    return lab, top / "out", call


def rows(out):
    with (out / "index.csv").open(newline="") as stream:
        return {row["path"]: row for row in csv.DictReader(stream)}


def test_each_clip_has_the_files_that_measure_writes_in_its_folder_below_the_given_one(done, tmp_path):
    lab, out, _ = done
    for name, rig in (("b.avi", Rig()), ("mon/a.avi", Rig()), ("tue/a.avi", Rig(facing="left"))):
        clip = lab / name
        measured = measure_clip(open_film(clip), rig)
        write_measurement(measured, None, tmp_path / clip.parent.name)
        for ending in (".angles.csv", ".png"):
            alone = (tmp_path / clip.parent.name / f"{clip.stem}{ending}").read_bytes()
            assert (out / name).with_name(clip.stem + ending).read_bytes() == alone
        assert measured.notes
        assert rows(out)[str(clip)]["notes"] == "; ".join(measured.notes)


def test_the_index_has_a_row_per_clip_with_its_outcome(done):
    lab, out, _ = done
    index = rows(out)
    assert list(index) == sorted(str(p) for p in lab.rglob("*") if p.suffix in (".avi", ".mp4"))
    good = index[f"{lab}/mon/a.avi"]
    assert good["status"] == "ok"
    assert good["series"] == "mon/a.angles.csv"
    assert (int(good["frames"]), int(good["width_px"]), int(good["height_px"])) == (FRAMES, *SIZE)
    assert float(good["rate_hz"]) == pytest.approx(30.0)
    assert float(good["duration_s"]) == pytest.approx(FRAMES / 30.0)
    assert good["codec"] == "mjpeg"
    assert float(good["share_measured"]) == 1.0
    assert 0.0 < float(good["median_sigma_deg"]) < 1.0
    assert int(good["size_bytes"]) == (lab / "mon/a.avi").stat().st_size
    assert index[f"{lab}/mon/empty.mp4"]["status"] == "failed"
    assert index[f"{lab}/mon/empty.mp4"]["cause"] == "empty file"


def test_the_index_can_be_queried_by_duckdb_and_pandas(done):
    _, out, _ = done
    counted = duckdb.sql(f"SELECT status, count(*) FROM '{out}/index.parquet' GROUP BY 1 ORDER BY 1").fetchall()
    assert counted == [("failed", 2), ("ok", 4)]
    table = pd.read_parquet(out / "index.parquet")
    assert table[table.status == "ok"].frames.sum() == 4 * FRAMES
    text = pd.read_csv(out / "index.csv")
    assert list(text.columns) == list(table.columns)


def test_a_clip_that_fails_gives_one_line_and_exit_status_1(done):
    lab, _, call = done
    assert call.returncode == 1
    lines = [line for line in call.stderr.splitlines() if " of 6: " not in line]
    assert lines == [
        f"{lab}/mon/empty.mp4: empty file",
        f"{lab}/tue/text.avi: not a readable video file (Invalid data found when processing input)",
    ]
    assert "6 clips: 4 ok, 2 failed" in call.stdout


def test_the_log_is_a_line_of_json_for_every_clip(done):
    _, out, _ = done
    lines = [json.loads(line) for line in (out.parent / "log.jsonl").read_text().splitlines()]
    assert sorted(line["clip"] for line in lines) == list(rows(out))
    assert all(line.keys() >= {"time", "status", "cause", "wall_time_s"} for line in lines)


def test_progress_is_plain_lines_without_a_terminal_and_nothing_with_quiet(done, batch_here):
    lab, out, call = done
    assert sum(" of 6: " in line for line in call.stderr.splitlines()) == 6
    quiet = batch_here(lab / "mon" / "a.avi", lab / "b.avi", "--out", out.parent / "quiet", "--quiet")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")


def test_only_what_has_changed_is_measured_again(done, tmp_path):
    lab, out, _ = done
    lab, out = shutil.copytree(lab, tmp_path / "clips"), tmp_path / "out"
    run_batch([str(lab)], out, QUIET)
    first, records = results(out), records_of(out)
    again = run_batch([str(lab)], out, QUIET)
    assert (results(out), records_of(out)) == (first, records)
    assert len(again.problems) == 2  # failures are reported again, and not tried again
    tiny_clip(lab / "b.avi", seed=11)  # its content,
    (lab / "mon" / "rig.yaml").write_text("facing: left\n")  # its rig
    (lab / "tue" / "a.command.csv").write_text("time_s,command_deg\n0,0\n0.1,5\n")  # or its command
    (out / "mon" / "a.mkv.angles.csv").unlink()
    run_batch([str(lab)], out, QUIET)
    changed = {name for name, content in results(out).items() if first.get(name) != content}
    assert {"b.angles.csv", "mon/a.angles.csv", "mon/a.mkv.angles.csv"} <= changed
    redone = {address for address, record in records_of(out).items() if record != records[address]}
    assert len(redone) == 5  # b, two in mon and its empty one, tue/a
    first_time = records[f"{lab}/tue/text.avi"].row.wall_time_s
    assert rows(out)[f"{lab}/tue/text.avi"]["wall_time_s"] == str(first_time)


def records_of(out):
    """Return each clip's job record; its wall time changes only if the clip is measured again."""
    with RecordDatabase(OutputFolder(out).database_file) as database:
        found = database.read_all(ClipRecord)
    return {record.address: replace(record, stamp_is_reliable=False) for record in found}


def test_a_clip_with_new_times_and_the_same_content_is_not_measured_again(tmp_path):
    clip = tiny_clip(tmp_path / "clips" / "a.avi")
    run_batch([str(clip)], tmp_path / "out", QUIET)
    before = (tmp_path / "out" / "a.angles.csv").stat().st_mtime_ns
    os.utime(clip, (1e9, 1e9))
    run_batch([str(clip)], tmp_path / "out", QUIET)
    assert (tmp_path / "out" / "a.angles.csv").stat().st_mtime_ns == before


def test_a_failed_clip_is_measured_again_on_request_or_after_a_change(tmp_path):
    clip, out = tiny_clip(tmp_path / "clips" / "a.avi"), tmp_path / "out"
    whole = clip.read_bytes()
    clip.write_bytes(b"")
    assert [str(p) for p in run_batch([str(clip)], out, QUIET).problems] == [f"{clip}: empty file"]
    assert sorted(p.name for p in out.iterdir()) == [".anglecam", "index.csv", "index.html", "index.parquet"]
    clip.write_bytes(whole)
    result = run_batch([str(clip)], out, Options(jobs=1, quiet=True, time_limit=0.001))
    assert [str(p) for p in result.problems] == [f"{clip}: took longer than its time limit of 0.001 s"]
    assert run_batch([str(clip)], out, QUIET).rows[0].status == "failed"
    assert run_batch([str(clip)], out, Options(jobs=1, quiet=True, retry_failed=True)).rows[0].status == "ok"


def test_a_wrong_rig_file_affects_its_folder_only_and_gives_exit_status_2(tmp_path, batch_here):
    lab = tiny_lab(tmp_path / "clips", ["good/a.avi", "wrong/b.avi", "wrong/c.avi"])
    (lab / "wrong" / "rig.yaml").write_text("pivott: {}\n")
    call = batch_here(lab, "--out", tmp_path / "out", "--quiet")
    assert call.returncode == 2
    assert call.stderr.splitlines() == [f"{lab}/wrong/rig.yaml: unknown key pivott; did you mean pivot?"]
    assert (tmp_path / "out" / "good" / "a.angles.csv").exists()


def test_the_index_keeps_other_folders_and_calls_clips_that_are_gone_stale(tmp_path):
    out = tmp_path / "out"
    mon, tue = tiny_lab(tmp_path / "mon", ["a.avi", "b.avi"]), tiny_lab(tmp_path / "tue", ["a.avi"])
    run_batch([str(mon)], out, QUIET)
    first = (out / "a.angles.csv").read_bytes()
    run_batch([str(tue)], out, QUIET)
    assert (out / "a.angles.csv").read_bytes() == first  # mon's
    assert [row["series"] for row in rows(out).values()] == ["a.angles.csv", "b.angles.csv", "tue/a.angles.csv"]
    (mon / "b.avi").unlink()
    run_batch([str(mon / "a.avi")], out, QUIET)
    assert len(rows(out)) == 3  # a clip's folder was not searched
    assert not run_batch([str(mon)], out, QUIET).problems  # it is not part of the batch
    run_batch([str(tue)], out, QUIET)  # also after a batch of another folder
    gone = rows(out)[f"{mon}/b.avi"]
    assert (gone["status"], gone["cause"]) == ("stale", "no such clip any more; its results stay")
    assert (out / "b.angles.csv").exists()
    (tue / "b.avi").write_bytes((tue / "a.avi").read_bytes())
    run_batch([str(tue)], out, QUIET)
    (mon / "b.avi").write_bytes((mon / "a.avi").read_bytes())
    run_batch([str(mon)], out, QUIET)
    run_batch([str(tue)], out, QUIET)
    found = [row["series"] for row in rows(out).values()]
    assert found == ["a.angles.csv", "b.angles.csv", "tue/a.angles.csv", "tue/b.angles.csv"]
    assert all((out / series).exists() for series in found)  # the output path of a removed clip stays taken


def test_wrong_calls_are_exit_status_2_and_do_nothing(tmp_path, batch_here):
    lab = tiny_lab(tmp_path / "clips", ["a.avi"])
    (tmp_path / "rig.yaml").write_text("facing: up\n")
    (tmp_path / "file").touch()
    call = batch_here(lab, "--rig", tmp_path / "rig.yaml", "--out", tmp_path / "out")
    assert call.returncode == 2
    assert call.stderr.splitlines() == [f"{tmp_path}/rig.yaml: facing: input should be 'right' or 'left' (got up)"]
    for out, options, says in (
        (tmp_path / "file", QUIET, "is a file"),
        (tmp_path / "out", Options(jobs=1, log=tmp_path), "--log"),
    ):
        with pytest.raises(RigError, match=says):
            run_batch([str(lab)], out, options)
    assert not list((tmp_path / "out").glob("*.csv"))
