"""The command `live` as a user calls it: what it prints, its files, its exit status, and how it is stopped."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys

import numpy as np
import pytest

from anglecam.cli.app import main
from support import things

ANGLES = 20.0 * np.sin(np.arange(120) / 5.0)
CALL = [sys.executable, "-c", "from anglecam.cli.app import main; main()", "live"]


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    folder = tmp_path_factory.mktemp("film")
    return things.film(folder / "swing.mkv", things.ball((200, 40, 40), 12.0), ANGLES)


def test_an_interruption_ends_the_recording_and_what_came_is_measured(film, tmp_path):
    pipe = tmp_path / "camera"
    os.mkfifo(pipe)
    out = tmp_path / "out"
    command = tmp_path / "played.csv"
    command.write_text("time_s,command_deg\n0,0\n1,10\n")
    call = [*CALL, str(pipe), "--out", str(out), "--command", str(command)]
    with (
        subprocess.Popen(call, stdout=-1, stderr=-1, text=True) as called,
        pipe.open("wb") as stream,
    ):
        stream.write(film.read_bytes())
        stream.flush()
        assert called.stdout is not None
        for line in called.stdout:
            if re.match(r" *\d+\.\d\d s", line):
                break
        called.send_signal(signal.SIGINT)
        printed, told = called.communicate(timeout=300)
    assert called.returncode == 0, told
    assert re.search(
        r"\d+ frames recorded, \d+ measured at once, \d+ while the mark was learnt, \d+ not in time", printed
    )
    made = {path.name for path in out.iterdir()}
    assert {"camera.angles.csv", "camera.live.csv", "camera.live.png", "camera.png"} <= made
    assert (out / "camera.command.csv").read_text() == command.read_text()


@pytest.mark.parametrize("source", ["nothing.avi", "77", "http://127.0.0.1:9/film"])
def test_a_source_that_cannot_be_opened_is_said_in_a_line(source, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(sys, "argv", ["anglecam", "live", source, "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        main()
    printed, told = capfd.readouterr()
    assert ended.value.code != 0
    assert source in told
    assert len(told.strip().splitlines()) == 1
    assert not printed
