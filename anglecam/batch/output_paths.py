"""Where each clip's results go, so that no two clips share a place and no place is outside the output folder.

A clip's results are named as `anglecam measure` names them, in the folder that it has below the folder that was asked
for. Where two clips would share a place the first in the order of addresses keeps it; another has its folder's name
in front, or its ending behind, or a part of its address's hash: names that do not depend on what else is there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Hashable, Iterable, Sequence
from typing import TypeVar
from urllib.parse import quote

from anglecam.batch.address import name, parent, stem
from anglecam.batch.sources import Source

Item = TypeVar("Item", bound=Hashable)


def clip_places(sources: Sequence[Source], taken: Collection[str] = ()) -> dict[str, str]:
    """Give every clip a place of its own.

    Parameters
    ----------
    sources : sequence of Source
        In the order of their addresses.
    taken : collection of str
        Places of clips of earlier calls.

    Returns
    -------
    dict
        From address to a path relative to the output folder, without an ending.
    """

    def wishes(source: Source) -> list[str]:
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

    return {s.address: place for s, place in _assign(sources, wishes, taken, of_one_folder).items()}


def session_places(folders: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Give every session's folder a place of its own.

    Parameters
    ----------
    folders : sequence of (str, str)
        A session's folder and the folder that it was found under, in the order of addresses.

    Returns
    -------
    dict
        From folder to a path relative to the output folder, ``""`` for that folder itself.
    """

    def wishes(item: tuple[str, str]) -> list[str]:
        folder, root = item
        below = folder[len(root) :].strip("/")
        return [_path(below), _path(name(root) or "root", below), _path(below, f"session.{_digest(folder)}")]

    return {item[0]: place for item, place in _assign(folders, wishes).items()}


def _assign(
    items: Iterable[Item],
    wishes: Callable[[Item], list[str]],
    taken: Collection[str] = (),
    skip_second: Callable[[Item, Item | None], bool] = lambda item, holder: False,
) -> dict[Item, str]:
    """Grant every first wish that is free, then go down the lists of the others."""
    holders: dict[str, Item | None] = dict.fromkeys(taken)
    granted: dict[Item, str] = {}
    others = []
    for item in items:
        place = wishes(item)[0]
        if place in holders:
            others.append(item)
        else:
            holders[place] = item
            granted[item] = place
    for item in others:
        first, second, *rest = wishes(item)
        # a folder's name in front would not part two clips of one folder
        tried = rest if skip_second(item, holders[first]) else [second, *rest]
        place = next(place for place in tried if place not in holders)
        holders[place] = item
        granted[item] = place
    return granted


def _path(*parts: str) -> str:
    return "/".join(_safe(piece) for part in parts for piece in part.split("/") if piece)


def _safe(piece: str) -> str:
    """Return a name that leads nowhere else: nearly always the name itself."""
    leads_elsewhere = piece in (".", "..", ".anglecam") or "\0" in piece
    return quote(piece, safe="").replace(".", "%2E") if leads_elsewhere else piece


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:8]
