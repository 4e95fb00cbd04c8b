"""The frames of a film by the stamps of its packets: which there are, when each is shown, where decoding can start.

Nothing is decoded for it, so that it takes a fraction of a second. Where packets alone do not say which frame is which,
there is no index, and the film has to be decoded from its start.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.video.container import MOST_FRAMES, open_container


@dataclass(frozen=True)
class FrameIndex:
    """The frames of a film in the order of presentation, n of them."""

    stamps: NDArray[np.int64]
    """(n,) presentation stamps, increasing, in units of ``base``."""
    keys: NDArray[np.int64]
    """(m,) stamps of the key frames, increasing; an edit list may hide some that decoding starts at."""
    base: float
    """Seconds per unit."""

    @property
    def times(self) -> Floats:
        """(n,) presentation times, s."""
        return np.asarray(self.stamps * self.base, np.float64)

    def key_before(self, number: int) -> int | None:
        """Return the stamp of the last key frame up to a frame; ``None`` where there is none."""
        place = int(np.searchsorted(self.keys, self.stamps[number], side="right"))
        return int(self.keys[place - 1]) if place else None

    def number_of(self, stamp: int) -> int | None:
        """Return the number of the frame with a stamp; ``None`` where no frame has it."""
        place = int(np.searchsorted(self.stamps, stamp))
        return place if place < len(self.stamps) and self.stamps[place] == stamp else None


def index_frames(path: Path) -> FrameIndex | None:
    """Return the index of a film.

    Parameters
    ----------
    path : Path
        The film.

    Returns
    -------
    FrameIndex or None
        ``None`` where packets lack stamps, share them, are damaged or empty, and for an AVI that lacks packets or
        reorders frames, whose order of presentation it does not store.

    Raises
    ------
    InputError
        As `anglecam.video.container.open_container`.
    """
    stamps: list[int] = []
    keys: list[int] = []
    with open_container(path) as container:
        stream = container.streams.video[0]
        is_avi = container.format.name == "avi"
        if is_avi and stream.codec_context.has_b_frames:
            return None
        try:
            for packet in container.demux(stream):
                stamp = packet.dts if is_avi else packet.pts
                if packet.size == 0 and packet.dts is None:  # the packet that ends the stream
                    continue
                if stamp is None or packet.is_corrupt or packet.size == 0 or len(stamps) > MOST_FRAMES:
                    return None
                if packet.is_keyframe:
                    keys.append(stamp)
                if not packet.is_discard:
                    stamps.append(stamp)
        except av.error.FFmpegError:
            return None
        # behind damage, AVI's packets are counted otherwise than in its index, by which it seeks
        listed = len(stream.index_entries) if is_avi else len(stamps)
        base = float(stream.time_base or 0.0)
    shown = np.unique(np.array(stamps, np.int64))
    if not 0 < len(shown) == len(stamps) == listed:
        return None
    return FrameIndex(shown, np.unique(np.array(keys, np.int64)), base)
