"""Read ahead: a thread prepares the next items while the present one is used.

Decoding and the conversion of colours leave Python's lock to others, so that a second core has work. The order, and
what each item is, do not change.
"""

from __future__ import annotations

from collections.abc import Iterator
from queue import Queue
from threading import Event, Thread
from typing import TypeVar, cast

T = TypeVar("T")
_AHEAD = 4
"""Items that wait at most: enough for the two sides to take turns, and little memory."""


def read_ahead(items: Iterator[T]) -> Iterator[T]:
    """Yield the items, which a thread takes from their iterator.

    Parameters
    ----------
    items : iterator
        Used by that thread alone, from the first request to the last item or until this generator is closed.

    Yields
    ------
    object
        The items in their order.

    Raises
    ------
    Exception
        What the iterator raises, after the items before it.
    """
    waiting: Queue[tuple[T | None, bool]] = Queue(_AHEAD)
    raised: list[Exception] = []
    abandoned = Event()

    def take() -> None:
        try:
            for item in items:
                waiting.put((item, True))
                if abandoned.is_set():
                    return
        except Exception as error:  # noqa: BLE001 - it is raised again where the items are used
            raised.append(error)
        finally:
            waiting.put((None, False))

    thread = Thread(target=take, name="read ahead", daemon=True)
    thread.start()
    try:
        while (taken := waiting.get())[1]:
            yield cast(T, taken[0])
        if raised:
            raise raised[0]
    finally:
        abandoned.set()
        while thread.is_alive():  # it may wait for room
            while not waiting.empty():
                waiting.get_nowait()
            thread.join(0.01)
