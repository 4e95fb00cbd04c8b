"""The command `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from anglecam.cli.json_output import report
from anglecam.cli.progress import begin_loading, stages
from anglecam.errors import RigError
from anglecam.io.files import write_atomically
from anglecam.io.model_json import model_file, read_model_file
from anglecam.terminal import make_folder, screen

ENDINGS = {"mujoco": ".xml", "urdf": ".urdf", "matlab": ".mat"}


def export(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="model.json, loop.json, or the folder of a result of close.")
    ],
    to: Annotated[str, typer.Option("--to", help="mujoco, urdf or matlab.")],
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the file; default: the model's.")] = None,
    inertia: Annotated[
        float, typer.Option("--inertia", help="Moment of inertia of all that moves about the axis, kg·m².")
    ] = 1.0,
) -> None:
    """Write a model for MuJoCo, as URDF or for MATLAB, and say what that format cannot express.

    A model that runs away, that moves against its command or that the recordings do not determine is refused.
    """
    if to not in ENDINGS:
        raise RigError(f"--to {to}: choose one of {', '.join(ENDINGS)}")
    if not inertia > 0.0:
        raise RigError(f"--inertia {inertia:g}: must be above 0")
    source = model_file(model)
    read_model_file(source)
    folder = source.parent if out is None else out
    path = folder / f"{source.stem}{ENDINGS[to]}"
    make_folder(folder)
    with stages() as progress:
        begin_loading(progress)
        from anglecam.identification.export import write_mat
        from anglecam.identification.simulators.mechanism import linear_model, read_mechanism
        from anglecam.identification.simulators.mjcf import mjcf_of
        from anglecam.identification.simulators.urdf import urdf_of
        from anglecam.identification.simulators.usable import require_usable

    linear, left_out = linear_model(source)
    require_usable(linear, source)
    if to == "matlab":
        write_mat(linear, path)
    else:
        exported = (mjcf_of if to == "mujoco" else urdf_of)(read_mechanism(source), inertia)
        left_out = list(exported.left_out)
        with write_atomically(path) as stream:
            stream.write(exported.text)
    report(file=str(path), not_expressed=list(left_out))
    for line in left_out:
        screen.print(line, soft_wrap=True, highlight=False)
    screen.print(str(path), soft_wrap=True, highlight=False)
