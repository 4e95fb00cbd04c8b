"""Change sections of a ``rig.yaml`` and keep all the others.

The file is read as plain keys and values, so that keys that nobody changes keep their values. Comments are lost.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from anglecam.errors import RigError
from anglecam.io.files import write_atomically
from anglecam.io.rig import Rig, read_rig
from anglecam.io.yaml_schema import read_plain, validate

Sections = dict[str, Any]
"""From a key of the rig file to its new value; ``None`` removes the key."""


EDITABLE = ("mark", "pivot", "facing", "neutral", "frames", "sync", "ignore")
"""Sections that may be changed; the camera's names a file and is left to the user's editor."""


@dataclass(frozen=True)
class RigText:
    """A rig file as it was read."""

    content: dict[str, Any]
    """Keys and values as they are written; empty where there is no file."""
    version: str
    """Hash of the file; the empty text where there is none."""
    has_comments: bool


def read_rig_text(path: Path) -> RigText:
    """Read a rig file as it is written.

    Parameters
    ----------
    path : Path
        The file, which may be missing.

    Returns
    -------
    RigText
        Its keys; ``mouth`` is called ``mark``.

    Raises
    ------
    RigError
        As `anglecam.io.rig.read_rig`.
    """
    if not path.exists():
        return RigText({}, "", False)
    text, content = read_plain(path)
    validate(content, Rig, str(path))
    named = {"mark" if key == "mouth" else key: value for key, value in content.items()}
    version = hashlib.sha256(text.encode()).hexdigest()
    return RigText(named, version, any(_has_comment(line) for line in text.splitlines()))


def changed_rig(path: Path, sections: Sections) -> Rig:
    """Return the rig that a file would declare with changed sections; raises as `update_rig`."""
    content = _merged(path, sections)
    declared = validate(content, Rig, str(path))
    before = read_rig(path) if path.exists() else Rig()
    return declared.model_copy(update={"camera": before.camera})  # with the resolved path of its calibration


def update_rig(path: Path, sections: Sections, version: str) -> None:
    """Write changed sections into a rig file; all other keys stay.

    Parameters
    ----------
    path : Path
        The file; it is made if missing, and is written whole or not at all.
    sections : dict
        New values by key; ``None`` removes a key.
    version : str
        Of the file from which the changes were made.

    Raises
    ------
    RigError
        Where the result would not be a valid rig, a section is not one of `EDITABLE`, or the file has changed since.
    """
    if read_rig_text(path).version != version:
        raise RigError(f"{path}: another program has changed it; load it again before you save")
    content = _merged(path, sections)
    validate(content, Rig, str(path))
    with write_atomically(path) as stream:
        stream.write(yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110))


def _merged(path: Path, sections: Sections) -> dict[str, Any]:
    other = sorted(set(sections) - set(EDITABLE))
    if other:
        raise RigError(f"{path}: {other[0]} cannot be changed here")
    content = {**read_rig_text(path).content, **sections}
    return {key: value for key, value in content.items() if value is not None}


def _has_comment(line: str) -> bool:
    return line.lstrip().startswith("#") or " #" in line
