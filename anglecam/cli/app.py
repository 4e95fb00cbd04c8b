"""The command line: one thin command a verb.

What goes wrong with one clip is one line on standard error and exit status 1, and the rest is done; what is wrong
with the call or a rig file is one line and exit status 2. Progress is shown on a terminal only. What a verb needs is
imported where it is needed: to load all of it takes longer than many a call.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from anglecam import __version__
from anglecam.cli.batch import batch
from anglecam.cli.neck import app as neck
from anglecam.errors import AnglecamError, InputError, RigError, blame, printable
from anglecam.io.netcdf_parquet import Also, write_also
from anglecam.io.rig import Rig, read_rig
from anglecam.io.session import (
    Session,
    command_beside,
    find_clips,
    find_measurable,
    read_session,
    recording_name,
    rig_beside,
)
from anglecam.io.tracks.files import tracker_names
from anglecam.terminal import errors, make_folder, screen

if TYPE_CHECKING:
    from anglecam.identification.identify import Estimator
    from anglecam.measurement.clip import Measurement
    from anglecam.measurement.tracks import MeasuredTracks
    from anglecam.workflow.recordings import Measured

app = typer.Typer(
    name="anglecam",
    help="From clips of a moving mechanism to its angle, its model, and what the model lacks.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.add_typer(neck, name="neck")
app.command()(batch)

Out = Annotated[Path, typer.Option("--out", help="Folder for the results; made if missing.")]
RigFile = Annotated[
    Path | None, typer.Option("--rig", help="Rig file for all clips; default: rig.yaml beside each clip.")
]
SessionFolder = Annotated[Path, typer.Argument(metavar="SESSION", help="Folder of clips or *.angles.csv of one rig.")]


def _version(wanted: bool) -> None:
    if wanted:
        print(f"anglecam {__version__}")
        raise typer.Exit


@app.callback()
def _anglecam(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """From clips of a moving mechanism to its angle, its model, and what the model lacks."""


@app.command()
def measure(
    clips: Annotated[
        list[Path],
        typer.Argument(metavar="CLIP", help=f"Clips, folders of clips, or tracks from {tracker_names()}."),
    ],
    out: Out,
    rig: RigFile = None,
    overlay: Annotated[bool, typer.Option("--overlay", help="Also write NAME.overlay.mp4.")] = False,
    also: Annotated[
        list[Also] | None, typer.Option("--also", help="Also write NAME.angles.nc or .parquet; repeatable.")
    ] = None,
) -> None:
    """Measure the angle in every frame: NAME.angles.csv and a plot for each clip, and how it answers every change."""
    from anglecam.report.summary import response_table, series_table
    from anglecam.video.overlay import write_overlay
    from anglecam.workflow.clip import write_measurement

    declared = read_rig(rig) if rig else None
    make_folder(out)
    problems: list[AnglecamError] = []
    done: dict[str, Path] = {}
    rows, tables = [], []
    with _progress() as bars:
        for clip in _expand(clips, problems, lambda folder: _clips_and_tracks(folder, declared)):
            try:
                name = recording_name(clip)
                if name in done:
                    raise InputError(f"{clip}: {done[name]} has the same name; measure them to separate folders")
                done[name] = clip
                measurement = _measure(clip, declared if declared is not None else rig_beside(clip), bars)
                answers = write_measurement(measurement, command_beside(clip), out)
                write_also(measurement.series, also or (), out / name)
                if answers:
                    tables.append(response_table(clip.name, answers))
                if overlay:
                    write_overlay(_film(clip, measurement), measurement, out / f"{name}.overlay.mp4")
                rows.append(measurement)
                if measurement.truncated:
                    raise InputError(f"{clip}: {measurement.truncated}")
            except AnglecamError as problem:
                problems.append(problem)
            except OSError as problem:
                problems.append(InputError(f"{clip}: its results cannot be written ({problem.strerror or problem})"))
    if rows:
        screen.print(series_table(rows))
    for table in tables:
        screen.print(table)
    _end(problems)


@app.command()
def budget(
    clips: Annotated[list[Path], typer.Argument(metavar="CLIP", help="Clips, or folders of clips.")],
    out: Out,
    rig: RigFile = None,
) -> None:
    """Say what the angle's uncertainty is made of: NAME.budget.json and a page for each clip."""
    from anglecam.measurement.tracks import MeasuredTracks
    from anglecam.report.budget_page import budget_table, write_budget

    declared = read_rig(rig) if rig else None
    make_folder(out)
    problems: list[AnglecamError] = []
    with _progress() as bars:
        for clip in _expand(clips, problems, find_clips):
            try:
                used = declared if declared is not None else rig_beside(clip)
                measurement = _measure(clip, used, bars)
                if isinstance(measurement, MeasuredTracks):
                    raise InputError(f"{clip}: a budget needs the pictures; give the clip")
                screen.print(budget_table(write_budget(clip, measurement, used, out)))
                if measurement.truncated:
                    raise InputError(f"{clip}: {measurement.truncated}")
            except AnglecamError as problem:
                problems.append(problem)
            except OSError as problem:
                problems.append(InputError(f"{clip}: its results cannot be written ({problem.strerror or problem})"))
    _end(problems)


@app.command()
def calibrate(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A clip of a chessboard, held still in many poses.")],
    out: Out,
    board: Annotated[str, typer.Option("--board", help="Inner corners, COLUMNSxROWS.")] = "9x6",
) -> None:
    """Find camera matrix and lens distortion from a chessboard: NAME.calibration.yaml and a figure."""
    from anglecam.camera.calibrate import calibrate_clip
    from anglecam.camera.calibration import write_calibration
    from anglecam.report.calibration_figure import plot_calibration

    try:
        columns, rows = (int(side) for side in board.lower().split("x"))
    except ValueError:
        raise RigError(f"--board {board}: say how many inner corners there are, such as 9x6") from None
    make_folder(out)
    with blame(clip):
        found = calibrate_clip(clip, (columns, rows))
    write_calibration(found.calibration, out / f"{clip.stem}.calibration.yaml")
    plot_calibration(found, out / f"{clip.stem}.calibration.png", clip.name)
    terms = ", ".join(found.terms) or "no distortion"
    screen.print(f"{out / clip.stem}.calibration.yaml: {len(found.views)} views, {terms}", soft_wrap=True)
    for note in found.notes:
        errors.print(printable(note))


@app.command()
def identify(
    session: SessionFolder,
    out: Out,
    estimator: Annotated[str, typer.Option("--estimator", help="One of ekf, oe2, oe3, neck.")] = "oe2",
    neck: Annotated[
        Path | None, typer.Option("--neck", help="What is known of the neck, for --estimator neck; else the paper's.")
    ] = None,
) -> None:
    """Fit a model to a session: model.json, and model.mat for MATLAB."""
    from anglecam.identification.identify import ESTIMATORS
    from anglecam.io.neck_file import read_neck
    from anglecam.report.summary import model_table
    from anglecam.workflow.session import identify_session

    if estimator not in ESTIMATORS:  # before any clip is measured
        raise RigError(f"--estimator {estimator}: choose one of {', '.join(ESTIMATORS)}")
    chosen: Estimator = estimator  # type: ignore[assignment]
    if neck is not None and estimator != "neck":
        raise RigError(f"--neck {neck}: only --estimator neck looks at it")
    declared = read_neck(neck).large_angle if estimator == "neck" else None
    opened, measured = _open(session, out)
    model = identify_session(opened, measured, out, chosen, declared)
    screen.print(model_table([model]))
    for doubt in model.doubts:
        screen.print(doubt, soft_wrap=True, highlight=False, markup=False)
    if estimator == "neck" and neck is None:
        screen.print("the neck is the paper's: one spring, constant γ; declare yours with --neck", soft_wrap=True)
    _end(measured.problems)


@app.command()
def close(
    session: SessionFolder,
    out: Out,
    hold_out: Annotated[
        list[str] | None, typer.Option("--hold-out", metavar="NAME", help="A recording to predict only; repeatable.")
    ] = None,
) -> None:
    """Find what the model lacks: loop.json, report.html and, where it helps, the command to play next."""
    from anglecam.report.summary import loop_table, model_table
    from anglecam.workflow.recordings import shown_to_loop
    from anglecam.workflow.session import close_session

    opened, measured = _open(session, out)
    names = [*opened.rig.held_out, *(hold_out or ())]
    unknown = sorted(set(names) - {r.name for r in opened.recordings})
    if unknown:
        raise RigError(f"--hold-out {unknown[0]}: no such recording in {session}")
    shown = shown_to_loop(opened, measured)
    if shown.differs:
        errors.print(
            "measuring has put right what the pictures show of a lens, a slanted view or a mark beside the axis; "
            "the loop begins with what they show, and names it if it is larger than that is sure"
        )
    with _progress() as bars:
        bar = bars.add_task("", total=None)
        closed = close_session(
            opened, measured, shown, out, held_out=names, progress=lambda stage: bars.update(bar, description=stage)
        )
        bars.update(bar, description="done", completed=1, total=1)
    screen.print(model_table(closed.models))
    screen.print(loop_table(closed.verdict, closed.experiment))
    screen.print(f"report: {out / 'report.html'}", soft_wrap=True)
    _end(measured.problems)


def main() -> None:
    """Run the command line; every failure is one line on standard error and an exit status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a file's name may be of bytes that are no text
            stream.reconfigure(errors="backslashreplace")
    try:
        with blame(Path("anglecam")):
            app()
    except InputError as problem:
        errors.print(str(problem))
        sys.exit(1)
    except RigError as problem:
        errors.print(str(problem))
        sys.exit(2)
    except KeyboardInterrupt:
        errors.print("anglecam: interrupted")
        sys.exit(1)


def _open(session: Path, out: Path) -> tuple[Session, Measured]:
    """Read a session and measure its clips, writing their series to ``out``."""
    from anglecam.workflow.recordings import measure_session

    opened = read_session(session)
    make_folder(out)
    for note in opened.notes:
        errors.print(printable(note))
    with _progress() as bars:
        tasks = {r.name: bars.add_task(r.source.name, total=None) for r in opened.recordings if r.is_clip}
        measured = measure_session(
            opened, out=out, progress=lambda name, n, total: bars.update(tasks[name], completed=n, total=total or None)
        )
    for note in measured.notes:
        screen.print(printable(note), soft_wrap=True, highlight=False, markup=False)
    if not measured.records:
        for problem in measured.problems:
            errors.print(str(problem))
        raise InputError(f"{session}: no recording can be used")
    return opened, measured


def _clips_and_tracks(folder: Path, rig: Rig | None) -> list[Path]:
    try:
        found, idle = find_measurable(folder, rig_beside(folder) if rig is None else rig)
    except RigError:  # said of each clip that it is for
        return find_clips(folder)
    for note in idle:
        errors.print(printable(note))
    return found


def _expand(
    paths: list[Path], problems: list[AnglecamError], list_folder: Callable[[Path], list[Path]]
) -> Iterator[Path]:
    for path in paths:
        if path.is_dir():
            found = list_folder(path)
            if not found:
                problems.append(InputError(f"{path}: no clip in this folder"))
            yield from found
        else:
            yield path


def _film(source: Path, measurement: Measurement | MeasuredTracks) -> Path:
    """Return the film to draw an overlay on."""
    from anglecam.measurement.tracks import MeasuredTracks

    if not isinstance(measurement, MeasuredTracks):
        return source
    if measurement.film is None:
        raise InputError(f"{source}: no overlay: the clip is not beside the tracks")
    return measurement.film


def _measure(clip: Path, rig: Rig, bars: Progress) -> Measurement | MeasuredTracks:
    from anglecam.workflow.recordings import measure_recording

    bar = bars.add_task(clip.name, total=None)
    with blame(clip):
        measurement = measure_recording(
            clip,
            rig,
            command_beside(clip),
            progress=lambda n, total: bars.update(bar, completed=n, total=total or None),
        )
    for note in measurement.notes:
        screen.print(printable(f"{clip}: {note}"), soft_wrap=True, highlight=False, markup=False)
    return measurement


@contextmanager
def _progress() -> Iterator[Progress]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=errors, disable=not errors.is_terminal) as bars:
        yield bars


def _end(problems: list[AnglecamError] | tuple[InputError, ...]) -> None:
    """Say what went wrong, a line each, and leave with the contract's exit status."""
    for problem in problems:
        errors.print(str(problem))
    if problems:
        raise typer.Exit(2 if any(isinstance(p, RigError) for p in problems) else 1)
