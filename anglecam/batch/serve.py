"""What a measuring process does: it reads a line of JSON for each clip or session and answers with another.

It writes files only to the folder that the request names. Moving them to their output paths and recording the outcome
is the batch's part. It uses one core.
"""

from __future__ import annotations

import faulthandler
import json
import os
import queue
import signal
import sys
import threading
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from anglecam.camera.calibration import read_calibration
from anglecam.data.series import AngleSeries
from anglecam.errors import AnglecamError, InputError, RigError, blame
from anglecam.io.netcdf_parquet import read_netcdf, write_netcdf
from anglecam.io.rig import Rig, read_rig
from anglecam.io.session import Recording, read_session, rig_beside
from anglecam.measurement.clip import Measurement
from anglecam.measurement.tracks import MeasuredTracks
from anglecam.report.origin import Run
from anglecam.workflow.clip import measure_source, open_recording, open_source, write_clip_page, write_measurement

_GRACE_S = 60.0
"""Time after its time limit at which a process ends itself if it has not noticed that its parent is gone, in s."""


def measure(request: dict[str, Any]) -> dict[str, Any]:
    """Measure one clip as `anglecam measure` does.

    Parameters
    ----------
    request : dict
        ``clip``; ``rig`` or null; ``into``, an existing folder; ``series_file``, a netCDF file for the
        series to the last bit, or null.

    Returns
    -------
    dict
        The clip's figures for the index, how it is ``truncated``, and any other ``doubt``; or the ``cause`` of the
        failure and whether the ``call_is_wrong``; or why the rig file or its calibration is ``unreadable``; or the
        number and text of the error for which the results were ``not_written``.
    """
    clip, into = Path(request["clip"]), Path(request["into"])
    found: dict[str, Any] = {}
    try:
        with blame(clip):
            try:
                rig = _read_declared(clip, request["rig"])
            except RigError as problem:
                return {"unreadable": problem.one_line}
            source = open_source(clip, rig)
            film = source.film
            if film is not None:
                found |= {"width_px": film.width, "height_px": film.height, "codec": film.codec}
            measurement = measure_source(source)
        found |= _figures(measurement) | {"truncated": measurement.truncated, "doubt": measurement.doubt}
        from anglecam.report.clip_page import write_thumbnail  # loads matplotlib

        with blame(clip):
            try:
                answers = write_measurement(measurement, source.command, into)
                write_clip_page(
                    source, measurement, answers, into, Run(rig=Path(request["rig"]) if request["rig"] else None)
                )
                write_thumbnail(into, measurement, source.film)
                if request["series_file"]:
                    write_netcdf(measurement.series, Path(request["series_file"]))
            except OSError as problem:
                return {"not_written": [problem.errno, problem.strerror or str(problem)]}
    except AnglecamError as problem:
        found |= {"cause": problem.one_line, "call_is_wrong": isinstance(problem, RigError)}
    return found


def _read_declared(clip: Path, rig: str | None) -> Rig:
    """Read the rig file, and its calibration to find out whether it can be read."""
    declared = read_rig(Path(rig)) if rig else rig_beside(clip)
    if declared.camera.calibration is not None:
        read_calibration(Path(declared.camera.calibration))
    return declared


def fit(request: dict[str, Any]) -> dict[str, Any]:
    """Identify one session as `anglecam identify` does, or close its loop as `anglecam close` does.

    Parameters
    ----------
    request : dict
        ``session``; ``rig`` or null; ``into``, an existing folder; ``series_files``, from a clip's name to its series;
        ``close``.

    Returns
    -------
    dict
        ``verdict``, ``effects`` and ``problems``; or the ``cause`` of the failure and whether the ``call_is_wrong``; or
        the number and text of the error for which the results were ``not_written``.
    """
    # these imports take a second, and clips do not need them
    from anglecam.workflow.session import gather_session, loop_input
    from anglecam.workflow.session_results import write_closed, write_identified

    folder, into = Path(request["session"]), Path(request["into"])
    cached: dict[str, str] = request["series_files"]

    def series_of(recording: Recording) -> tuple[AngleSeries, str | None]:
        if not recording.is_clip:  # tracks by another program
            tracked = measure_source(open_recording(recording.source, opened.rig, recording.command))
            return tracked.series, tracked.truncated
        if recording.source.name not in cached:
            raise InputError(f"{recording.source}: could not be measured")
        return read_netcdf(Path(cached[recording.source.name])), None

    try:
        with blame(folder):
            opened = read_session(folder, read_rig(Path(request["rig"])) if request["rig"] else None)
            measured = gather_session(opened, series_of)
            verdict = effects = None
            try:
                if request["close"]:
                    found = write_closed(measured, loop_input(measured), into).verdict
                    verdict, effects = found.verdict, " + ".join(a.effect.id for a in found.accepted) or None
                else:
                    write_identified(measured, into)
            except OSError as problem:
                return {"not_written": [problem.errno, problem.strerror or str(problem)]}
    except AnglecamError as problem:
        return {"cause": problem.one_line, "call_is_wrong": isinstance(problem, RigError), "problems": []}
    return {"verdict": verdict, "effects": effects, "problems": [problem.one_line for problem in measured.problems]}


def _figures(measurement: Measurement | MeasuredTracks) -> dict[str, Any]:
    series = measurement.series
    n, span = len(series.time), float(series.time[-1] - series.time[0])
    sigma = np.degrees(series.sigma[series.ok])
    rate = (n - 1) / span if span > 0.0 else None
    return {
        "frames": n,
        "rate_hz": _rounded(rate),
        "duration_s": None if rate is None else _rounded(n / rate),
        "share_measured": _rounded(float(series.ok.mean())),
        "median_sigma_deg": _rounded(float(np.median(sigma))) if len(sigma) else None,
        "notes": "; ".join(measurement.notes) or None,
    }


def _rounded(value: float | None) -> float | None:
    """Round to nine significant digits."""
    return None if value is None else float(f"{value:.9g}")


def serve() -> None:
    """Answer requests until standard input ends, as it does when the parent is gone."""
    answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)  # messages of libraries must not mix with the answers
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    cv2.setNumThreads(1)
    requests: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    while True:
        request = requests.get()
        faulthandler.dump_traceback_later(request["time_limit"] + _GRACE_S, exit=True, file=2)
        answer = fit(request) if "session" in request else measure(request)
        faulthandler.cancel_dump_traceback_later()
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def _listen(requests: queue.SimpleQueue[dict[str, Any]]) -> None:
    """Queue the requests; when the parent is gone, end the process at once, even while it measures."""
    for line in sys.stdin:
        requests.put(json.loads(line))
    os._exit(1)


if __name__ == "__main__":
    serve()
