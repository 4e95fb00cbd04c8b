"""What is wrong with a file of declarations, one line for each key: pydantic's findings in the words of the file.

The path of a key is the path in the file. pydantic adds the type that it tried of a union, the tag of a section and
the names of validators; these are left out. An unknown key gets the known key that it resembles most.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}
_WITHOUT_VALUE = {"missing", "value_error"}
"""Findings in whose message the value would say nothing more."""
_LONGEST = 60
"""Characters of a key or a value that are shown."""
_RESEMBLANCE = 0.6
"""Smallest ratio of `difflib` at which a known key is suggested; its default."""


def finding_lines(error: ValidationError, kind: type[BaseModel]) -> list[str]:
    """Return a line for each wrong key.

    Parameters
    ----------
    error : ValidationError
        From the validation of a file's content.
    kind : type
        The class that the content was validated against.

    Returns
    -------
    list of str
        Such as ``pivot.near: input should be a valid number (got left)``, or ``unknown key pivott; did you mean
        pivot?``. Each key has one line: of a union, the findings about the kind that fits best are kept.
    """
    lines: dict[tuple[str, ...], str] = {}
    for finding in sorted(error.errors(), key=lambda finding: finding["type"] not in _UNKNOWN):
        path, siblings = _locate(finding["loc"], kind, finding["type"] in _UNKNOWN)
        lines.setdefault(path, _line(finding, path, siblings))
    outer = {path[:depth] for path in lines for depth in range(len(path))}
    return [line for path, line in lines.items() if path not in outer]


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """Return ``; did you mean X?`` for the known word that a word resembles most; empty where it resembles none.

    Examples
    --------
    >>> did_you_mean("pivott", ["mouth", "pivot"])
    '; did you mean pivot?'
    >>> did_you_mean("gremlin", ["mouth", "pivot"])
    ''
    """
    close = get_close_matches(word, known, n=1, cutoff=_RESEMBLANCE)
    return f"; did you mean {close[0]}?" if close else ""


def _line(finding: Mapping[str, Any], path: tuple[str, ...], siblings: Sequence[str]) -> str:
    key = ".".join(part[:_LONGEST] for part in path)
    if finding["type"] in _UNKNOWN:
        return f"unknown key {key}{did_you_mean(path[-1], siblings)}"
    if finding["type"] == "union_tag_invalid":
        tag = str(finding["ctx"]["tag"])
        expected = finding["ctx"]["expected_tags"]
        meant = did_you_mean(tag, [word.strip(" '") for word in expected.split(",")])
        return f"{key}.kind: should be {expected} (got {tag[:_LONGEST]}){meant}"
    message = finding["msg"].removeprefix("Value error, ").replace("tuple", "list")
    got = "" if finding["type"] in _WITHOUT_VALUE else f" (got {_shown(finding['input'])})"
    return f"{key + ': ' if key else ''}{message[0].lower()}{message[1:]}{got}"


def _shown(value: object) -> str:
    if isinstance(value, int) and value.bit_length() > 200:  # Python refuses to write out very long numbers
        return f"a number of {value.bit_length()} bits"
    return " ".join(str(value).split())[:_LONGEST]


def _locate(location: Sequence[str | int], kind: type, unknown: bool) -> tuple[tuple[str, ...], list[str]]:
    """Return the path of a key in the file, and the keys that its section knows."""
    sections: list[type] = [kind]
    path: list[str] = []
    for depth, part in enumerate(location):
        known = {name: annotation for section in sections for name, annotation in _keys(section)}
        if part in known:
            sections = list(_sections(known[str(part)]))
        elif isinstance(part, str) and not (unknown and depth == len(location) - 1):
            sections = [section for section in sections if part in _labels(section)] or sections
            continue
        path.append(str(part))
    if not unknown:
        return tuple(path), []
    return tuple(path), [name for section in sections for name, _ in _keys(section)]


def _keys(section: type) -> Iterator[tuple[str, Any]]:
    """Yield the keys of a section and the types of their values."""
    if issubclass(section, BaseModel):
        yield from ((field.alias or name, field.annotation) for name, field in section.model_fields.items())
        yield from ((name, None) for name in getattr(section, "other_names", ()))
    elif dataclasses.is_dataclass(section):
        yield from ((field.name, None) for field in dataclasses.fields(section))


def _sections(annotation: Any) -> Iterator[type]:
    """Yield the sections that a value of a type may be."""
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or dataclasses.is_dataclass(annotation)):
        yield annotation
    for part in get_args(annotation):
        yield from _sections(part)


def _labels(section: type) -> tuple[Any, ...]:
    """Return the names by which pydantic's location states a section: its class and its tag."""
    tag = section.model_fields.get("kind") if issubclass(section, BaseModel) else None
    return (section.__name__, *(() if tag is None else get_args(tag.annotation)))
