"""Addresses of clips: a path on this machine, or an address that fsspec reads, such as ``s3://bucket/clip.avi``.

Every function takes both. Local files are not read through fsspec, so that the operating system's error messages
(permission denied, no such file) reach the user unchanged.
"""

from __future__ import annotations

import os
import posixpath
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from anglecam.errors import AnglecamError, InputError, RigError

_IN_MEMORY = ("memory",)
"""Protocols of stores that exist within one process only."""


class TransientError(InputError):
    """A store did not answer; the next attempt may succeed."""


def normalised(address: str) -> str:
    """Return a local path in absolute form without ``file://``, or a remote address without a slash at its end."""
    if address.startswith(("file://", "local://")):
        address = address.partition("://")[2] or "/"
    if is_remote(address):
        return address.rstrip("/") if not address.endswith("://") else address
    return with_slashes(os.path.abspath(address))  # noqa: PTH100  (a symbolic link keeps its own name)


def with_slashes(path: str) -> str:
    """Return a local path with slashes between its parts, as every system reads it and addresses have them."""
    return path.replace(os.sep, "/")


def is_remote(address: str) -> bool:
    """Return whether an address is not a path on this machine."""
    return "://" in address and not address.startswith(("file://", "local://"))


def is_of_one_process(address: str) -> bool:
    """Return whether an address is valid in this process only."""
    return address.partition("://")[0] in _IN_MEMORY


def store(address: str) -> tuple[Any, str]:
    """Open the file system of a remote address.

    Parameters
    ----------
    address : str
        An address with its protocol.

    Returns
    -------
    fs : fsspec.AbstractFileSystem
        The file system.
    path : str
        The address in the notation of that file system.

    Raises
    ------
    RigError
        If the protocol is unknown, or the package that reads it is not installed.
    """
    protocol = address.partition("://")[0]
    try:
        import fsspec  # takes longer to load than a wrong call may

        return fsspec.core.url_to_fs(address)
    except ImportError as error:
        extra = "; pip install 'anglecam[s3]'" if protocol in ("s3", "s3a") else ""
        raise RigError(f"{address}: the package that reads {protocol}:// is not installed{extra}") from error
    except ValueError as error:
        raise RigError(f"{address}: {protocol}:// is no protocol that fsspec knows") from error


@contextmanager
def asking(address: str) -> Iterator[tuple[Any, str]]:
    """Give the file system and path of a remote address, and turn the exceptions of its library into one line.

    Raises
    ------
    TransientError
        If the store does not answer, or refuses the request.
    FileNotFoundError
        If there is no such file.
    """
    fs, path = store(address)
    try:
        yield fs, path
    except (AnglecamError, FileNotFoundError):
        raise
    except Exception as fault:  # every store's library has its own exceptions
        message = (str(fault).strip() or type(fault).__name__).splitlines()[0]
        raise TransientError(f"{address}: cannot be read ({getattr(fault, 'strerror', None) or message})") from fault


def parent(address: str) -> str:
    """Return the folder that contains a file."""
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
    """Return the names in a folder; none if there is no such folder, or if it is local and cannot be listed."""
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
    """Return a file's content; ``None`` if there is no such file, or if it is local and cannot be read."""
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
    TransientError
        If it cannot be read, or cannot be written on this machine.
    InputError
        If there is no such file.
    """
    to.parent.mkdir(parents=True, exist_ok=True)
    try:
        with asking(address) as (fs, path):
            fs.get_file(path, str(to))
    except FileNotFoundError as problem:
        raise InputError(f"{address}: no such file") from problem
