"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Out = Annotated[Path, typer.Option("--out", help="Folder for the results; made if missing.")]
RigFile = Annotated[
    Path | None, typer.Option("--rig", help="Rig file for all clips; default: rig.yaml in each clip's folder.")
]
FirstFrame = Annotated[
    int | None, typer.Option("--from", min=0, help="Number of the first frame that is measured; the clip's first is 0.")
]
LastFrame = Annotated[int | None, typer.Option("--to", min=0, help="Number of the last frame that is measured.")]
HoldOut = Annotated[
    list[str] | None, typer.Option("--hold-out", metavar="NAME", help="A recording to predict only; repeatable.")
]
SessionFolder = Annotated[Path, typer.Argument(metavar="SESSION", help="Folder of clips or *.angles.csv of one rig.")]
