"""Measure while filming: the angle in each frame as it comes, and the recorded film's files at the end.

Frames that come before the mark and the body are learnt, and frames that cannot be measured in time, are recorded all
the same. When the source has ended, the whole recording is measured as any other film.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anglecam.data.command import Command
from anglecam.data.series import OK
from anglecam.data.typing import Floats
from anglecam.errors import RigError, blame
from anglecam.identification.running_ekf import RunningEkf
from anglecam.io.live_csv import LIVE_ENDING, LiveRow, write_live
from anglecam.io.rig import Rig, RigFrames
from anglecam.io.session import recording_name
from anglecam.measurement.clip import Measurement
from anglecam.measurement.live_meter import LiveMeter
from anglecam.measurement.live_model import LiveAngle
from anglecam.progress import Progress, Stage, unseen, within
from anglecam.video.decode import Row
from anglecam.video.live_source import LiveSource
from anglecam.workflow.clip import measure_source, open_recording, write_clip_page, write_measurement
from anglecam.workflow.live_learning import Learning, Lesson

LATE_S = 0.1
"""A frame whose turn comes later than this is not measured at once."""
LEARNING, LATE = "learning", "late"


@dataclass(frozen=True)
class LiveResult:
    """What was measured while filming, and of the recorded film."""

    film: Path
    """The recording."""
    rows: tuple[LiveRow, ...]
    """A row a frame, as it was shown."""
    measurement: Measurement
    """Of the recorded film."""
    cause: str | None
    """Why nothing was learnt while filming; ``None`` where something was."""

    @property
    def latencies(self) -> Floats:
        """Of the frames that were measured at once, s."""
        return np.array([row.latency for row in self.rows if not np.isnan(row.latency)])

    def count(self, status: str) -> int:
        """Return the number of frames with a status."""
        return sum(row.status == status for row in self.rows)

    @property
    def disagreement(self) -> float:
        """RMS difference between the angles at once and those of the recording, in standard uncertainties; NaN if none.

        A difference that all frames share is left out: neutral may be the median of all angles.
        """
        series = self.measurement.series
        n = min(len(self.rows), len(series.angle))
        off = np.array([row.angle for row in self.rows[:n]]) - series.angle[:n]
        sigma = np.hypot([row.sigma for row in self.rows[:n]], series.sigma[:n])
        seen = np.isfinite(off)
        if not seen.any():
            return float("nan")
        return float(np.sqrt(np.mean(((off - np.median(off[seen]))[seen] / sigma[seen]) ** 2)))


def measure_live(
    source: LiveSource,
    out: Path,
    rig: Rig,
    command: Command | None,
    show: Callable[[LiveRow, str | None], None],
    progress: Progress = unseen,
) -> LiveResult:
    """Measure until the source ends or is stopped, then measure the recording, and write its files.

    Parameters
    ----------
    source : LiveSource
        Opened, and not yet recorded.
    out : Path
        Folder for the recording, and for the files of `anglecam.workflow.clip.write_measurement`, ``NAME.live.csv`` and
        ``NAME.live.png``; it exists.
    rig : Rig
        What is declared.
    command : Command, optional
        What is commanded, on the clock of the source.
    show : callable
        Called with each frame, and with the cause why nothing could be learnt yet.
    progress : Progress
        Called with each stage once the source has ended, while the recording is measured.

    Returns
    -------
    LiveResult
        Of all frames.

    Raises
    ------
    InputError
        Where the source cannot be read or recorded, or no frame of the recording can be measured.
    RigError
        Where the rig is wrong, or restricts the frames.
    """
    if rig.frames != RigFrames():
        raise RigError("frames: {…} in rig.yaml is for films; what is measured while filming has no end yet")
    path = source.record(out)
    session = _Session(source, rig, command)
    try:
        with blame(path):
            for row, ready in source.rows():
                session.add(row, ready)
                show(session.rows[-1], session.learning.cause)
    finally:
        source.close()
        session.learning.end()
    from anglecam.report.live_figure import plot_live  # matplotlib takes a second to load

    name = recording_name(path)
    progress(Stage("opening the recording", of=path.name))
    write_live(session.rows, out / f"{name}{LIVE_ENDING}")
    recording = open_recording(path, rig, command)
    measurement = measure_source(recording, progress=within(progress, path.name))
    assert isinstance(measurement, Measurement)  # a film is no file of tracks
    progress(Stage("writing plots and the page", of=path.name))
    write_clip_page(recording, measurement, write_measurement(measurement, command, out), out)
    result = LiveResult(path, tuple(session.rows), measurement, session.learning.cause)
    plot_live(result.rows, out / f"{name}.live.png", name)
    return result


class _Session:
    """The frames of a source, as far as they were measured."""

    def __init__(self, source: LiveSource, rig: Rig, command: Command | None) -> None:
        self.learning = Learning(source, rig, command)
        self._rig = rig
        self.rows: list[LiveRow] = []
        self._meter: LiveMeter | None = None
        self._neutral = 0.0
        self._lines: dict[int, float] = {}
        self._filter: RunningEkf | None = None

    def add(self, row: Row, ready: float) -> None:
        """Measure the next frame, which was ready at an instant of `time.monotonic`, unless it is too late."""
        lesson = self.learning.add(row)
        if lesson is not None:
            self._use(lesson)
        frame = LiveRow(len(self.rows), row[0], LEARNING)
        if self._meter is not None and time.monotonic() - ready > LATE_S:
            self._meter.skip()
            frame = replace(frame, status=LATE)
        elif self._meter is not None:
            frame = self._measured(frame, self._meter.measure(frame.frame, row))
            frame = replace(frame, latency=time.monotonic() - ready)
        self.rows.append(frame)

    def _use(self, lesson: Lesson) -> None:
        """Measure by a lesson from now on; neutral stays where it is by the frames of this and the last lesson."""
        shared = [lesson.lines[k] - self._lines[k] for k in self._lines.keys() & lesson.lines.keys()]
        if self._meter is None:
            self._meter, self._filter = LiveMeter(lesson.model, lesson.film), lesson.filter
        else:
            self._meter.relearn(lesson.model)
        if shared and self._rig.neutral == "auto":
            moved = float(np.median(shared))
            self._neutral += moved - 2.0 * np.pi * round(moved / (2.0 * np.pi))
        else:
            self._neutral = lesson.model.neutral
        self._lines = lesson.lines

    def _measured(self, frame: LiveRow, found: LiveAngle) -> LiveRow:
        if found.status != OK:
            return replace(frame, status=found.status)
        angle = found.line - self._neutral
        frame = replace(frame, status=OK, angle=angle, sigma=found.sigma)
        if self._filter is None:
            return frame
        estimate = self._filter.add(frame.time, angle)
        return replace(frame, parameters=estimate.values, parameter_sigmas=estimate.sigmas)
