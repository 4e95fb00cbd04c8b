"""What a result depends on: the clip's content, and the content of everything that is declared beside it."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from anglecam.batch.address import asking, is_remote, join, parent, read_small, stem
from anglecam.errors import InputError
from anglecam.io.command_csv import COMMAND_ENDING

_RACY_NS = 2_000_000_000
"""A file touched so shortly before it was read may change again within one tick of its file system's clock."""

Stamp = dict[str, Any]


def stamp(address: str) -> Stamp:
    """Say which version of a file is there, without reading it.

    Parameters
    ----------
    address : str
        A file.

    Returns
    -------
    dict
        ``size`` in bytes, and what changes whenever the file does: the times of its inode, or a store's own key.

    Raises
    ------
    InputError
        Where there is no such file, or its store does not answer.
    """
    try:
        if is_remote(address):
            with asking(address) as (fs, path):
                return {"size": int(fs.size(path) or 0), "key": str(fs.ukey(path))}
        found = Path(address).stat()
    except FileNotFoundError as problem:
        raise InputError(f"{address}: no such file") from problem
    # the inode's own time cannot be set by hand, as the content's can
    return {"size": found.st_size, "content": found.st_mtime_ns, "inode": [found.st_ino, found.st_ctime_ns]}


def is_settled(one: Stamp) -> bool:
    """Tell whether a file cannot change from now on without its stamp changing."""
    return "key" in one or max(one["content"], one["inode"][1]) < time.time_ns() - _RACY_NS


def content_hash(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def clip_configuration(address: str, rig: str | None) -> str:
    """Return a hash of all that a clip's results depend on besides the clip and the version.

    Parameters
    ----------
    address : str
        The clip.
    rig : str or None
        The rig file for all clips; ``None``: the one beside the clip.

    Returns
    -------
    str
        SHA-256 of rig file, calibration file and command file.
    """
    file = rig or join(parent(address), "rig.yaml")
    declared = read_small(file)
    calibration = calibration_named(declared)
    return combined(
        {
            "rig": declared,
            "calibration": None if calibration is None else read_small(_beside(file, calibration)),
            "command": read_small(join(parent(address), stem(address) + COMMAND_ENDING)),
        }
    )


def calibration_named(rig: bytes | None) -> str | None:
    """Return the calibration file that a rig file's content names, ``None`` where it names none or is no rig file."""
    if rig is None or b"calibration" not in rig:
        return None
    try:
        named = yaml.safe_load(rig)["camera"]["calibration"]
    except (yaml.YAMLError, ValueError, TypeError, KeyError, RecursionError):
        return None
    return named if isinstance(named, str) else None


def combined(parts: Mapping[str, bytes | str | None]) -> str:
    """Return one SHA-256 of named parts, in which no two different sets of parts are alike."""
    hashes = {
        key: None if part is None else hashlib.sha256(part if isinstance(part, bytes) else part.encode()).hexdigest()
        for key, part in parts.items()
    }
    return hashlib.sha256(json.dumps(hashes, sort_keys=True).encode()).hexdigest()


def _beside(rig: str, file: str) -> str:
    return file if file.startswith("/") and not is_remote(rig) else join(parent(rig), file)
