"""Renders a spec to a session folder, and writes the truth to a separate folder."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from synth.clip import UNFINISHED, clip_writer, file_name
from synth.errors import SpecError
from synth.render import Solo, Studio, studio
from synth.spec import read_spec
from synth.take import Take, perform, view
from synth.truth import fingerprint, write_facts, write_take


def render(path: Path, out: Path, truth: Path) -> None:
    """Render a session.

    Parameters
    ----------
    path : Path
        The spec.
    out : Path
        Folder for clips, commands and ``rig.yaml``; contains nothing of the truth.
    truth : Path
        Folder for the truth. Neither folder may be the other or lie inside it.

    Raises
    ------
    SpecError
        If the spec is wrong, the folders overlap or hold other files, or a motion exceeds the mechanism's range.
    RenderError
        If this machine cannot draw off-screen.
    """
    spec = read_spec(path)
    seen = view(spec)
    try:
        takes = perform(spec, seen)
    except SpecError as error:
        raise SpecError(f"{path}: {error}") from error
    session = {"rig.yaml"} | {file_name(take.recording.name, spec.camera) for take in takes}
    session |= {f"{take.recording.name}.command.csv" for take in takes if take.command is not None}
    secret = {"truth.json"} | {f"{take.recording.name}.truth.csv" for take in takes}
    _apart(out, truth)
    for folder, ours in ((out, session), (truth, secret)):
        _free(folder, ours)

    (out / "rig.yaml").write_text(yaml.safe_dump(spec.declare, sort_keys=False), encoding="utf-8")
    for take in takes:
        if take.command is not None:
            _write_command(out / f"{take.recording.name}.command.csv", take)

    total = sum(len(take.table.stamps) for take in takes)
    with progress_bar() as progress, studio(spec, seen, total) as drawing:
        bar = progress.add_task("render", total=total)
        write_facts(truth, spec, seen, asdict(drawing.edge_error()))
        for take in takes:
            progress.update(bar, description=f"render {take.recording.name}")
            fingerprints = []
            with clip_writer(out / file_name(take.recording.name, spec.camera), spec.camera, take.table) as write:
                for frame in _with_duplicates(take, drawing):
                    write(frame)
                    fingerprints.append(fingerprint(frame))
                    progress.advance(bar)
            write_take(truth, seen, take, fingerprints)


def _with_duplicates(take: Take, drawing: Studio | Solo) -> Iterator[NDArray[np.uint8]]:
    """Yield every frame of the file; a duplicate repeats the previous picture, including its noise."""
    drawn = drawing.film(take, np.flatnonzero(~take.table.repeats).tolist())
    frame = next(drawn)
    yield frame
    for repeats in take.table.repeats[1:]:
        frame = frame if repeats else next(drawn)
        yield frame


def _write_command(path: Path, take: Take) -> None:
    assert take.command is not None
    lines = [f"{time:.6f},{level:.6f}" for time, level in np.asarray(take.command)]
    path.write_text("\n".join(["time_s,command_deg", *lines]) + "\n", encoding="utf-8")


def _apart(out: Path, truth: Path) -> None:
    here, there = out.resolve(), truth.resolve()
    if here == there or here in there.parents or there in here.parents:
        raise SpecError(f"--truth {truth}: must not be --out, inside it or around it, or the truth leaks")


def _free(folder: Path, ours: set[str]) -> None:
    """Create a folder; raise `SpecError` if it holds files that are not of this session."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        there = {path.name for path in folder.iterdir() if not path.name.startswith(UNFINISHED)}
    except OSError as error:
        raise SpecError(f"{folder}: cannot be used ({error.strerror})") from error
    if foreign := sorted(there - ours):
        raise SpecError(f"{folder}: contains {foreign[0]}, which is not part of this session; give an empty folder")


def progress_bar() -> Progress:
    """Return a progress bar on standard error."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("frames"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
