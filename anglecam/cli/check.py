"""The command `check`: will it work, and what would help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from anglecam.cli.json_output import report
from anglecam.cli.options import FirstFrame, RigFile
from anglecam.cli.progress import begin_loading, stages
from anglecam.errors import printable
from anglecam.io.clip_files import read_clip_files
from anglecam.io.files import write_json
from anglecam.io.rig import Rig, read_rig
from anglecam.io.session import command_of
from anglecam.progress import within
from anglecam.terminal import make_folder, screen


def check(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A clip; its first seconds are read.")],
    rig: RigFile = None,
    command: Annotated[
        Path | None, typer.Option("--command", help="The command that shall be played; default: as in the clip.")
    ] = None,
    first: FirstFrame = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for NAME.check.json; made if missing.")] = None,
) -> None:
    """Predict from a few seconds of film how sure the angle will be, what could be seen, and what would help."""
    declared = read_rig(rig) if rig else None
    play = None if command is None else command_of(command, declared or Rig())
    if out is not None:
        make_folder(out)
    read_clip_files(clip, declared)
    with stages() as progress:
        begin_loading(progress)
        from anglecam.report.check_tables import advice_table, prediction_table, smallest_table
        from anglecam.workflow.check import check_clip

        found = check_clip(clip, declared, play, first, progress=within(progress, clip.name))
    for note in found.notes:
        screen.print(printable(f"{clip}: {note}"), soft_wrap=True, highlight=False, markup=False)
    report(check=found.as_dict())
    screen.print(prediction_table(found))
    if found.sizes is not None and found.sizes.doubt is not None:
        screen.print(printable(f"{clip}: {found.sizes.doubt}"), soft_wrap=True, highlight=False)
    if found.why_no_sizes is not None:
        screen.print(printable(f"{clip}: no smallest sizes: {found.why_no_sizes}"), soft_wrap=True, highlight=False)
    elif found.sizes is not None:
        screen.print(smallest_table(found))
    screen.print(advice_table(found))
    if out is not None:
        write_json(out / f"{found.name}.check.json", found.as_dict())
