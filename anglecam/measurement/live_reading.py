"""What was found in a film while it was recorded, and what is still to be found in it afterwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from anglecam.data.typing import Flags, Image
from anglecam.measurement.frame_reading import Reading
from anglecam.threads import Backlog
from anglecam.video.film import Film
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.segment import LARGEST_SHARE, SMALLEST_SHARE, Region, find_regions
from anglecam.vision.registration.turn import NO_TURN

_SAME_S = 2e-3
"""Difference between the time stamps of a frame in a source and in its recording that rounding explains, s."""


@dataclass(frozen=True)
class LiveReading:
    """What was found in the frames of a film by a camera at rest while it was recorded."""

    found: FoundMark
    """The mark by the first frames."""
    reading: Reading
    measured: Flags
    """Frames that were measured; of the others nothing is known. Frames may be missing at the end."""


def completed(live: LiveReading, film: Film, progress: Callable[[int, int], None] | None = None) -> Reading | None:
    """Read the frames of the recorded film that were not measured while it was recorded.

    Parameters
    ----------
    live : LiveReading
        Of the film.
    film : Film
        As it was recorded.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    Reading or None
        Of all frames; without the body's rotation in those that were left. ``None`` where the frames are not those of
        the recording.
    """
    time, read = film.times, live.reading
    n, known = len(time), len(live.measured)
    if known > n or np.abs(time[:known] - time[0] - (read.time - read.time[0])).max(initial=0.0) > _SAME_S:
        return None
    left = np.ones(n, bool)
    left[:known] = ~live.measured
    decoded, repeated = np.ones(n, bool), np.zeros(n, bool)
    decoded[:known], repeated[:known] = read.decoded, read.repeated
    mark = live.found
    areas = SMALLEST_SHARE * mark.area_px2, LARGEST_SHARE * mark.area_px2
    found: Backlog[list[Region]] = Backlog()
    indices = np.flatnonzero(left)
    before: Image | None = None
    for frame in film.frames(only={*indices.tolist(), *(indices - 1).tolist()}):
        i, image = frame.index, frame.image
        if i < n and left[i]:
            decoded[i] = image is not None
            repeated[i] = i > 0 and image is not None and before is not None and np.array_equal(image, before)
            look = (
                list if image is None else partial(find_regions, image, live.found.model, areas, live.found.opening_px)
            )
            found.add(look)
        before = image
        if progress is not None:
            progress(i + 1, n)
    regions = [*read.regions, *([] for _ in range(n - known))]
    for i, of_frame in zip(indices.tolist(), found.results(), strict=True):
        regions[i] = of_frame
    turns = read.turns
    if turns is not None:
        late = n - known
        turns = replace(turns, begun=[*turns.begun, *[np.nan] * late], found=[*turns.found, *[NO_TURN] * late])
    return Reading(time, tuple(regions), decoded, repeated, None, turns)
