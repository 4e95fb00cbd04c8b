"""Simulates the recordings of a spec, draws them, and writes session and truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from rich.progress import Progress, TaskID

from synth.clip import UNFINISHED, clip_writer, file_name
from synth.errors import SpecError
from synth.render import Solo, Studio, studio
from synth.spec import Spec
from synth.take import Take, perform, view
from synth.truth import fingerprint, write_facts, write_take


def draw_session(path: Path, spec: Spec, out: Path, truth: Path, progress: Progress, bar: TaskID) -> None:
    """Draw a session.

    Parameters
    ----------
    path : Path
        The spec, for messages.
    spec : Spec
        Its content.
    out, truth : Path
        As of `synth.session.render`, which also states what is raised.
    progress : Progress
        Shows the stage and the number of frames.
    bar : TaskID
        The task of ``progress`` that shows them.
    """
    progress.update(bar, description="simulating the motion")
    seen = view(spec)
    try:
        takes = perform(spec, seen)
    except SpecError as error:
        raise SpecError(f"{path}: {error}") from error
    session = {"rig.yaml"} | {file_name(take.recording.name, spec.camera) for take in takes}
    session |= {f"{take.recording.name}.command.csv" for take in takes if take.command is not None}
    secret = {"truth.json"} | {f"{take.recording.name}.truth.csv" for take in takes}
    for folder, ours in ((out, session), (truth, secret)):
        _free(folder, ours)

    (out / "rig.yaml").write_text(yaml.safe_dump(spec.declare, sort_keys=False), encoding="utf-8")
    for take in takes:
        if take.command is not None:
            _write_command(out / f"{take.recording.name}.command.csv", take)

    total = sum(len(take.table.stamps) for take in takes)
    progress.update(bar, description="starting the renderer and measuring its edges")
    with studio(spec, seen, total) as drawing:
        write_facts(truth, spec, seen, asdict(drawing.edge_error()))
        progress.update(bar, total=total)
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


def _free(folder: Path, ours: set[str]) -> None:
    """Create a folder; raise `SpecError` if it holds files that are not of this session."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        there = {path.name for path in folder.iterdir() if not path.name.startswith(UNFINISHED)}
    except OSError as error:
        raise SpecError(f"{folder}: cannot be used ({error.strerror})") from error
    if foreign := sorted(there - ours):
        raise SpecError(f"{folder}: contains {foreign[0]}, which is not part of this session; give an empty folder")
