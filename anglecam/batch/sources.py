"""Find the clips of a call, in the order of their addresses.

A folder is searched with all folders below it, except hidden files and folders (``._clip.avi`` is no clip). A glob
stands for its matches, and ``@list.txt`` for the addresses in it, one per line. Everything else is a clip.
"""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from anglecam.batch.address import asking, is_remote, join, name, normalised, parent, store, with_slashes
from anglecam.errors import AnglecamError, InputError, RigError
from anglecam.io.session import CLIP_ENDINGS

_GLOB_CHARACTERS = frozenset("*?[")


@dataclass(frozen=True, order=True)
class Source:
    """A clip and the folder that was searched to find it."""

    address: str
    """Absolute path, or address with its protocol."""
    root: str
    """The folder given in the call; for a single clip, the folder that contains it."""

    @property
    def below_root(self) -> str:
        """The clip's folder relative to ``root``; ``""`` if they are the same."""
        return parent(self.address)[len(self.root) :].strip("/")


@dataclass
class Search:
    """Which folders a call has searched: a clip may be gone, or its folder out of reach."""

    folders: list[str] = field(default_factory=list)
    """Folders that were searched and hold clips."""
    unreachable: list[str] = field(default_factory=list)
    """Folders in them that cannot be searched."""
    empty: list[str] = field(default_factory=list)
    """Folders in them with nothing inside, as the folder of a share that is not mounted."""

    def has_reached(self, address: str) -> bool:
        """Return whether a clip would have been found if it existed."""
        return _is_in(address, self.folders) and not _is_in(address, [*self.unreachable, *self.empty])


def _is_in(address: str, folders: Iterable[str]) -> bool:
    return address.startswith(tuple(join(folder, "") for folder in folders))


def find_sources(asked: Sequence[str], out: Path) -> tuple[list[Source], Search, list[AnglecamError]]:
    """Find the clips of a call.

    Parameters
    ----------
    asked : sequence of str
        Folders, clips, globs, ``@list.txt``, each local or remote.
    out : Path
        The output folder, which is not searched.

    Returns
    -------
    sources : list of Source
        In the order of their addresses, without repetition.
    search : Search
        Which folders were searched.
    problems : list of AnglecamError
        Folders that cannot be searched or contain no clip, one line each.

    Raises
    ------
    RigError
        If a folder or list given in the call does not exist.
    """
    problems: list[AnglecamError] = []
    found: dict[str, Source] = {}
    search = Search()
    for given, listed in _unlisted(asked):
        try:
            if is_remote(given):
                store(given)[0].invalidate_cache()  # the store may have changed since it was last listed
            for source in _expand(given, out.resolve(), search, problems):
                found.setdefault(source.address, source)
        except RigError as problem:
            if not listed:
                raise
            problems.append(problem)
        except InputError as problem:
            problems.append(problem)
    return sorted(found.values()), search, problems


def _unlisted(asked: Sequence[str]) -> Iterator[tuple[str, bool]]:
    """Yield every address, and whether it comes from a list."""
    for given in asked:
        if not given.startswith("@"):
            yield given, False
            continue
        try:
            lines = Path(given[1:]).read_bytes().splitlines()
        except OSError as problem:
            raise RigError(f"{given}: this list cannot be read ({problem.strerror})") from problem
        for line in lines:
            text = os.fsdecode(line).strip()
            if text and not text.startswith("#"):
                yield text, True


def _expand(given: str, out: Path, search: Search, problems: list[AnglecamError]) -> Iterator[Source]:
    """Yield the clips that one address stands for."""
    address = normalised(given)
    folder, single = _kind(address)
    if folder:
        clips = _search(address, out, search, problems)
        if clips:
            search.folders.append(address)
        else:
            problems.append(InputError(f"{given}: no clip in this folder"))
        yield from (Source(clip, address) for clip in clips)
    elif single or not _GLOB_CHARACTERS & set(address):
        if not single and not _is_clip(address):
            raise RigError(f"{given}: no such folder")
        yield Source(address, parent(address))
    else:
        root = address[: min(address.index(c) for c in _GLOB_CHARACTERS if c in address)].rpartition("/")[0] or "/"
        matches = _matches(address, root)
        clips = [m for m in matches if _is_clip(m)]
        for match in sorted(set(matches) - set(clips)):
            if _kind(match)[0]:
                clips += _search(match, out, search, problems)
        if not clips:
            problems.append(InputError(f"{given}: no clip matches"))
        yield from (Source(clip, root) for clip in clips)


def _kind(address: str) -> tuple[bool, bool]:
    """Return whether an address is a folder, and whether it is a file."""
    if not is_remote(address):
        return os.path.isdir(address), os.path.isfile(address)  # noqa: PTH112, PTH113
    with asking(address) as (fs, path):
        return fs.isdir(path), fs.isfile(path)


def _matches(pattern: str, root: str) -> list[str]:
    if not is_remote(pattern):
        found = glob.glob(pattern, recursive=True)  # noqa: PTH207  (Path.glob takes no absolute pattern)
        return [with_slashes(match) for match in found]
    with asking(pattern) as (fs, path):
        return _below(root, fs.glob(path))


def _below(root: str, paths: Iterable[str]) -> list[str]:
    """Return the addresses of paths that a file system lists below ``root``."""
    start = store(root)[1].rstrip("/")
    return [join(root, path[len(start) :].lstrip("/")) for path in paths]


def _search(folder: str, out: Path, search: Search, problems: list[AnglecamError]) -> list[str]:
    """Return the clips in a folder and all folders below it."""
    if is_remote(folder):
        with asking(folder) as (fs, path):
            found = _below(folder, fs.find(path))
        return sorted(file for file in found if _is_clip(file) and not _is_hidden(file[len(folder) :]))

    def denied(problem: OSError) -> None:
        problems.append(InputError(f"{problem.filename}: cannot be searched ({problem.strerror})"))
        search.unreachable.append(with_slashes(problem.filename))

    clips = []
    for here, below, files in os.walk(folder, onerror=denied):
        if here != folder and not below and not files:
            search.empty.append(with_slashes(here))
        below[:] = [d for d in below if not d.startswith(".") and Path(here, d).resolve() != out]
        clips += [join(with_slashes(here), file) for file in files if _is_clip(file) and not file.startswith(".")]
    return sorted(clips)


def _is_clip(address: str) -> bool:
    return name(address).lower().endswith(CLIP_ENDINGS)


def _is_hidden(below: str) -> bool:
    return any(part.startswith(".") for part in below.split("/"))
