"""The names of a pandas table's columns, which PyTables leaves as a pickle, read off it without loading it.

A pickle is a program. This one, where it is what it should be, only builds lists, tuples and texts, so its
instructions are listed by the standard library's disassembler (`pickletools.genops`, which runs nothing) and those
few are followed. Any other instruction, above all one that would fetch or call something, ends the reading.
"""

from __future__ import annotations

import pickletools
from typing import Any, cast

from anglecam.io.tracks.hdf5 import as_text

_VALUES = {"UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "STRING", "BINSTRING", "SHORT_BINSTRING", "INT", "BININT",
           "BININT1", "BININT2", "LONG", "LONG1"}  # fmt: skip
_PUT = {"PUT", "BINPUT", "LONG_BINPUT"}
_GET = {"GET", "BINGET", "LONG_BINGET"}
_TUPLES = {"EMPTY_TUPLE": 0, "TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}
_NOTHING = {"PROTO", "FRAME"}
_MARK = object()


def read_names(pickled: bytes) -> list[tuple[str, ...]]:
    """Read a list of tuples of texts off a pickle.

    Parameters
    ----------
    pickled : bytes
        Of any protocol.

    Returns
    -------
    list of tuple of str
        In order.

    Raises
    ------
    ValueError
        Where it is anything but that.
    """
    try:
        found = _follow(pickled)
    except (IndexError, KeyError, AttributeError) as fault:
        raise ValueError("the names of its columns are stored in a damaged form") from fault
    if not isinstance(found, list) or not all(isinstance(column, tuple) for column in found):
        raise ValueError("its columns are not named by several parts each")
    return [tuple(as_text(part) for part in column) for column in found]


def _follow(pickled: bytes) -> Any:
    """Build what the instructions build."""
    stack: list[Any] = []
    memo: dict[int, Any] = {}
    for opcode, given, _ in pickletools.genops(pickled):
        name, argument = opcode.name, cast(Any, given)
        if name in _VALUES:
            stack.append(argument)
        elif name == "MARK":
            stack.append(_MARK)
        elif name in _PUT:
            memo[argument] = stack[-1]
        elif name == "MEMOIZE":
            memo[len(memo)] = stack[-1]
        elif name in _GET:
            stack.append(memo[argument])
        elif name == "EMPTY_LIST":
            stack.append([])
        elif name in ("LIST", "TUPLE"):
            stack.append((list if name == "LIST" else tuple)(_since_mark(stack)))
        elif name in _TUPLES:
            kept = len(stack) - _TUPLES[name]
            stack[kept:] = [tuple(stack[kept:])]
        elif name == "APPEND":
            item = stack.pop()
            stack[-1].append(item)
        elif name == "APPENDS":
            items = _since_mark(stack)
            stack[-1].extend(items)
        elif name == "STOP":
            return stack.pop()
        elif name not in _NOTHING:
            raise ValueError(f"the names of its columns are stored as a program ({name}), which is not run")
    raise IndexError("no end")


def _since_mark(stack: list[Any]) -> list[Any]:
    """Take from the stack what was put there since the last mark, and the mark."""
    marks = [i for i, item in enumerate(stack) if item is _MARK]
    at = marks[-1]
    items = stack[at + 1 :]
    del stack[at:]
    return items
