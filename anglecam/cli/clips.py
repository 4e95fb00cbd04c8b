"""The commands that work on single clips: `measure`, `budget`, `calibrate`.

What is wrong with a call is found before the modules that measure are loaded, which takes longer than many a call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anglecam.cli.documents import calibration_as_dict, clip_as_dict
from anglecam.cli.json_output import report
from anglecam.cli.options import FirstFrame, LastFrame, Out, RigFile
from anglecam.cli.progress import begin_loading, leave, stages, tell
from anglecam.cli.this_run import this_run
from anglecam.errors import AnglecamError, InputError, RigError, blame, printable
from anglecam.io.clip_files import ClipFiles, FrameRange, read_clip_files
from anglecam.io.files import require_film_file
from anglecam.io.netcdf_parquet import Also
from anglecam.io.rig import Rig, RigFrames, read_rig
from anglecam.io.session import (
    SERIES_ENDING,
    find_clips,
    find_measurable,
    is_film_of_images,
    recording_name,
    rig_beside,
)
from anglecam.io.tracks.files import tracker_names
from anglecam.progress import Progress, Stage, within
from anglecam.terminal import errors, make_folder, screen

if TYPE_CHECKING:
    from anglecam.measurement.clip import Measurement
    from anglecam.measurement.tracks import MeasuredTracks
    from anglecam.workflow.clip import Source


class Bodies(StrEnum):
    """Which of the bodies that move in a film are measured."""

    first = "first"
    all = "all"


def measure(
    clips: Annotated[
        list[Path],
        typer.Argument(metavar="CLIP", help=f"Clips, folders of clips, or tracks from {tracker_names()}."),
    ],
    out: Out,
    rig: RigFile = None,
    first: FirstFrame = None,
    last: LastFrame = None,
    overlay: Annotated[bool, typer.Option("--overlay", help="Also write NAME.overlay.mp4.")] = False,
    bodies: Annotated[
        Bodies, typer.Option("--bodies", help="all: also find and measure what else turns, NAME.b2.angles.csv, ….")
    ] = Bodies.first,
    also: Annotated[
        list[Also] | None, typer.Option("--also", help="Also write NAME.angles.nc or .parquet; repeatable.")
    ] = None,
) -> None:
    """Measure the angle in every frame: NAME.angles.csv, a plot and a page with the film for each clip."""
    run = this_run(rig)
    declared = read_rig(rig) if rig else None
    asked, refused = _read_files(clips, out, declared, (first, last), lambda f: _clips_and_tracks(f, declared))
    with stages() as progress:
        begin_loading(progress)
        from anglecam.measurement.step_response import responses_as_dicts
        from anglecam.report.clip_tables import response_table, series_table
        from anglecam.workflow.clip import open_files, write_clip_overlay, write_clip_page, write_measurement

        measured, tables = [], []

        def measure_one(files: ClipFiles, progress: Progress) -> Measurement | MeasuredTracks:
            source = open_files(files)
            measurement = _measure(source, progress, every_body=bodies is Bodies.all)
            name = measurement.series.name
            progress(Stage("writing the series and its plot"))
            answers = write_measurement(measurement, source.command, out, also or ())
            progress(Stage("writing the page"))
            write_clip_page(source, measurement, answers, out, run)
            if answers:
                tables.append(response_table(files.path.name, answers))
            if overlay:
                write_clip_overlay(source, measurement, out, progress)
            measured.append(measurement)
            written = {"series": str(out / f"{name}{SERIES_ENDING}"), "responses": responses_as_dicts(answers)}
            report(clips=[clip_as_dict(files.path, measurement) | written])
            return measurement

        problems = _for_each(asked, progress, measure_one)
    if measured:
        screen.print(series_table(measured))
    for table in tables:
        screen.print(table)
    tell(problems)
    leave([*refused, *problems])


def budget(
    clips: Annotated[list[Path], typer.Argument(metavar="CLIP", help="Clips, or folders of clips.")],
    out: Out,
    rig: RigFile = None,
    first: FirstFrame = None,
    last: LastFrame = None,
) -> None:
    """Write the budget of the angle's uncertainty: NAME.budget.json and a page for each clip."""
    run = this_run(rig)
    declared = read_rig(rig) if rig else None
    asked, refused = _read_files(clips, out, declared, (first, last), find_clips, _require_film)
    with stages() as progress:
        begin_loading(progress)
        from anglecam.budget.clip import budget_as_dict
        from anglecam.measurement.clip import Measurement
        from anglecam.report.budget_page import budget_table, write_budget
        from anglecam.report.origin import origin_of
        from anglecam.workflow.clip import inputs_of, open_files

        def budget_one(files: ClipFiles, progress: Progress) -> Measurement | MeasuredTracks:
            source = open_files(files)
            measurement = _measure(source, progress)
            assert isinstance(measurement, Measurement)
            assert source.film is not None
            made = origin_of(inputs_of(files.path, source.rig, run), run)
            progress(Stage("working out the budget and writing its page"))
            found = write_budget(source.film, measurement, source.rig, out, made)
            screen.print(budget_table(found))
            report(budgets=[budget_as_dict(found)])
            return measurement

        problems = _for_each(asked, progress, budget_one)
    tell(problems)
    leave([*refused, *problems])


def calibrate(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A clip of a chessboard, held still in many poses.")],
    out: Out,
    board: Annotated[str, typer.Option("--board", help="Inner corners, COLUMNSxROWS.")] = "9x6",
) -> None:
    """Find camera matrix and lens distortion from a chessboard: NAME.calibration.yaml and a figure."""
    try:
        columns, rows = (int(side) for side in board.lower().split("x"))
    except ValueError:
        raise RigError(f"--board {board}: give the number of inner corners, such as 9x6") from None
    make_folder(out)
    if not clip.is_dir():
        require_film_file(clip)
    with stages() as progress, blame(clip):
        begin_loading(progress)
        from anglecam.camera.calibrate import calibrate_clip
        from anglecam.camera.calibration import write_calibration
        from anglecam.report.calibration_figure import plot_calibration
        from anglecam.video.open_film import open_film

        # the times of photographs of the board do not matter
        film = open_film(clip, RigFrames(rate_hz=1.0) if clip.is_dir() else None)
        found = calibrate_clip(film, (columns, rows), progress=progress)
    path = out / f"{clip.stem}.calibration.yaml"
    write_calibration(found.calibration, path)
    report(calibration=calibration_as_dict(path, found))
    plot_calibration(found, out / f"{clip.stem}.calibration.png", clip.name)
    terms = ", ".join(found.terms) or "no distortion"
    screen.print(f"{path}: {len(found.views)} views, {terms}", soft_wrap=True)
    for note in found.notes:
        errors.print(printable(note))


def _read_files(
    paths: list[Path],
    out: Path,
    rig: Rig | None,
    frames: FrameRange,
    list_folder: Callable[[Path], list[Path]],
    require: Callable[[ClipFiles], None] = lambda files: None,
) -> tuple[list[ClipFiles], list[AnglecamError]]:
    """Return the clips whose files are as they should be, and what is wrong with the others; leave where none is.

    What is wrong is printed before the first clip is measured. Of clips whose results would have one name, the first is
    taken.

    Raises
    ------
    RigError
        Where the results cannot be written to ``out``.
    """
    make_folder(out)
    asked: list[ClipFiles] = []
    problems: list[AnglecamError] = []
    names: dict[str, Path] = {}
    for clip in _expand(paths, problems, list_folder):
        other = names.setdefault(recording_name(clip), clip)
        try:
            if other is not clip:
                raise InputError(f"{clip}: {other} has the same name; measure them to separate folders")
            files = read_clip_files(clip, rig, frames)
            require(files)
            asked.append(files)
        except AnglecamError as problem:
            problems.append(problem)
    tell(problems)
    if not asked:
        leave(problems)
    return asked, problems


def _require_film(files: ClipFiles) -> None:
    if files.is_tracks:
        raise InputError(f"{files.path}: a budget needs the pictures; give the clip")


def _for_each(
    asked: list[ClipFiles],
    progress: Progress,
    work: Callable[[ClipFiles, Progress], Measurement | MeasuredTracks],
) -> list[AnglecamError]:
    """Do the work for each clip and return the problems; a problem with one clip does not stop the others."""
    problems: list[AnglecamError] = []
    for files in asked:
        try:
            measurement = work(files, within(progress, files.path.name))
            if measurement.doubt:
                raise InputError(f"{files.path}: {measurement.doubt}")
        except AnglecamError as problem:
            problems.append(problem)
        except OSError as problem:
            problems.append(InputError(f"{files.path}: its results cannot be written ({problem.strerror or problem})"))
    return problems


def _expand(
    paths: list[Path], problems: list[AnglecamError], list_folder: Callable[[Path], list[Path]]
) -> Iterator[Path]:
    for path in paths:
        if path.is_dir():
            found = list_folder(path) or ([path] if is_film_of_images(path) else [])
            if not found:
                problems.append(InputError(f"{path}: no clip in this folder"))
            yield from found
        else:
            yield path


def _clips_and_tracks(folder: Path, rig: Rig | None) -> list[Path]:
    try:
        found, idle = find_measurable(folder, rig_beside(folder) if rig is None else rig)
    except RigError:  # every clip of the folder will report it
        return find_clips(folder)
    for note in idle:
        errors.print(printable(note))
    return found


def _measure(source: Source, progress: Progress, *, every_body: bool = False) -> Measurement | MeasuredTracks:
    from anglecam.workflow.clip import measure_source

    measurement = measure_source(source, progress=progress, every_body=every_body)
    for note in measurement.notes:
        screen.print(printable(f"{source.path}: {note}"), soft_wrap=True, highlight=False, markup=False)
    return measurement
