"""The spec of a session: one YAML file, fully validated before anything is simulated.

`plant`, `controller` and `effects` determine the motion and are written to the truth only; `rig`, `scene`, `camera` and
`render` determine the picture; `recordings` hold the commands; `declare` is copied to the session's ``rig.yaml``
without any check, because a test may be about a wrong declaration.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import Field, ValidationError, model_validator

from anglecam.errors import printable
from anglecam.findings import finding_lines
from synth.errors import SpecError
from synth.section import Section
from synth.spec.commands import Command, Nod
from synth.spec.effects import Effects
from synth.spec.picture import Camera, Render, Rig, Scene
from synth.spec.plant import Controller, LinearPlant, NeckPlant, Plant


class Recording(Section):
    """One clip and its command."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=100)]
    duration_s: Annotated[float, Field(gt=0, le=3600, allow_inf_nan=False)]
    command: Command


class Spec(Section):
    """A whole session to render."""

    seed: Annotated[int, Field(ge=0)] = 0
    plant: Plant = LinearPlant()
    controller: Controller = Controller()
    effects: Effects = Effects()
    rig: Rig = Rig()
    scene: Scene = Scene()
    camera: Camera = Camera()
    render: Render = Render()
    declare: dict[str, Any] = Field(default_factory=dict)
    recordings: Annotated[list[Recording], Field(min_length=1)]

    @model_validator(mode="after")
    def _fits_together(self) -> Spec:
        if isinstance(self.plant, NeckPlant):
            for effect in self.effects.present():
                if effect.linear_plant_only:
                    raise ValueError(f"effects.{effect.id}: only for a linear plant; a neck models it already")
        if self.rig.neck == "human":
            for number, recording in enumerate(self.recordings):
                if not isinstance(recording.command, Nod):
                    raise ValueError(f"recordings.{number}.command: a human neck only nods, set kind: nod")
        return self

    @model_validator(mode="after")
    def _names_differ(self) -> Spec:
        # some file systems ignore case
        names = [recording.name.lower() for recording in self.recordings]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"recordings: the name {twice[0]} appears twice")
        return self


class _EveryKeyOnce(yaml.SafeLoader):
    """A safe YAML loader that rejects duplicate keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for number, key in enumerate(keys):
            if key in keys[:number]:
                raise yaml.constructor.ConstructorError(
                    problem=f"the key {key} appears twice", problem_mark=node.start_mark
                )
        return super().construct_mapping(node, deep)


def read_spec(path: Path) -> Spec:
    """Read and validate a spec.

    Parameters
    ----------
    path : Path
        A YAML file.

    Returns
    -------
    Spec
        With defaults for missing keys.

    Raises
    ------
    SpecError
        If the spec is wrong: the file, the key and the cause, with a line for each wrong key.
    """
    try:
        content = yaml.load(path.read_text(encoding="utf-8"), _EveryKeyOnce)
    except OSError as error:
        raise SpecError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise SpecError(f"{path}: not a UTF-8 text file") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        problem = getattr(error, "problem", None) or "not valid YAML"
        mark = getattr(error, "problem_mark", None)
        raise SpecError(f"{path}: not YAML ({problem}{f', line {mark.line + 1}' if mark else ''})") from error
    if not isinstance(content, dict):
        raise SpecError(f"{path}: expected keys and values, found {type(content).__name__}")
    try:
        return Spec.model_validate(content)
    except ValidationError as error:
        raise SpecError("\n".join(printable(f"{path}: {line}") for line in finding_lines(error, Spec))) from error
