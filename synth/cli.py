"""The command ``synth``: render a session, score anglecam's results against the truth, show the shipped specs.

Each command reads its spec first and then imports what draws, so that help and errors appear at once.
"""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from anglecam.prepare import prepare_kernels
from synth.errors import RenderError, SpecError

app = typer.Typer(add_completion=False, no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False)


@app.command("render")
def render_command(
    spec: Annotated[Path, typer.Argument(help="spec of the session, YAML")],
    out: Annotated[Path, typer.Option(help="folder for the session")],
    truth: Annotated[Path, typer.Option(help="folder for the truth, apart from --out")],
) -> None:
    """Render a session of clips and write the true motion to a separate folder."""
    from synth.session import render

    render(spec, out, truth)


@app.command("score")
def score_command(
    result: Annotated[Path, typer.Argument(help="folder written by anglecam")],
    truth: Annotated[Path, typer.Option(help="folder of the truth")],
) -> None:
    """Compare anglecam's results with the truth."""
    from synth.score import score

    score(result, truth, Console())


@app.command("gallery")
def gallery_command(
    out: Annotated[Path, typer.Option(help="folder for gallery.png")],
    specs: Annotated[list[Path] | None, typer.Argument(help="specs, YAML; all of configs/ by default")] = None,
) -> None:
    """Render one frame of every spec to a contact sheet."""
    from synth.spec import read_spec

    read = {path: read_spec(path) for path in specs or []}
    prepare_kernels("synth")
    from synth.gallery import gallery

    Console().print(str(gallery(read, out)), soft_wrap=True)


def main() -> None:
    """Run the command; one line on stderr and exit status 2 for a wrong spec, 1 for a machine that cannot draw."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that unfinished clips and workers are cleaned up
    try:
        app()
    except SpecError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except (RenderError, OSError) as error:
        print(error, file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
