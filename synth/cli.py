"""The command ``synth``: render a session, score what was found in it, show what there is.

Each command imports what it needs when it is called: help and mistakes in the call are answered at once.
"""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from synth.errors import RenderError, SpecError

app = typer.Typer(add_completion=False, no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False)


@app.command("render")
def render_command(
    spec: Annotated[Path, typer.Argument(help="what is to be filmed, YAML")],
    out: Annotated[Path, typer.Option(help="folder for the session")],
    truth: Annotated[Path, typer.Option(help="folder for the truth, apart from --out")],
) -> None:
    """Render a session of clips whose truth is known and kept apart."""
    from synth.session import render

    render(spec, out, truth)


@app.command("score")
def score_command(
    result: Annotated[Path, typer.Argument(help="folder that anglecam wrote")],
    truth: Annotated[Path, typer.Option(help="folder of the truth")],
) -> None:
    """Hold what anglecam found against the truth."""
    from synth.score import score

    score(result, truth, Console())


@app.command("gallery")
def gallery_command(
    out: Annotated[Path, typer.Option(help="folder for gallery.png")],
    specs: Annotated[list[Path] | None, typer.Argument(help="specs, YAML; all of configs/ where none is named")] = None,
) -> None:
    """Render one frame of every spec to a contact sheet."""
    from synth.gallery import gallery

    Console().print(str(gallery(specs or [], out)), soft_wrap=True)


def main() -> None:
    """Run the command; one line on stderr and exit status 2 for a wrong spec, 1 for a machine that cannot draw."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that clips in the making and workers are cleared away
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
