"""A film opened once: what its container declares, and its frames, as often as they are needed.

Measuring reads a film several times, and decoding a lossless picture takes as long as measuring in it. A `Film` keeps
the decoded pictures of a short film in a bounded memory from its first complete reading on; a longer film is decoded
again for every reading.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from av.video.frame import PictureType

from anglecam.data.typing import Floats, Image
from anglecam.video.container import open_container
from anglecam.video.decode import Row, decode, to_brightness, to_colours
from anglecam.video.truncation import is_cut_short

MOST_BYTES = 256 * 2**20
"""Of decoded pictures that a film keeps: 220 lossless ones of 640 × 480 px, 580 of an ordinary codec."""
_PREDICTED = (PictureType.P, PictureType.B)


@dataclass(frozen=True)
class Frame:
    """One frame of a film."""

    index: int
    """0 for the first."""
    time: float
    """Presentation time, s, on the clip's clock."""
    image: Image | None
    """(height, width, 3) blue, green, red, or (height, width, 1) brightness; ``None`` where it cannot be decoded."""
    predicted: bool = False
    """Whether the codec derived it from other frames."""


@dataclass(frozen=True)
class Sample:
    """Evenly spaced frames of a whole film."""

    frames: tuple[Frame, ...]
    """Those that could be decoded."""
    count: int
    """Frames in the film, those without a picture included."""
    decoded: int
    """Frames with a picture."""


@dataclass
class _Memory:
    """What a film's first complete reading leaves behind."""

    times: list[float] | None = None
    undecodable: int = 0
    rows: list[Row] | None = None
    """All rows of a short film."""


@dataclass(frozen=True, eq=False)
class Film:
    """A film and what its container declares; made by `open_film`."""

    path: Path
    width: int
    """px."""
    height: int
    """px."""
    declared_frames: int
    """The container's count, 0 where it states none. It may be wrong in a complete file."""
    codec: str
    """FFmpeg's name, such as ``h264``."""
    coarse_colour: bool
    """Whether colour is stored at a lower resolution than brightness."""
    cut_short: bool
    """Whether bytes are missing at the end of the file."""
    _memory: _Memory = field(default_factory=_Memory, repr=False)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the stored picture, px."""
        return self.width, self.height

    @property
    def times(self) -> Floats:
        """(n,) presentation times of all frames, s; reads the film if it was not read before."""
        self._read_times()
        return np.array(self._memory.times)

    @property
    def undecodable(self) -> int:
        """Number of frames that cannot be decoded; reads the film if it was not read before."""
        self._read_times()
        return self._memory.undecodable

    @property
    def rotation_deg(self) -> int:
        """Rotation that players apply to the stored picture, counter-clockwise, degrees; decodes the first picture."""
        return next((picture.rotation for _, picture in self._rows() if picture is not None), 0)

    def frames(self, *, brightness: bool = False) -> Iterator[Frame]:
        """Yield every frame in the order of presentation; memory does not grow with the film's length.

        Parameters
        ----------
        brightness : bool
            Yield the brightness alone, as the codec stored it, instead of colours.

        Yields
        ------
        Frame
            With ``image=None`` where a packet cannot be decoded or is flagged corrupt.

        Raises
        ------
        InputError
            As `anglecam.video.decode.decode`.
        """
        for index, (time, picture) in enumerate(self._rows()):
            image = None if picture is None else to_brightness(picture) if brightness else to_colours(picture)
            predicted = picture is not None and picture.pict_type in _PREDICTED
            yield Frame(index, time, image, predicted)

    def sample(self, most: int) -> Sample:
        """Read the whole film and keep at most ``most`` evenly spaced frames of it.

        The film's length is not known beforehand: when more than ``most`` frames are kept, every second one is dropped
        and the stride doubles.

        Parameters
        ----------
        most : int
            Upper limit of frames to keep, at least 2.

        Returns
        -------
        Sample
            Between half of ``most`` and ``most`` frames; all frames of a shorter film.

        Raises
        ------
        InputError
            As `frames`.
        """
        kept: list[Frame] = []
        stride, count, decoded = 1, 0, 0
        for index, (time, picture) in enumerate(self._rows()):
            count += 1
            decoded += picture is not None
            if index % stride or picture is None:
                continue
            kept.append(Frame(index, time, to_colours(picture)))
            if len(kept) > most:
                stride *= 2
                kept = [frame for frame in kept if frame.index % stride == 0]
        return Sample(tuple(kept), count, decoded)

    def why_truncated(self, sample: Sample) -> str | None:
        """Return how much could be read of a file that ends too early, ``None`` for a complete one."""
        if not self.cut_short or 0 < self.declared_frames <= sample.decoded:
            return None
        of = f" of {self.declared_frames}" if self.declared_frames else ""
        return f"truncated: {sample.decoded}{of} frames could be read"

    def _read_times(self) -> None:
        """Read the film unless it was read completely before."""
        if self._memory.times is None:
            for _ in self._rows():
                pass

    def _rows(self) -> Iterator[Row]:
        """Yield the film's rows from memory, or decode them; the first complete reading fills the memory."""
        memory = self._memory
        if memory.times is not None:
            yield from decode(self.path) if memory.rows is None else memory.rows
            return
        times: list[float] = []
        undecodable = 0
        rows: list[Row] = []
        room = MOST_BYTES
        for row in decode(self.path):
            times.append(row[0])
            undecodable += row[1] is None
            room -= _bytes(row)
            if room >= 0:
                rows.append(row)
            else:
                rows.clear()
            yield row
        memory.times, memory.undecodable = times, undecodable
        memory.rows = rows if room >= 0 else None


def open_film(path: Path) -> Film:
    """Open a film and read what its container declares.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Film
        Not yet decoded.

    Raises
    ------
    InputError
        As `anglecam.video.container.open_container`.
    """
    with open_container(path) as container:
        stream = container.streams.video[0]
        planes = stream.codec_context.format.components if stream.codec_context.format else ()
        return Film(
            path=path,
            width=stream.width,
            height=stream.height,
            declared_frames=stream.frames,
            codec=stream.codec_context.name,
            coarse_colour=any(plane.width < stream.width for plane in planes),
            cut_short=is_cut_short(path),
        )


def _bytes(row: Row) -> int:
    picture = row[1]
    return 0 if picture is None else sum(plane.buffer_size for plane in picture.planes)
