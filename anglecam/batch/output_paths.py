"""Output paths: where each clip's results go. No two clips share a path, and no path leads out of the output folder.

A clip's results are named as `anglecam measure` names them, and lie in the folder that the clip has below the folder
given in the call. If two clips would share a path, the first in the order of addresses keeps it. For the other, the
name of the given folder is put in front, or the clip's ending or a part of its address's hash is appended. These names
do not depend on the other clips.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Hashable, Iterable, Sequence
from typing import TypeVar
from urllib.parse import quote

from anglecam.batch.address import name, parent, stem
from anglecam.batch.sources import Source

Item = TypeVar("Item", bound=Hashable)


def assign_clip_paths(sources: Sequence[Source], taken: Collection[str] = ()) -> dict[str, str]:
    """Assign an output path to every clip.

    Parameters
    ----------
    sources : sequence of Source
        In the order of their addresses.
    taken : collection of str
        Output paths that are not available, such as those of clips of earlier batches.

    Returns
    -------
    dict
        From address to output path, relative to the output folder and without an ending.
    """

    def candidates(source: Source) -> list[str]:
        below, whole = source.below_root, name(source.address)
        root = name(source.root) or "root"
        return [
            _path(below, stem(source.address)),
            _path(root, below, stem(source.address)),
            _path(below, whole),
            _path(below, f"{stem(source.address)}.{_digest(source.address)}"),
        ]

    def of_one_folder(source: Source, holder: Source | None) -> bool:
        return holder is not None and parent(source.address) == parent(holder.address)

    return {s.address: path for s, path in _assign(sources, candidates, taken, of_one_folder).items()}


def assign_session_folders(folders: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Assign an output folder to every session.

    Parameters
    ----------
    folders : sequence of (str, str)
        A session's folder and the folder that was searched to find it, in the order of addresses.

    Returns
    -------
    dict
        From folder to a path relative to the output folder; ``""`` is the output folder itself.
    """

    def candidates(item: tuple[str, str]) -> list[str]:
        folder, root = item
        below = folder[len(root) :].strip("/")
        return [_path(below), _path(name(root) or "root", below), _path(below, f"session.{_digest(folder)}")]

    return {item[0]: path for item, path in _assign(folders, candidates).items()}


def _assign(
    items: Iterable[Item],
    candidates: Callable[[Item], list[str]],
    taken: Collection[str] = (),
    skips_second: Callable[[Item, Item | None], bool] = lambda item, holder: False,
) -> dict[Item, str]:
    """Assign every item its first candidate that is free; first candidates of all items go before second ones."""
    holders: dict[str, Item | None] = dict.fromkeys(taken)
    assigned: dict[Item, str] = {}
    others = []
    for item in items:
        path = candidates(item)[0]
        if path in holders:
            others.append(item)
        else:
            holders[path] = item
            assigned[item] = path
    for item in others:
        first, second, *rest = candidates(item)
        # the second candidate, with the folder's name in front, does not distinguish two clips of one folder
        tried = rest if skips_second(item, holders[first]) else [second, *rest]
        path = next(path for path in tried if path not in holders)
        holders[path] = item
        assigned[item] = path
    return assigned


def _path(*parts: str) -> str:
    return "/".join(_safe(piece) for part in parts for piece in part.split("/") if piece)


def _safe(piece: str) -> str:
    """Return a name that leads to no other folder: almost always the name itself."""
    leads_elsewhere = piece in (".", "..", ".anglecam") or "\0" in piece
    return quote(piece, safe="").replace(".", "%2E") if leads_elsewhere else piece


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:8]
