"""The program of a job: it measures a clip or closes a session's loop, and reports a line of JSON at a time.

It reads one request from its standard input, and ends when that input ends: then the server is gone. A signal ends it
with unfinished files removed.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

from anglecam.errors import AnglecamError, InputError, blame
from anglecam.io.session import read_session
from anglecam.progress import Stage, within
from anglecam.terminal import make_folder
from anglecam.workflow.clip import measure_source, open_source, write_measurement


def measure(request: dict[str, Any]) -> dict[str, Any]:
    """Measure one clip as `anglecam measure` does; ``request`` holds ``clip`` and ``out``."""
    clip, out = Path(request["clip"]), Path(request["out"])
    with blame(clip):
        make_folder(out)
        source = open_source(clip)
        measurement = measure_source(source, progress=within(_progress, clip.name))
        _progress(Stage("writing the series and its plot", of=clip.name))
        write_measurement(measurement, source.command, out)
        frames = len(measurement.series.time)
        _progress(Stage("done", frames, frames, clip.name))
    if measurement.doubt:
        raise InputError(f"{clip}: {measurement.doubt}")
    return {"by": measurement.by, "pivot": measurement.pivot, "notes": list(measurement.notes)}


def close(request: dict[str, Any]) -> dict[str, Any]:
    """Close a session's loop as `anglecam close` does; ``request`` holds ``session`` and ``out``."""
    from anglecam.workflow.session import loop_input, measure_session
    from anglecam.workflow.session_results import write_closed

    folder, out = Path(request["session"]), Path(request["out"])
    with blame(folder):
        make_folder(out)
        measured = measure_session(read_session(folder), out=out, progress=_progress)
        closed = write_closed(measured, loop_input(measured), out, progress=_progress)
    effects = [accepted.effect.id for accepted in closed.verdict.accepted]
    problems = [*map(str, measured.problems), *closed.missing]
    return {"verdict": closed.verdict.verdict, "effects": effects, "notes": [*measured.notes, *problems]}


def _progress(stage: Stage) -> None:
    _say({"what": stage.title, "done": stage.done, "total": stage.total or 0})


def _say(message: dict[str, Any]) -> None:
    _answers.write(json.dumps(message) + "\n")
    _answers.flush()


def main() -> None:
    """Do what the first line of standard input asks for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server handles Ctrl-C
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(1))
    request = json.loads(sys.stdin.readline())
    threading.Thread(target=_end_with_input, daemon=True).start()
    try:
        result = close(request) if "session" in request else measure(request)
        _say({"result": result})
    except AnglecamError as problem:
        _say({"problem": str(problem)})


def _end_with_input() -> None:
    sys.stdin.read()
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    _answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)  # messages of libraries must not mix with the answers
    main()
