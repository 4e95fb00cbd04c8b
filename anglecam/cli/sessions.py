"""The commands that work on a session: `identify` and `close`.

What is wrong with a call is found before the modules that measure and fit are loaded, which takes longer than many a
call.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anglecam.cli.json_output import report, report_file
from anglecam.cli.options import HoldOut, Out, SessionFolder
from anglecam.cli.progress import begin_loading, leave, stages, tell
from anglecam.cli.this_run import this_run
from anglecam.errors import InputError, RigError, printable
from anglecam.io.session import Session, read_session, require_recordings
from anglecam.progress import Progress, Stage
from anglecam.terminal import errors, make_folder, screen

if TYPE_CHECKING:
    from anglecam.loop.verdict import Verdict
    from anglecam.workflow.session import MeasuredSession


def identify(
    session: SessionFolder,
    out: Out,
    estimator: Annotated[str, typer.Option("--estimator")] = "oe2",
    neck: Annotated[
        Path | None, typer.Option("--neck", help="What is known of the neck, for --estimator neck; else the paper's.")
    ] = None,
) -> None:
    """Fit a model to a session: model.json, and model.mat for MATLAB."""
    from anglecam.identification.estimators import ESTIMATORS

    if estimator not in ESTIMATORS:
        raise RigError(f"--estimator {estimator}: choose one of {', '.join(ESTIMATORS)}")
    takes_neck = ESTIMATORS[estimator].takes_neck
    if neck is not None and not takes_neck:
        users = " or ".join(f"--estimator {entry.id}" for entry in ESTIMATORS.values() if entry.takes_neck)
        raise RigError(f"--neck {neck}: used by {users} only")
    declared = None
    if takes_neck:
        from anglecam.io.neck_file import read_neck

        declared = read_neck(neck).large_angle
    opened = _open(session, out)
    with stages() as progress:
        begin_loading(progress)
        from anglecam.report.session_tables import model_table
        from anglecam.workflow.session_results import write_identified

        measured = measure_recordings(opened, out, progress)
        progress(Stage(f"fitting a model by {ESTIMATORS[estimator].summary}"))
        model = write_identified(measured, out, estimator, declared)
    screen.print(model_table([model]))
    report_file("model", out / "model.json")
    report(doubts=list(model.doubts), notes=list(measured.notes))
    for doubt in model.doubts:
        screen.print(doubt, soft_wrap=True, highlight=False, markup=False)
    if takes_neck and neck is None:
        screen.print("the neck is the paper's: one spring, constant γ; declare yours with --neck", soft_wrap=True)
    leave(measured.problems)


def close(
    session: SessionFolder,
    out: Out,
    hold_out: HoldOut = None,
) -> None:
    """Find what the model lacks: loop.json, report.html and, where it helps, the command to play next."""
    measured, _ = close_and_report(session, out, hold_out or ())
    leave(measured.problems)


def close_and_report(session: Path, out: Path, hold_out: Sequence[str]) -> tuple[MeasuredSession, Verdict]:
    """Measure a session, close the loop, write the files of `close` and print its tables."""
    opened = _open(session, out, hold_out)
    with stages() as progress:
        begin_loading(progress)
        from anglecam.report.session_tables import loop_table, model_table
        from anglecam.workflow.session import loop_input
        from anglecam.workflow.session_results import REPORT, write_closed

        measured = measure_recordings(opened, out, progress)
        shown = loop_input(measured)
        if shown.differs:
            errors.print(
                "measuring corrected an effect of the camera (lens, slanted view, or a marker off the axis); the loop "
                "starts from the uncorrected angles and reports the effect if its size exceeds the stated uncertainty"
            )
    with stages(lines=True) as progress:
        closed = write_closed(measured, shown, out, hold_out=hold_out, progress=progress, run=this_run())
    report_file("loop", out / "loop.json")
    report(report=str(out / REPORT) if (out / REPORT).exists() else None, notes=list(measured.notes))
    screen.print(model_table(closed.models))
    screen.print(loop_table(closed.verdict, closed.experiment))
    for line in closed.missing:
        errors.print(printable(f"{session}: {line}"), soft_wrap=True)
    if (out / REPORT).exists():
        screen.print(f"report: {out / REPORT}", soft_wrap=True)
    return measured, closed.verdict


def _open(session: Path, out: Path, hold_out: Sequence[str] = ()) -> Session:
    """Read what is declared about a session, and check that its results can be written."""
    opened = read_session(session)
    require_recordings(opened, hold_out)
    make_folder(out)
    for note in opened.notes:
        errors.print(printable(note))
    return opened


def measure_recordings(opened: Session, out: Path, progress: Progress) -> MeasuredSession:
    """Measure a session's clips and write their series to ``out``."""
    from anglecam.workflow.session import measure_session

    measured = measure_session(opened, out=out, progress=progress)
    for note in measured.notes:
        screen.print(printable(note), soft_wrap=True, highlight=False, markup=False)
    tell(measured.problems)
    if measured.problems and measured.records:
        used = ", ".join(record.name for record in measured.records)
        screen.print(printable(f"{opened.directory}: what follows is of {used} alone"), soft_wrap=True)
    if not measured.records:
        raise InputError(f"{opened.directory}: no recording can be used")
    return measured
