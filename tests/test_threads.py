"""Work in threads: its results are in order, and the same as without."""

from __future__ import annotations

import threading
from functools import partial

import pytest

from anglecam.threads import Backlog, map_in_threads


@pytest.mark.parametrize("threads", ["1", "2"])
def test_results_are_in_the_order_of_the_work(monkeypatch, threads):
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    backlog: Backlog[int] = Backlog()
    for k in range(40):
        backlog.add(partial(pow, k, 2))
    assert backlog.results() == [k**2 for k in range(40)]
    assert map_in_threads(lambda k: k + 1, range(5)) == [1, 2, 3, 4, 5]


def test_work_does_not_pile_up(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    release, begun = threading.Event(), []
    backlog: Backlog[None] = Backlog()

    def work(k):
        begun.append(k)
        release.wait(10.0)

    for k in range(8):
        backlog.add(partial(work, k))
    waits = threading.Thread(target=backlog.add, args=(partial(work, 8),))
    waits.start()
    waits.join(0.2)
    assert waits.is_alive()  # until the oldest is done
    assert len(begun) <= 1
    release.set()
    waits.join(10.0)
    assert len(backlog.results()) == 9


def test_an_error_is_raised_where_the_results_are_used(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    backlog: Backlog[float] = Backlog()
    backlog.add(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        backlog.results()
