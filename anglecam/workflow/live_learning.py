"""Learn from the frames of a source in a thread, while more frames come, and again when there are twice as many.

What is learnt from two seconds holds for the angles that were seen in them. The body is therefore learnt again from
evenly spaced frames of all that was filmed, at doubled durations: of an hour ten times. A failed attempt is repeated
sooner: the mechanism may have rested.

Most of the time goes into seeking the mark. The body is therefore learnt from all frames that came by the end of the
search, and a failed attempt leaves the mark to the next one.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from math import isnan
from threading import Thread, get_native_id

from anglecam.data.command import Command
from anglecam.data.record import Record, record_from_series
from anglecam.errors import AnglecamError, InputError, blame
from anglecam.identification.running_ekf import RunningEkf
from anglecam.io.rig import Rig
from anglecam.measurement.clip import measure_clip
from anglecam.measurement.live_model import LiveModel, live_model
from anglecam.measurement.mark_pass import seek_mark
from anglecam.video.decode import Row
from anglecam.video.film import Film
from anglecam.video.film_rows import KeptRows
from anglecam.video.live_source import LiveSource
from anglecam.vision.mark.found_mark import FoundMark

_FIRST_S, _FEWEST = 2.0, 24
"""Duration and number of the frames of the first attempt: less seldom shows a motion."""
_LONGER, _SOONER = 2.0, 1.25
"""Ratio of the durations of an attempt and the one before it, after a success and after a failure."""
_NICENESS = 10
"""Of the thread: where the processor is short, frames are measured first."""


@dataclass(frozen=True)
class Lesson:
    """What was learnt from some frames."""

    model: LiveModel
    film: Film
    """These frames."""
    lines: dict[int, float]
    """Direction of the line from pivot to mark in those that were measured, by their numbers, rad."""
    filter: RunningEkf | None
    """After these frames; ``None`` where they are too few."""


class Learning:
    """Learns from more and more frames.

    Parameters
    ----------
    source : LiveSource
        Of the frames.
    rig : Rig
        What is declared.
    command : Command, optional
        What was commanded.
    """

    def __init__(self, source: LiveSource, rig: Rig, command: Command | None) -> None:
        self._source, self._rig, self._command = source, rig, command
        self._kept = KeptRows()
        self._count = 0
        self._first_s: float | None = None
        self._learnt_s = 0.0
        self._due_s = _FIRST_S
        self._mark: FoundMark | None = None
        self._thread: Thread | None = None
        self._lesson: Lesson | None = None
        self.cause: str | None = None
        """Why nothing could be learnt yet; ``None`` from the first success on."""

    def add(self, row: Row) -> Lesson | None:
        """Keep the next frame; return what was learnt since the last call, if anything."""
        self._kept.add(self._count, row)
        self._count += 1
        self._first_s = row[0] if self._first_s is None else self._first_s
        lasted = row[0] - self._first_s
        lesson = None
        if self._thread is not None and not self._thread.is_alive():
            self._thread, lesson, self._lesson = None, self._lesson, None
            self._due_s = self._learnt_s * (_SOONER if lesson is None else _LONGER)
        if self._thread is None and lasted >= self._due_s and len(self._kept.rows) >= _FEWEST:
            self._thread = Thread(target=self._learn, name="learning", daemon=True)
            self._thread.start()
        return lesson

    def end(self) -> None:
        """Wait for the attempt that is under way: it uses the frames of the source."""
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _learn(self) -> None:
        with suppress(AttributeError, OSError):  # where a thread has no niceness of its own
            os.setpriority(os.PRIO_PROCESS, get_native_id(), _NICENESS)
        try:
            with blame(self._source.path):
                mark, self._mark = self._mark, None
                if mark is None:
                    film, rig = self._film_of(list(self._kept.rows))
                    mark = self._mark = seek_mark(film, rig)
                self._lesson = self._lesson_from(list(self._kept.rows), mark)
                self.cause = self._mark = None
        except AnglecamError as problem:
            self.cause = str(problem)

    def _film_of(self, numbered: list[tuple[int, Row]]) -> tuple[Film, Rig]:
        """Return the film of some frames, and its rig."""
        assert self._first_s is not None
        self._learnt_s = numbered[-1][1][0] - self._first_s
        film = self._source.film_of([row for _, row in numbered])
        return film, _rig_of_kept(self._rig, [number for number, _ in numbered])

    def _lesson_from(self, numbered: list[tuple[int, Row]], mark: FoundMark) -> Lesson:
        film, rig = self._film_of(numbered)
        first = measure_clip(film, rig, self._command, mark=mark)
        model = live_model(first, rig)
        if isinstance(model, str):
            raise InputError(f"{film.path}: {model}")
        try:
            record: Record | None = record_from_series(
                first.series, self._command, zero_known=self._rig.neutral != "auto"
            )
        except InputError:  # too few frames for the filter
            record = None
        line = first.series.line
        assert line is not None  # only tracks may lack it
        lines = {k: at for (k, _), at in zip(numbered, line.tolist(), strict=True) if not isnan(at)}
        return Lesson(model, film, lines, None if record is None else RunningEkf(record))


def _rig_of_kept(rig: Rig, numbers: list[int]) -> Rig:
    """Return the rig for some frames of the film: a mark that is declared in a frame is in another one of them."""
    mark = rig.pointed_mark
    if mark is None:
        return rig
    if mark.frame not in numbers:
        raise InputError(f"the mark is declared in frame {mark.frame}, which was not kept; declare it in frame 0")
    return rig.model_copy(update={"mouth": mark.model_copy(update={"frame": numbers.index(mark.frame)})})
