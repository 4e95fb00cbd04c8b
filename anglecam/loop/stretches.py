"""Long sessions: the search works on stretches of the recordings, and the model that it finds is fitted to all of them.

The search fits some hundred models, and its time and memory grow with the number of samples. An effect that matters
shows itself in a few thousand. The stretches are spread evenly over each recording, the first from its beginning and
the last to its end, so that a motion that grows, decays or wears is seen at all its sizes. Each has its initial state
and its zero as nuisance parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from anglecam.data.record import Record

MOST_STRETCHES = 4
"""Stretches of one recording."""
FEWEST_SAMPLES = 250
"""Samples of a stretch; fewer say little beyond its initial state and its zero. If there are more recordings than
stretches of this length, evenly spread ones are used."""


def stretches(records: Sequence[Record], most_samples: int) -> tuple[Record, ...]:
    """Return evenly spread stretches of recordings, about ``most_samples`` samples in all.

    Parameters
    ----------
    records : sequence of Record
        Recordings of one rig; may be empty.
    most_samples : int
        Samples in all, above which recordings are cut.

    Returns
    -------
    tuple of Record
        The recordings if they are short enough; otherwise the stretches, each with its recording's name and the whole
        history of the command.

    Examples
    --------
    >>> time = np.arange(10_000) / 100.0
    >>> swing = Record("swing", time, np.sin(time), None, False, np.full(len(time), np.nan))
    >>> [(float(part.time[0]), len(part.time)) for part in stretches([swing], 2000)]
    [(0.0, 500), (31.66, 500), (63.33, 500), (95.0, 500)]
    """
    share = most_samples / max(1, sum(len(record.time) for record in records))
    if share >= 1.0:
        return tuple(records)
    used = min(len(records), max(1, most_samples // FEWEST_SAMPLES))
    chosen = [records[i] for i in np.linspace(0, len(records) - 1, used).astype(int)]
    return tuple(part for record in chosen for part in _cut(record, share * len(records) / used))


def _cut(record: Record, share: float) -> list[Record]:
    frames = len(record.time)
    kept = min(frames, max(FEWEST_SAMPLES, round(share * frames)))
    count = min(max(1, kept // FEWEST_SAMPLES), MOST_STRETCHES)
    length = kept // count
    firsts = np.linspace(0, frames - length, count).astype(int).tolist()
    if any(second - first <= length for first, second in pairwise(firsts)):
        return [record]
    index = np.arange(frames)
    return [record.only((index >= first) & (index < first + length)) for first in firsts]
