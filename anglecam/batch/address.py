"""Where clips lie: a path on this machine, or an address that fsspec reads, such as ``s3://bucket/clip.avi``.

Every function takes either. Local files are not read through fsspec, so that what the system says of them (permission
denied, no such file) comes through as it is.
"""

from __future__ import annotations

import os
import posixpath
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fsspec

from anglecam.errors import AnglecamError, InputError, RigError

_PROCESS_ONLY = ("memory",)
"""Stores that exist within one process."""


class PassingError(InputError):
    """A store could not be asked; another time may be different."""


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


@contextmanager
def asking(address: str) -> Iterator[tuple[Any, str]]:
    """Give a remote address's file system and path, and turn whatever its library raises into one line.

    Raises
    ------
    PassingError
        Where the store does not answer or refuses.
    FileNotFoundError
        Where nothing is there.
    """
    fs, path = store(address)
    try:
        yield fs, path
    except (AnglecamError, FileNotFoundError):
        raise
    except Exception as fault:  # every store has exceptions of its own
        said = (str(fault).strip() or type(fault).__name__).splitlines()[0]
        raise PassingError(f"{address}: cannot be read ({getattr(fault, 'strerror', None) or said})") from fault


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
    """List the names in a folder; none where it is not there, or is here and cannot be listed."""
    if not is_remote(folder):
        try:
            return frozenset(entry.name for entry in Path(folder).iterdir())
        except OSError:
            return frozenset()
    try:
        with asking(folder) as (fs, path):
            return frozenset(name(entry) for entry in fs.ls(path, detail=False))
    except FileNotFoundError:
        return frozenset()


def read_small(address: str) -> bytes | None:
    """Read a whole file; ``None`` where it is not there, or is here and cannot be read."""
    if not is_remote(address):
        try:
            return Path(address).read_bytes()
        except OSError:
            return None
    try:
        with asking(address) as (fs, path):
            return bytes(fs.cat_file(path))
    except FileNotFoundError:
        return None


def fetch(address: str, to: Path) -> None:
    """Copy a remote file to this machine.

    Raises
    ------
    PassingError
        Where it cannot be read, or not be written here.
    """
    to.parent.mkdir(parents=True, exist_ok=True)
    try:
        with asking(address) as (fs, path):
            fs.get_file(path, str(to))
    except FileNotFoundError as problem:
        raise InputError(f"{address}: no such file") from problem
