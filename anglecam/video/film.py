"""A film opened once: what its container declares, and its frames, as often as they are needed.

The frames are those that a player shows, as it shows them: upright, with square pixels, one instant each.

The pictures of a short film are kept in a bounded memory from its first reading on (`anglecam.video.film_rows`). A
longer film is decoded again for every reading; evenly spaced pictures of it are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.progress import Progress, counted
from anglecam.threads import native_threads
from anglecam.video.decode import Row
from anglecam.video.display import Display
from anglecam.video.film_rows import FilmRows, first_of_each, why_short
from anglecam.video.picture import Picture
from anglecam.video.read_ahead import read_ahead

T = TypeVar("T")


@dataclass(frozen=True)
class Frame:
    """One frame of a film."""

    index: int
    """0 for the first that is measured."""
    time: float
    """Presentation time, s, on the clip's clock."""
    image: Image | None
    """(height, width, 3) blue, green, red, or (height, width, 1) brightness; ``None`` where it cannot be decoded."""
    predicted: bool = False
    """Whether the codec derived it from other frames."""


@dataclass(frozen=True)
class Sample:
    """Evenly spaced frames of all that are measured of a film."""

    frames: tuple[Frame, ...]
    """Those that could be decoded."""
    count: int
    """Frames in the film, those without a picture included."""
    decoded: int
    """Frames with a picture, of those that were decoded to take the sample."""


@dataclass(frozen=True, eq=False)
class Film:
    """A film and what its container declares; made by `anglecam.video.open_film`."""

    path: Path
    """The file, or the folder of numbered pictures."""
    display: Display
    """From the stored picture to the shown one."""
    declared_frames: int
    """The container's count, 0 where it states none. It may be wrong in a complete file."""
    codec: str
    """FFmpeg's name, such as ``h264``."""
    coarse_colour: bool
    """Whether colour is stored at a lower resolution than brightness."""
    cut_short: bool
    """Whether bytes are missing at the end of the file."""
    rows: FilmRows = field(repr=False)
    """Its frames as they are stored."""
    bottom_first: bool | None = None
    """Whether the second line of an interlaced picture belongs to its first field; ``None`` where all lines of a
    picture are of one instant, as in photographs."""
    _samples: dict[int, Sample] = field(default_factory=dict, init=False, repr=False)
    """By the upper limit of their frames: several stages look at the same ones. A film that is made from another one
    has samples of its own, because it shows other pictures."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the shown picture, px."""
        return self.display.size

    @property
    def width(self) -> int:
        """Width of the shown picture, px."""
        return self.size[0]

    @property
    def height(self) -> int:
        """Height of the shown picture, px."""
        return self.size[1]

    @property
    def first_frame(self) -> int:
        """Number in the film of the first frame that is measured; the film's first frame has 0."""
        return self.rows.first

    @property
    def times(self) -> Floats:
        """(n,) presentation times of the frames, s; reads the film if it was not read before."""
        return np.array(self.rows.times)

    @property
    def count(self) -> int:
        """Number of frames, some of which may lack a picture; reads what the film is learnt from."""
        return self.rows.count

    def learn(self, progress: Progress) -> None:
        """Read the pictures from which is learnt what the film shows, unless they were read before.

        Raises
        ------
        InputError
            As `frames`.
        """
        self.rows.learn(counted(progress, "reading pictures to learn what moves", self.rows.declared))

    @property
    def undecodable(self) -> int:
        """Number of frames that cannot be decoded; reads the film if it was not read before."""
        return self.rows.undecodable

    @property
    def interlaced(self) -> int:
        """Number of frames of which only the first field is shown; reads the film if it was not read before."""
        return 0 if self.bottom_first is None else self.rows.interlaced

    def frames(self, *, brightness: bool = False, only: Set[int] | None = None) -> Iterator[Frame]:
        """Yield the frames in the order of presentation; memory does not grow with the film's length.

        Parameters
        ----------
        brightness : bool
            Yield the brightness alone, as the codec stored it, instead of colours.
        only : set of int, optional
            Numbers of the frames to yield; without it all are.

        Yields
        ------
        Frame
            With ``image=None`` where a packet cannot be decoded or is flagged corrupt.

        Raises
        ------
        InputError
            As `anglecam.video.decode.decode`, and where the film ends before the first frame that is wanted.
        """
        pictures = (p for p in self._pictures(only) if only is None or p.index in only)
        frames = (Frame(p.index, p.time, p.brightness if brightness else p.colours, p.predicted) for p in pictures)
        yield from read_ahead(frames) if native_threads() > 1 else frames

    def pictures(self, prepare: Callable[[Picture], T]) -> Iterator[tuple[Picture, T]]:
        """Yield the frames as `frames` does, each as a picture that is converted when it is needed.

        Parameters
        ----------
        prepare : callable
            What is done with every picture, in their order. A thread does it ahead, as the decoding.

        Yields
        ------
        picture : Picture
            Of every frame.
        prepared : object
            What ``prepare`` returned for it.
        """
        prepared = ((picture, prepare(picture)) for picture in self._pictures(None))
        yield from read_ahead(prepared) if native_threads() > 1 else prepared

    def _pictures(self, only: Set[int] | None) -> Iterator[Picture]:
        for index, row in enumerate(self.rows.read(None if only is None else only.__contains__)):
            yield self.picture(index, row)

    def picture(self, index: int, row: Row) -> Picture:
        """Return a row of the film as a picture that is converted when it is needed."""
        return Picture(index, *row, self.display, self.bottom_first)

    def sample(self, most: int) -> Sample:
        """Return at most ``most`` evenly spaced frames; read the film if it was not read before.

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
        if most not in self._samples:
            pictures, decoded = self._evenly_spaced(most)
            frames = tuple(Frame(p.index, p.time, p.colours) for p in pictures)
            intact = self.rows.count - self.rows.undecodable if self.rows.is_read else decoded
            self._samples[most] = Sample(frames, self.rows.count, intact)
        return self._samples[most]

    def stills(self, most: int) -> list[Picture]:
        """Return at most ``most`` pictures, spread over the film, to be converted when they are needed."""
        decoded = [(number, row) for number, row in self.rows.kept.rows if row[1] is not None]
        chosen = np.linspace(0, len(decoded) - 1, min(most, len(decoded))).round().astype(int)
        return [self.picture(*decoded[k]) for k in chosen]

    def _evenly_spaced(self, most: int) -> tuple[list[Picture], int]:
        """Return at most ``most`` pictures, and of how many they are chosen."""
        decoded = [(number, row) for number, row in self.rows.kept.rows if row[1] is not None]
        stride = 1
        while len(first_of_each(stride, decoded)) > most:
            stride *= 2
        return [self.picture(number, row) for number, row in first_of_each(stride, decoded)], len(decoded)

    def thinned(self) -> Film | None:
        """Return the film that consists of the frames kept in memory; ``None`` where these are all of its frames."""
        kept = self.rows.kept
        if kept.stride == 1:
            return None
        rows = [row for _, row in kept.rows]
        return replace(self, rows=FilmRows(self.path, lambda wants: iter(rows)))

    def why_truncated(self, sample: Sample) -> str | None:
        """Return how much could be read of a film that ends before its last wanted frame; ``None`` for another."""
        end = self.first_frame + sample.count
        short = why_short(self.rows.wanted.last, end)
        if not self.cut_short or 0 < self.declared_frames <= sample.decoded:
            return short
        if self.rows.wanted.last is not None and short is None:
            return None
        of = f" of {self.declared_frames}" if self.declared_frames else ""
        return f"truncated: {sample.decoded}{of} frames could be read"
