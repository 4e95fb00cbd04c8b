"""Files in which something is declared: YAML whose every key is optional and whose unknown key is an error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeVar

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from anglecam.errors import RigError
from anglecam.io.files import read_text

_MOST_BYTES = 256 * 1024
"""A file that names a thousand recordings has a tenth of it."""
_DEEPEST = 20
"""Levels of nesting; a rig has four."""

_LARGEST = 1e12
"""Nothing about a rig or a neck is larger in its unit, nor smaller than the inverse: powers of it stay finite."""


def _not_tiny(value: float) -> float:
    if value * _LARGEST < 1.0:
        raise ValueError(f"{value:g} is too small")
    return value


Positive = Annotated[float, Field(gt=0, le=_LARGEST, allow_inf_nan=False), AfterValidator(_not_tiny)]
NotNegative = Annotated[float, Field(ge=0, le=_LARGEST, allow_inf_nan=False)]
Finite = Annotated[float, Field(ge=-_LARGEST, le=_LARGEST, allow_inf_nan=False)]


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
        return kind()
    if not isinstance(content, dict):
        raise RigError(f"{path}: expected keys and values, found a {type(content).__name__}")
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        raise RigError(f"{path}: {_first(error)}") from error


def _require_plain(path: Path, text: str) -> None:
    """Refuse what YAML can do beyond keys and values, before anything is built of it.

    Aliases make a page into more values than a memory holds, nesting can be deeper than Python's stack, and tags ask
    for types that nothing here declares.
    """
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        more = "an alias" if isinstance(event, yaml.AliasEvent) else "a tag" if getattr(event, "tag", None) else None
        if depth > _DEEPEST:
            more = f"more than {_DEEPEST} levels"
        if more:
            line = "" if event.start_mark is None else f"line {event.start_mark.line + 1}: "
            raise RigError(f"{path}: {line}{more}; only plain keys and values are read")


def _first(error: ValidationError) -> str:
    """Say the most telling of pydantic's findings in one line."""
    findings = error.errors()
    unknown = [f for f in findings if f["type"] == "extra_forbidden"]
    finding = (unknown or findings)[0]
    kinds = {"literal['auto']", "float", *(section.__name__ for section in Declared.__subclasses__())}
    key = ".".join(str(part)[:60] for part in finding["loc"] if part not in kinds)
    if unknown:
        return f"unknown key {key}"
    said = finding["msg"].removeprefix("Value error, ").replace("tuple", "list")
    got = "" if finding["type"] == "value_error" else f" (got {_shown(finding['input'])})"
    return f"{key}: {said[0].lower()}{said[1:]}{got}"


def _shown(value: object) -> str:
    if isinstance(value, int) and value.bit_length() > 200:  # Python does not write out what is longer than its limit
        return f"a number of {value.bit_length()} bits"
    return str(value)[:60]
