"""The loop without alias sets, for tests that assert which effects are named and with which size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from unittest import mock

from anglecam.data.record import Record
from anglecam.loop.close import close_records
from anglecam.loop.verdict import Verdict


def close_without_rivals(records: Sequence[Record], **options: Any) -> Verdict:
    """Close the loop, but look for no effects that explain the records as well: half of the time of a closing.

    They are sought after the verdict, which they do not change.
    """
    with mock.patch("anglecam.loop.close._rivals", return_value={}):
        return close_records(records, **options)
