"""Output paths: where each clip's results go. No two clips share a path, and no path leads out of the output folder.

A clip's results are named as `anglecam measure` names them, and lie in the folder that the clip has below the folder
given in the call. If two clips would share a path, the first in the order of addresses keeps it. For the other, the
name of the given folder is put in front, or the clip's ending or a part of its address's hash is appended. These names
do not depend on the other clips. A path at which a clip has results is that clip's: it keeps the path where the path is
still one of its candidates, and no other clip gets it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import TypeVar
from urllib.parse import quote

from anglecam.batch.address import name, parent, stem
from anglecam.batch.sources import Source

Item = TypeVar("Item", bound=Hashable)
_NOBODY: Mapping[str, str] = {}


def assign_clip_paths(sources: Sequence[Source], holders: Mapping[str, str] = _NOBODY) -> dict[str, str]:
    """Assign an output path to every clip.

    Parameters
    ----------
    sources : sequence of Source
        In the order of their addresses.
    holders : mapping
        From output path to the address of the clip that has results there, or of anything else that takes the path.

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

    def of_one_folder(source: Source, holder: str) -> bool:
        return parent(source.address) == parent(holder)

    found = _assign(sources, candidates, lambda source: source.address, holders, of_one_folder)
    return {source.address: path for source, path in found.items()}


def assign_session_folders(folders: Sequence[tuple[str, str]], holders: Mapping[str, str] = _NOBODY) -> dict[str, str]:
    """Assign an output folder to every session.

    Parameters
    ----------
    folders : sequence of (str, str)
        A session's folder and the folder that was searched to find it, in the order of addresses.
    holders : mapping
        From output folder to the folder of the session that has results there.

    Returns
    -------
    dict
        From folder to a path relative to the output folder; ``""`` is the output folder itself.
    """

    def candidates(item: tuple[str, str]) -> list[str]:
        folder, root = item
        below = folder[len(root) :].strip("/")
        return [_path(below), _path(name(root) or "root", below), _path(below, f"session.{_digest(folder)}")]

    return {item[0]: path for item, path in _assign(folders, candidates, lambda item: item[0], holders).items()}


def _assign(
    items: Iterable[Item],
    candidates: Callable[[Item], list[str]],
    address: Callable[[Item], str],
    holders: Mapping[str, str],
    skips_second: Callable[[Item, str], bool] = lambda item, holder: False,
) -> dict[Item, str]:
    """Assign every item a path that it holds, or its first free candidate; first candidates go before second ones."""
    held = dict(holders)
    assigned: dict[Item, str] = {}
    others = []
    for item in items:
        mine = [path for path in candidates(item) if held.get(path, address(item)) == address(item)]
        holding = [path for path in mine if path in held]
        if holding or candidates(item)[0] in mine:
            assigned[item] = (holding or mine)[0]
            held[assigned[item]] = address(item)
        else:
            others.append(item)
    for item in others:
        first, second, *rest = candidates(item)
        # the second candidate, with the folder's name in front, does not distinguish two clips of one folder
        tried = rest if skips_second(item, held[first]) else [second, *rest]
        path = next(path for path in tried if path not in held)
        held[path] = address(item)
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
