"""The command line: one thin command a verb.

A problem with one clip is one line on standard error and exit status 1, and the other clips are still processed. A
problem with the call or a rig file is one line and exit status 2. Progress is shown on a terminal only.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Annotated

import typer

from anglecam.cli.batch import batch
from anglecam.cli.certify import certify
from anglecam.cli.check import check
from anglecam.cli.clips import budget, calibrate, measure
from anglecam.cli.doctor import doctor
from anglecam.cli.estimator_option import EstimatorCommand
from anglecam.cli.export import export
from anglecam.cli.json_output import with_json
from anglecam.cli.live import live
from anglecam.cli.neck import app as neck
from anglecam.cli.sessions import close, identify
from anglecam.cli.view import view
from anglecam.errors import InputError, RigError, blame
from anglecam.terminal import errors

app = typer.Typer(
    name="anglecam",
    help="From clips of a moving mechanism to its angle, its model, and what the model lacks.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        from anglecam import __version__

        print(f"anglecam {__version__}")
        raise typer.Exit


@app.callback()
def _anglecam(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """From clips of a moving mechanism to its angle, its model, and what the model lacks."""


app.add_typer(neck, name="neck")
for _command in (check, measure, live, budget, calibrate, identify, close, certify, export, batch, doctor):
    app.command(cls=EstimatorCommand if _command is identify else None)(with_json(_command))
app.command()(view)


def main() -> None:
    """Run the command line; every failure is one line on standard error and an exit status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a file's name may be bytes that are not text
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
