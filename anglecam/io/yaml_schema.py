"""YAML files of declarations: every key is optional, an unknown key is an error."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from anglecam.errors import RigError
from anglecam.findings import finding_lines
from anglecam.io.files import read_text

_MOST_BYTES = 256 * 1024
"""Size above which a file is not read; one that names a thousand recordings has a tenth of it."""
_DEEPEST = 20
"""Levels of nesting that are read; a rig file has four."""

_LARGEST = 1e12
"""Largest value of a quantity of a rig or a neck in its unit; its inverse is the smallest. Powers of it stay finite."""


def _not_tiny(value: float) -> float:
    if value * _LARGEST < 1.0:
        raise ValueError(f"{value:g} is too small")
    return value


Positive = Annotated[float, Field(gt=0, le=_LARGEST, allow_inf_nan=False), AfterValidator(_not_tiny)]
NotNegative = Annotated[float, Field(ge=0, le=_LARGEST, allow_inf_nan=False)]
Finite = Annotated[float, Field(ge=-_LARGEST, le=_LARGEST, allow_inf_nan=False)]


class Declared(BaseModel):
    """A section of such a file; frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Section = TypeVar("Section", bound=Declared)


def read_declared(path: Path, kind: type[Section]) -> Section:
    """Read and validate a file of declarations.

    Parameters
    ----------
    path : Path
        A YAML file; an empty file declares nothing.
    kind : type
        The class that the file's content is validated against.

    Returns
    -------
    Declared
        What the file declares; the defaults for everything else.

    Raises
    ------
    RigError
        If the file cannot be read or its content is not valid. There is a line for each wrong key: the file, the key
        and the cause.
    """
    return validate(read_plain(path)[1], kind, str(path))


def read_plain(path: Path) -> tuple[str, dict[str, Any]]:
    """Read the text of a file of declarations, and its keys and values; raises as `read_declared`."""
    try:
        text = read_text(path, _MOST_BYTES)
        _require_plain(path, text)
        content = yaml.safe_load(text)
    except OSError as error:
        raise RigError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise RigError(f"{path}: not a UTF-8 text file") from error
    except (yaml.YAMLError, ValueError) as error:
        problem = getattr(error, "problem", None) or "not valid YAML"
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise RigError(f"{path}: not YAML ({problem}{where})") from error
    if content is None:
        return text, {}
    if not isinstance(content, dict):
        raise RigError(f"{path}: expected keys and values, found a {type(content).__name__}")
    return text, content


def validate(content: Mapping[str, Any], kind: type[Section], name: str) -> Section:
    """Return declarations as an object of ``kind``.

    Parameters
    ----------
    content : mapping
        Keys and values.
    kind : type
        The class that they are validated against.
    name : str
        The file, or whatever they come from, as errors name it.

    Returns
    -------
    Declared
        What is declared; the defaults for everything else.

    Raises
    ------
    RigError
        If a key is unknown or a value is not allowed, with a line for each such key.
    """
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        raise RigError(*(f"{name}: {line}" for line in finding_lines(error, kind))) from error


def _require_plain(path: Path, text: str) -> None:
    """Refuse YAML's aliases, tags and deep nesting before any object is built.

    Aliases can expand one page into more values than the memory holds, nesting can be deeper than Python's stack, and
    tags request types that no declaration uses.
    """
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        fault = "an alias" if isinstance(event, yaml.AliasEvent) else "a tag" if getattr(event, "tag", None) else None
        if depth > _DEEPEST:
            fault = f"more than {_DEEPEST} levels"
        if fault:
            line = "" if event.start_mark is None else f"line {event.start_mark.line + 1}: "
            raise RigError(f"{path}: {line}{fault}; only plain keys and values are read")
