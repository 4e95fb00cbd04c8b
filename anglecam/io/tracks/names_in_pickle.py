"""Read the names of a pandas table's columns from the pickle in which PyTables stores them, without unpickling it.

A pickle is a program. A pickle of names only builds lists, tuples and texts. The standard library's disassembler
(`pickletools.genops`, which runs nothing) lists its instructions, and this module follows the few that build those.
Any other instruction, above all one that would import or call something, ends the reading with an error.
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
_WITHOUT_EFFECT = {"PROTO", "FRAME"}
_MARK = object()


def read_names(pickled: bytes) -> list[tuple[str, ...]]:
    """Read a list of tuples of texts from a pickle.

    Parameters
    ----------
    pickled : bytes
        A pickle of any protocol.

    Returns
    -------
    list of tuple of str
        The tuples in their order.

    Raises
    ------
    ValueError
        If the pickle holds anything else or is damaged.
    """
    try:
        found = _follow(pickled)
    except (IndexError, KeyError, AttributeError) as fault:
        raise ValueError("the names of its columns are stored in a damaged form") from fault
    if not isinstance(found, list) or not all(isinstance(column, tuple) for column in found):
        raise ValueError("its columns are not named by several parts each")
    return [tuple(as_text(part) for part in column) for column in found]


def _follow(pickled: bytes) -> Any:
    """Return the object that the instructions build."""
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
        elif name not in _WITHOUT_EFFECT:
            raise ValueError(f"the names of its columns are stored as a program ({name}), which is not run")
    raise IndexError("no end")


def _since_mark(stack: list[Any]) -> list[Any]:
    """Remove the last mark and everything above it from the stack; return what was above it."""
    marks = [i for i, item in enumerate(stack) if item is _MARK]
    at = marks[-1]
    items = stack[at + 1 :]
    del stack[at:]
    return items
