"""Files in which something is declared: YAML whose every key is optional and whose unknown key is an error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from anglecam.errors import RigError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class Declared(BaseModel):
    """A section of such a file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Section = TypeVar("Section", bound=Declared)


def read_declared(path: Path, kind: type[Section]) -> Section:
    """Read and validate a file in which something is declared.

    Parameters
    ----------
    path : Path
        A YAML file; an empty one declares nothing.
    kind : type
        What is declared in it.

    Returns
    -------
    Declared
        With the defaults in place of what is not declared.

    Raises
    ------
    RigError
        Naming the file, the key and the cause.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RigError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise RigError(f"{path}: not a UTF-8 text file") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        problem = getattr(error, "problem", None) or "not valid YAML"
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise RigError(f"{path}: not YAML ({problem}{where})") from error
    if content is None:
        return kind()
    if not isinstance(content, dict):
        raise RigError(f"{path}: expected keys and values, found a {type(content).__name__}")
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        raise RigError(f"{path}: {_first(error)}") from error


def _first(error: ValidationError) -> str:
    """Say the most telling of pydantic's findings in one line."""
    findings = error.errors()
    unknown = [f for f in findings if f["type"] == "extra_forbidden"]
    finding = (unknown or findings)[0]
    key = ".".join(str(part) for part in finding["loc"] if part not in ("Mouth", "literal['auto']", "float"))
    if unknown:
        return f"unknown key {key}"
    said = finding["msg"].removeprefix("Value error, ").replace("tuple", "list")
    got = "" if finding["type"] == "value_error" else f" (got {str(finding['input'])[:60]})"
    return f"{key}: {said[0].lower()}{said[1:]}{got}"
