"""Items that a thread prepares."""

from threading import active_count

import pytest

from anglecam.video.read_ahead import read_ahead


def _until(last, taken):
    for k in range(last):
        taken.append(k)
        yield k
    raise ValueError("no more")


def test_items_keep_their_order_and_an_error_comes_after_them():
    taken = []
    items = read_ahead(_until(100, taken))
    assert [next(items) for _ in range(100)] == taken == list(range(100))
    with pytest.raises(ValueError, match="no more"):
        next(items)


def test_who_stops_early_leaves_no_thread_and_little_taken():
    before, taken = active_count(), []
    items = read_ahead(_until(1000, taken))
    assert [next(items) for _ in range(3)] == [0, 1, 2]
    items.close()
    assert active_count() == before
    assert len(taken) < 20


def test_nothing_is_taken_before_the_first_request():
    taken = []
    read_ahead(_until(10, taken))
    assert taken == []


def test_no_items_are_none():
    assert list(read_ahead(iter(()))) == []
