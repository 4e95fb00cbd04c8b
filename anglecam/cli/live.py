"""The command `live`: measure while filming."""

from __future__ import annotations

import shutil
import signal
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from anglecam.cli.documents import clip_as_dict, live_as_dict
from anglecam.cli.json_output import report
from anglecam.cli.options import Out
from anglecam.cli.progress import begin_loading, end, stages
from anglecam.data.rounding import with_uncertainty
from anglecam.data.series import OK
from anglecam.errors import AnglecamError, InputError, printable
from anglecam.io.command_csv import COMMAND_ENDING
from anglecam.io.files import require_film_file
from anglecam.io.live_csv import LiveRow
from anglecam.io.rig import read_rig
from anglecam.io.session import command_of, recording_name, rig_beside
from anglecam.progress import Progress, Stage
from anglecam.terminal import errors, make_folder, screen

if TYPE_CHECKING:
    from anglecam.video.live_source import LiveSource
    from anglecam.workflow.live import LiveResult

_TERMINAL_S, _LINES_S = 0.1, 1.0
"""Time between two figures on a terminal, and between two lines elsewhere."""
_RECENT = 300
"""Frames of which the latency is shown."""


def live(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help="Number of a camera, a film to be played at its rate, - or a named pipe, or the address of a stream.",
        ),
    ],
    out: Out,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", help="Rig file; default: rig.yaml beside a film, otherwise in the folder --out."),
    ] = None,
    command: Annotated[
        Path | None,
        typer.Option("--command", help="Command file on the clock of the recording; default: the one beside a film."),
    ] = None,
) -> None:
    """Measure while filming: each angle as it comes, the recording, and the files that `measure` makes of it."""
    try:
        film = Path(source) if Path(source).is_file() else None
        make_folder(out)
        declared = read_rig(rig) if rig else rig_beside(film or out)
        if command is None and film is not None:
            beside = film.with_name(recording_name(film) + COMMAND_ENDING)
            command = beside if beside.is_file() else None
        commanded = None if command is None else command_of(command, declared)
        _require_source(source)
        with stages() as progress:
            begin_loading(progress)
            from anglecam.video.live_source import open_live
            from anglecam.workflow.live import measure_live

            progress(Stage("opening the source"))
            opened = open_live(source)
            with _stopped_by_signals(opened):
                display = _Display(progress)
                result = measure_live(opened, out, declared, commanded, display.show, progress)
        if command is not None:
            _copy(command, out / (recording_name(result.film) + COMMAND_ENDING))
    except AnglecamError as problem:
        end([problem])
        return
    _show(result)
    report(live=live_as_dict(result), clips=[clip_as_dict(result.film, result.measurement)])
    doubt = result.measurement.doubt
    end([InputError(f"{result.film}: {doubt}")] if doubt else [])


def _require_source(source: str) -> None:
    """Raise `InputError` where a source that can only be a film is missing, empty or no file."""
    path = Path(source)
    is_camera = source.isdecimal() and not path.exists()
    if not (source == "-" or "://" in source or is_camera or path.is_char_device() or path.is_fifo()):
        require_film_file(path)


class _Display:
    """Shows the last angle: on a terminal in one line that changes, elsewhere a line every second."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._on_terminal = progress, errors.is_terminal
        self._next = 0.0
        self._latencies: deque[float] = deque(maxlen=_RECENT)
        self._last: LiveRow | None = None
        self._late = 0
        self._cause: str | None = None

    def show(self, row: LiveRow, cause: str | None) -> None:
        """Take a frame; show it if it is time."""
        self._late += row.status == "late"
        if not np.isnan(row.latency):
            self._latencies.append(row.latency)
        if cause is not None and cause != self._cause:
            self._cause = cause
            errors.print(f"not learnt yet: {printable(cause)}")
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + (_TERMINAL_S if self._on_terminal else _LINES_S)
        line = _line(row, self._latencies, self._late)
        if self._on_terminal:
            self._progress(Stage(line))
        else:
            screen.print(line, soft_wrap=True, highlight=False)


def _line(row: LiveRow, latencies: deque[float], late: int) -> str:
    """Return what is shown of a frame."""
    parts = [f"{row.time:8.2f} s"]
    if row.status == OK:
        parts.append(f"angle {np.degrees(row.angle):8.3f} ± {np.degrees(row.sigma):.3f}°")
    else:
        parts.append(row.status)
    if latencies:
        parts.append(f"latency {1e3 * latencies[-1]:.0f} ms, 95 %: {1e3 * np.quantile(latencies, 0.95):.0f} ms")
        parts.append(f"late {late}")
    for name, value, sigma in zip("abc", row.parameters, row.parameter_sigmas, strict=True):
        if np.isfinite([value, sigma]).all() and value != 0.0:
            parts.append(f"{name} {with_uncertainty(value, sigma)}")
    return "  ".join(parts)


@contextmanager
def _stopped_by_signals(source: LiveSource) -> Iterator[None]:
    """Let the first interruption end the recording, and the second one the program."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def stop(number: int, frame: Any) -> None:
        source.stop()
        for each, handler in before.items():
            signal.signal(each, handler)

    for number in before:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _copy(file: Path, kept: Path) -> None:
    """Copy a file, so that the folder of the recording is a session."""
    if not (kept.exists() and kept.samefile(file)):
        shutil.copyfile(file, kept)


def _show(result: LiveResult) -> None:
    """Print what was recorded and measured."""
    from anglecam.report.clip_tables import series_table

    for note in result.measurement.notes:
        screen.print(printable(f"{result.film}: {note}"), soft_wrap=True, highlight=False, markup=False)
    latencies = 1e3 * result.latencies
    lines = [
        f"{result.film}: {len(result.rows)} frames recorded, {len(latencies)} measured at once,"
        f" {result.count('learning')} while the mark was learnt, {result.count('late')} not in time"
    ]
    if len(latencies):
        lines.append(
            f"latency {np.median(latencies):.1f} ms (median), {np.quantile(latencies, 0.95):.1f} ms (95 %),"
            f" {latencies.max():.1f} ms (longest); at once and afterwards differ by"
            f" {result.disagreement:.2g} standard uncertainties RMS"
        )
    elif result.cause is not None:
        lines.append(f"nothing was measured at once: {result.cause}")
    for line in lines:
        screen.print(printable(line), soft_wrap=True, highlight=False, markup=False)
    screen.print(series_table([result.measurement]))
