"""`anglecam batch`: measure folders of clips, each clip once, on one machine or several."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from anglecam.cli.json_output import report
from anglecam.errors import RigError
from anglecam.terminal import errors, screen
from anglecam.threads import cores


def batch(
    folders: Annotated[
        list[str],
        typer.Argument(metavar="FOLDER", help="Folders, clips, globs, @list.txt; or addresses such as s3://lab/clips."),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for results and index; made if missing.")],
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", min=1, metavar="N", help="Clips at a time, one core each; default all cores."),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option("--dask", metavar="ADDRESS", help="A Dask scheduler; local starts one here."),
    ] = None,
    close: Annotated[bool, typer.Option("--close", help="Find what each session's model lacks.")] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Measure again the clips that failed.")] = False,
    prune: Annotated[bool, typer.Option("--prune", help="Remove stale results at the end, and list them.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    log: Annotated[Path | None, typer.Option("--log", help="Append a line of JSON per clip to this file.")] = None,
    time_limit: Annotated[
        float | None,
        typer.Option("--time-limit", min=0.001, metavar="S", help="Time limit for a clip; default by its size."),
    ] = None,
    rig: Annotated[
        Path | None, typer.Option("--rig", help="Rig file for all clips; default: rig.yaml beside each clip.")
    ] = None,
) -> None:
    """Measure folders of clips, each clip once, identify the sessions among them, and write an index of all clips."""
    from anglecam.batch.row import DOUBTFUL, FAILED, OK, STALE, TRUNCATED
    from anglecam.batch.run import Options, run_batch  # imports fsspec and pyarrow, which no other command needs

    if dask is not None and dask != "local" and jobs is not None:
        raise RigError("--jobs: with a Dask scheduler, its workers determine how many clips are measured at a time")
    try:
        result = run_batch(
            folders,
            out,
            Options(
                jobs=jobs or cores(),
                dask=dask,
                close=close,
                retry_failed=retry_failed,
                prune=prune,
                quiet=quiet,
                log=log,
                time_limit=time_limit,
                rig=rig,
            ),
        )
    except KeyboardInterrupt:
        errors.print("stopped; the same call goes on from here")
        raise typer.Exit(130) from None
    for pruned in result.pruned:
        screen.print(pruned.line, soft_wrap=True, highlight=False)
    if not quiet:
        counts = Counter(row.status for row in result.rows)
        named = (f"{counts[status]} {status}" for status in (OK, TRUNCATED, DOUBTFUL, STALE, FAILED) if counts[status])
        summary = ", ".join(named)
        screen.print(f"{len(result.rows)} clips{': ' if summary else ''}{summary}; {out / 'index.csv'}", soft_wrap=True)
    report(
        clips=[asdict(row) for row in result.rows],
        index=str(out / "index.csv"),
        problems=[problem.one_line for problem in result.problems],
    )
    for problem in result.problems:
        errors.print(str(problem))
    if result.problems:
        raise typer.Exit(2 if any(isinstance(problem, RigError) for problem in result.problems) else 1)
