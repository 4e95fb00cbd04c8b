"""Which frame a decoded picture is, and which frames were lost before it.

Decoders drop some broken packets without an error. So the stamp of every packet is remembered until its picture comes;
stamps that are left over belong to lost frames, which keep their rows.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator

import av

_LONGEST_WAIT = 32
"""Frames for which a decoder may hold a picture back in order to show others first: encoders use up to 16."""


class PresentationStamps:
    """For containers whose packets state when they are presented."""

    def __init__(self) -> None:
        self._pending: list[int] = []
        self._broken: set[int] = set()

    def expect(self, packet: av.Packet, is_lost: bool) -> None:
        """Remember the stamp of a packet that was given to the decoder, and whether it could not be decoded."""
        stamp = packet.pts if packet.pts is not None else packet.dts
        if stamp is None:
            return
        if packet.pts is not None or is_lost:
            heapq.heappush(self._pending, stamp)
        if is_lost:
            self._broken.add(stamp)

    def place(self, picture: av.VideoFrame) -> tuple[list[int], int | None, bool]:
        """Return the stamps of the frames lost before a picture, its stamp, and whether its packet was intact.

        The stamp is ``None`` where neither the picture nor its packet has one.
        """
        stamp = picture.pts if picture.pts is not None else picture.dts
        if stamp is None:
            return [], None, False
        lost = []
        while self._pending and self._pending[0] < stamp:
            lost.append(heapq.heappop(self._pending))
        if self._pending and self._pending[0] == stamp:
            heapq.heappop(self._pending)
        intact = stamp not in self._broken
        self._broken.discard(stamp)
        return lost, stamp, intact

    def left(self) -> Iterator[int]:
        """Yield the stamps whose pictures never came."""
        while self._pending:
            yield heapq.heappop(self._pending)


class CountedStamps:
    """For AVI, which stores no presentation times: frames follow each other, one for each packet, as they are shown.

    The packets' stamps are their numbers in the order of decoding, and those of the pictures are the same numbers in
    the order of presentation. To find out which packets are lost, each is given its number as the presentation time,
    and the decoder hands it on to the picture. Where a codec reorders frames, the place of a lost one among its
    neighbours is not known, and theirs may be off by some frames.
    """

    def __init__(self, decoder: av.VideoCodecContext) -> None:
        self._decoder = decoder
        self._free: list[int] = []
        self._waiting: set[int] = set()
        self._lost: list[int] = []
        self._damaged: set[int] = set()

    def expect(self, packet: av.Packet, is_lost: bool) -> None:
        """Remember the number of a packet that was given to the decoder, and whether it could not be decoded."""
        if packet.dts is None:
            return
        heapq.heappush(self._free, packet.dts)
        if is_lost:
            heapq.heappush(self._lost, packet.dts)
        else:
            self._waiting.add(packet.dts)

    def place(self, picture: av.VideoFrame) -> tuple[list[int], int | None, bool]:
        """Return the numbers of the frames lost before a picture, its number, and whether its packet was intact."""
        decoded = picture.pts
        if decoded is None or not self._free:
            return [], None, False
        intact = decoded in self._waiting
        self._waiting.discard(decoded)
        if not intact:  # its packet counts as lost, but has a picture nevertheless
            self._damaged.add(decoded)
        wait = _LONGEST_WAIT if self._decoder.has_b_frames else 0
        for number in [number for number in self._waiting if number < decoded - wait]:
            self._waiting.remove(number)
            heapq.heappush(self._lost, number)
        lost = []
        while self._lost and self._lost[0] <= self._free[0]:
            number = heapq.heappop(self._lost)
            if number not in self._damaged:
                lost.append(heapq.heappop(self._free))
        return lost, heapq.heappop(self._free) if self._free else None, intact

    def left(self) -> Iterator[int]:
        """Yield the numbers whose pictures never came."""
        while self._free:
            yield heapq.heappop(self._free)
