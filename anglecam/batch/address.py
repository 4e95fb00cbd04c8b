"""Where clips lie: a path on this machine, or an address that fsspec reads, such as ``s3://bucket/clip.avi``.

Every function takes either. Local files are not read through fsspec, so that what the system says of them (permission
denied, no such file) comes through as it is.
"""

from __future__ import annotations

import os
import posixpath
from pathlib import Path
from typing import Any

import fsspec

from anglecam.errors import InputError, RigError

_PROCESS_ONLY = ("memory",)
"""Stores that exist within one process."""


def normalised(address: str) -> str:
    """Return a local path as an absolute one, without ``file://``; a remote address without a slash at its end."""
    if address.startswith(("file://", "local://")):
        address = address.partition("://")[2] or "/"
    if is_remote(address):
        return address.rstrip("/") if not address.endswith("://") else address
    return os.path.abspath(address)  # noqa: PTH100  (a symbolic link keeps its own name)


def is_remote(address: str) -> bool:
    """Tell whether an address is not a path on this machine."""
    return "://" in address and not address.startswith(("file://", "local://"))


def is_of_one_process(address: str) -> bool:
    """Tell whether an address means something in this process only."""
    return address.partition("://")[0] in _PROCESS_ONLY


def store(address: str) -> tuple[Any, str]:
    """Open the file system that a remote address lies in.

    Parameters
    ----------
    address : str
        With its protocol.

    Returns
    -------
    fs : fsspec.AbstractFileSystem
        The file system.
    path : str
        The address as that file system writes it.

    Raises
    ------
    RigError
        Where the protocol is not known, or what reads it is not installed.
    """
    protocol = address.partition("://")[0]
    try:
        return fsspec.core.url_to_fs(address)
    except ImportError as error:
        extra = "; pip install 'anglecam[s3]'" if protocol in ("s3", "s3a") else ""
        raise RigError(f"{address}: what reads {protocol}:// is not installed{extra}") from error
    except ValueError as error:
        raise RigError(f"{address}: {protocol}:// is no protocol that fsspec knows") from error


def parent(address: str) -> str:
    """Return the folder that a file lies in."""
    if not is_remote(address):
        return os.path.dirname(address)  # noqa: PTH120
    protocol, _, rest = address.partition("://")
    return f"{protocol}://{posixpath.dirname(rest)}"


def name(address: str) -> str:
    """Return the last part of an address."""
    return address.rstrip("/").rpartition("/")[2]


def stem(address: str) -> str:
    """Return a file's name without its ending, as `pathlib` does."""
    return name(address).rpartition(".")[0] or name(address)


def join(folder: str, file: str) -> str:
    """Return the address of a file in a folder."""
    return f"{folder}{file}" if folder.endswith("/") else f"{folder}/{file}"


def names_in(folder: str) -> frozenset[str]:
    """List the names in a folder; none where it cannot be listed."""
    try:
        if not is_remote(folder):
            return frozenset(entry.name for entry in Path(folder).iterdir())
        fs, path = store(folder)
        return frozenset(name(entry) for entry in fs.ls(path, detail=False))
    except OSError:
        return frozenset()


def read_small(address: str) -> bytes | None:
    """Read a whole file; ``None`` where there is none or it cannot be read."""
    try:
        if not is_remote(address):
            return Path(address).read_bytes()
        fs, path = store(address)
        return bytes(fs.cat_file(path))
    except OSError:
        return None


def fetch(address: str, to: Path) -> None:
    """Copy a remote file to this machine.

    Raises
    ------
    InputError
        Where it cannot be read, or not be written here.
    """
    fs, path = store(address)
    to.parent.mkdir(parents=True, exist_ok=True)
    try:
        fs.get_file(path, str(to))
    except Exception as fault:  # every store has exceptions of its own
        said = (str(fault).strip() or type(fault).__name__).splitlines()[0]
        raise InputError(f"{address}: cannot be fetched ({getattr(fault, 'strerror', None) or said})") from fault
