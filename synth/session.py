"""Renders a spec to a session folder, and writes the truth to a separate folder."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn, TimeElapsedColumn
from rich.text import Text

from anglecam.prepare import prepare_kernels
from synth.errors import SpecError
from synth.spec import read_spec


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
    _apart(out, truth)
    prepare_kernels("synth")
    with progress_bar() as progress:
        bar = progress.add_task("loading", total=None)
        from synth.draw_session import draw_session  # loads what simulates and draws, longer than a wrong call may take

        draw_session(path, spec, out, truth, progress, bar)


def _apart(out: Path, truth: Path) -> None:
    here, there = out.resolve(), truth.resolve()
    if here == there or here in there.parents or there in here.parents:
        raise SpecError(f"--truth {truth}: must not be --out, inside it or around it, or the truth leaks")


def progress_bar() -> Progress:
    """Return a progress bar on standard error, which is shown on a terminal only."""
    console = Console(stderr=True)
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        _Frames(),
        TimeElapsedColumn(),
        console=console,
        disable=not console.is_terminal,
    )


class _Frames(ProgressColumn):
    """How many frames are done, where their number is known."""

    def render(self, task: Task) -> Text:
        """Return the column's text."""
        return Text("" if task.total is None else f"{task.completed:.0f} of {task.total:.0f} frames")
