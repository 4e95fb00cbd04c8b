"""What a clip's results depend on: the content of the clip, and of rig file, calibration and command."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from anglecam.batch.address import TransientError, asking, is_remote, join, names_in, parent, read_small, stem
from anglecam.errors import InputError
from anglecam.io.command_csv import COMMAND_ENDING

_RACY_NS = 2_000_000_000
"""A file that changed less than this time, in ns, before it was read may change again within one tick of the file
system's clock.
"""

Stamp = dict[str, Any]


def stamp(address: str) -> Stamp:
    """Return a stamp that identifies the current version of a file, without reading the file.

    Parameters
    ----------
    address : str
        A file.

    Returns
    -------
    dict
        ``size`` in bytes, and values that change whenever the file changes: the times of its inode, or the key by which
        a remote store identifies a version.

    Raises
    ------
    InputError
        If there is no such file.
    TransientError
        If its store does not answer, or its folder is gone or empty, as that of a share that is not mounted.
    """
    try:
        if is_remote(address):
            with asking(address) as (fs, path):
                return {"size": int(fs.size(path) or 0), "key": str(fs.ukey(path))}
        found = Path(address).stat()
    except FileNotFoundError as problem:
        if not is_remote(address) and not names_in(parent(address)):
            raise TransientError(f"{address}: its folder is gone or empty; is it mounted?") from problem
        raise InputError(f"{address}: no such file") from problem
    # a program can set the content's time (mtime) by hand, but not the inode's (ctime)
    return {"size": found.st_size, "content": found.st_mtime_ns, "inode": [found.st_ino, found.st_ctime_ns]}


def is_reliable(found: Stamp) -> bool:
    """Return whether every later change of the file will change its stamp."""
    return "key" in found or max(found["content"], found["inode"][1]) < time.time_ns() - _RACY_NS


def content_hash(path: Path) -> str:
    """Return the SHA-256 of a file's content, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def clip_inputs(address: str, rig: str | None) -> dict[str, str | None]:
    """Return hashes of everything that a clip's results depend on, except the clip and the version of anglecam.

    Parameters
    ----------
    address : str
        The clip.
    rig : str or None
        The rig file for all clips; ``None``: the rig file beside the clip.

    Returns
    -------
    dict
        SHA-256 of rig file, calibration file and command file; ``None`` for a file that is not there.
    """
    file = rig or join(parent(address), "rig.yaml")
    declared = read_small(file)
    calibration = calibration_named(declared)
    return hashes(
        {
            "rig": declared,
            "calibration": None if calibration is None else read_small(_beside(file, calibration)),
            "command": read_small(join(parent(address), stem(address) + COMMAND_ENDING)),
        }
    )


def calibration_named(rig: bytes | None) -> str | None:
    """Return the calibration file that a rig file names; ``None`` if there is none, or the content is no rig file."""
    if rig is None or b"calibration" not in rig:
        return None
    try:
        named = yaml.safe_load(rig)["camera"]["calibration"]
    except (yaml.YAMLError, ValueError, TypeError, KeyError, RecursionError):
        return None
    return named if isinstance(named, str) else None


def hashes(parts: Mapping[str, bytes | str | None]) -> dict[str, str | None]:
    """Return the SHA-256 of each of a set of named parts."""
    return {
        key: None if part is None else hashlib.sha256(part if isinstance(part, bytes) else part.encode()).hexdigest()
        for key, part in parts.items()
    }


def combined_hash(inputs: Mapping[str, str | None]) -> str:
    """Return one SHA-256 of a set of named hashes; different sets have different ones."""
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def _beside(rig: str, file: str) -> str:
    return file if file.startswith("/") and not is_remote(rig) else join(parent(rig), file)
