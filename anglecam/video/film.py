"""A film opened once: what its container declares, and its frames, as often as they are needed.

The frames are those that a player shows, as it shows them: upright, with square pixels, one instant each.

Measuring reads a film several times, and decoding a lossless picture takes as long as measuring in it. A `Film` keeps
the decoded pictures of a short film in a bounded memory from its first complete reading on; a longer film is decoded
again for every reading.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path

import av
import numpy as np
from av.video.frame import PictureType

from anglecam.data.typing import Floats, Image
from anglecam.errors import InputError, RigError
from anglecam.io.numbered_images import find_numbered_images
from anglecam.io.rig import RigFrames
from anglecam.threads import native_threads
from anglecam.video.container import open_container
from anglecam.video.decode import Row, decode, decode_container, to_brightness, to_colours
from anglecam.video.display import Display, read_display
from anglecam.video.fields import STILL_CODECS, fill_rows, first_field, is_bottom_first
from anglecam.video.images import decode_images
from anglecam.video.read_ahead import read_ahead
from anglecam.video.truncation import is_cut_short

MOST_BYTES = 256 * 2**20
"""Of decoded pictures that a film keeps: 220 lossless ones of 640 × 480 px, 580 of an ordinary codec."""
_PREDICTED = (PictureType.P, PictureType.B)


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
    """Frames with a picture."""


@dataclass
class _Memory:
    """What a film's first complete reading leaves behind."""

    times: list[float] | None = None
    undecodable: int = 0
    interlaced: int = 0
    rows: list[Row] | None = None
    """All rows of a short film."""
    samples: dict[int, Sample] = field(default_factory=dict)
    """By the upper limit of their frames: several stages look at the same ones."""


@dataclass(frozen=True, eq=False)
class Film:
    """A film and what its container declares; made by `open_film`."""

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
    decode: Callable[[], Iterator[Row]] = field(repr=False)
    """Decodes all its rows from the start, because seeking may end on a wrong frame."""
    bottom_first: bool | None = None
    """Whether the second line of an interlaced picture belongs to its first field; ``None`` where all lines of a
    picture are of one instant, as in photographs."""
    wanted: RigFrames = field(default_factory=RigFrames)
    """Which frames are measured: only these are yielded."""
    _memory: _Memory = field(default_factory=_Memory, repr=False)

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
        return self.wanted.first or 0

    @property
    def times(self) -> Floats:
        """(n,) presentation times of the frames, s; reads the film if it was not read before."""
        self._read_once()
        return np.array(self._memory.times)

    @property
    def undecodable(self) -> int:
        """Number of frames that cannot be decoded; reads the film if it was not read before."""
        self._read_once()
        return self._memory.undecodable

    @property
    def interlaced(self) -> int:
        """Number of frames of which only the first field is shown; reads the film if it was not read before."""
        self._read_once()
        return self._memory.interlaced

    def frames(self, *, brightness: bool = False) -> Iterator[Frame]:
        """Yield the frames in the order of presentation; memory does not grow with the film's length.

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
            As `anglecam.video.decode.decode`, and where the film ends before the first frame that is wanted.
        """
        frames = self._frames(brightness)
        yield from read_ahead(frames) if native_threads() > 1 else frames

    def _frames(self, brightness: bool) -> Iterator[Frame]:
        for index, (time, picture) in enumerate(self._rows()):
            image = None if picture is None else self._shown(picture, brightness)
            predicted = picture is not None and picture.pict_type in _PREDICTED
            yield Frame(index, time, image, predicted)

    def sample(self, most: int) -> Sample:
        """Read the whole film, if it was not sampled before, and keep at most ``most`` evenly spaced frames of it.

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
        if most in self._memory.samples:
            return self._memory.samples[most]
        kept: list[Frame] = []
        stride, count, decoded = 1, 0, 0
        for index, (time, picture) in enumerate(self._rows()):
            count += 1
            decoded += picture is not None
            if index % stride or picture is None:
                continue
            kept.append(Frame(index, time, self._shown(picture)))
            if len(kept) > most:
                stride *= 2
                kept = [frame for frame in kept if frame.index % stride == 0]
        self._memory.samples[most] = sample = Sample(tuple(kept), count, decoded)
        return sample

    def why_truncated(self, sample: Sample) -> str | None:
        """Return how much could be read of a file that ends too early, ``None`` for a complete one."""
        last = self.wanted.last
        if not self.cut_short or 0 < self.declared_frames <= sample.decoded:
            return None
        if last is not None and sample.count == last - self.first_frame + 1:
            return None
        of = f" of {self.declared_frames}" if self.declared_frames else ""
        return f"truncated: {sample.decoded}{of} frames could be read"

    def _shown(self, picture: av.VideoFrame, brightness: bool = False) -> Image:
        """Return a picture as a player shows it, of an interlaced one the first field."""
        convert = to_brightness if brightness else to_colours
        if self.bottom_first is None or not picture.interlaced_frame:
            return self.display.show(convert(picture))
        field = convert(first_field(picture, self.bottom_first))
        return self.display.show(fill_rows(field, self.display.stored_size[1], self.bottom_first))

    def _read_once(self) -> None:
        """Read the film unless it was read completely before."""
        if self._memory.times is None:
            for _ in self._rows():
                pass

    def _rows(self) -> Iterator[Row]:
        """Yield the wanted rows from memory, or decode them; the first complete reading fills the memory."""
        memory = self._memory
        if memory.times is not None:
            yield from self._decoded() if memory.rows is None else memory.rows
            return
        times: list[float] = []
        undecodable = interlaced = 0
        rows: list[Row] = []
        room = MOST_BYTES
        for row in self._decoded():
            times.append(row[0])
            undecodable += row[1] is None
            interlaced += self.bottom_first is not None and row[1] is not None and row[1].interlaced_frame
            room -= _bytes(row)
            if room >= 0:
                rows.append(row)
            else:
                rows.clear()
            yield row
        if not times:
            raise InputError(f"{self.path}: it ends before frame {self.first_frame}, the first that is wanted")
        memory.times, memory.undecodable, memory.interlaced = times, undecodable, interlaced
        memory.rows = rows if room >= 0 else None

    def _decoded(self) -> Iterator[Row]:
        """Decode the wanted rows."""
        stop = None if self.wanted.last is None else self.wanted.last + 1
        return islice(self.decode(), self.first_frame, stop)


def open_film(path: Path, frames: RigFrames | None = None) -> Film:
    """Open a film, read what its container declares and decode its first picture, which says how it is shown.

    Parameters
    ----------
    path : Path
        The file, or a folder of numbered pictures.
    frames : RigFrames, optional
        Which frames are measured, and how fast numbered pictures follow each other.

    Returns
    -------
    Film
        Of the wanted frames.

    Raises
    ------
    InputError
        As `anglecam.video.decode.decode`, and where the picture is shown turned by another angle than a multiple of
        90°, or stretched beyond the limits.
    RigError
        Where numbered pictures have no declared rate, or a film has one besides its time stamps.
    """
    wanted = RigFrames() if frames is None else frames
    if path.is_dir():
        return _open_images(path, wanted)
    if wanted.rate_hz is not None:
        raise RigError(f"{path}: frames: {{rate_hz}} is for numbered pictures; a film has time stamps of its own")
    with open_container(path) as container:
        stream = container.streams.video[0]
        codec = stream.codec_context.name
        size = stream.width, stream.height
        coarse_colour = _has_coarse_colour(stream.codec_context.format)
        declared = _declared_frames(container, stream)
        picture = _first_picture(decode_container(path, container))
        return Film(
            path=path,
            display=Display(size) if picture is None else read_display(path, picture, stream.sample_aspect_ratio),
            declared_frames=declared,
            codec=codec,
            coarse_colour=coarse_colour,
            cut_short=is_cut_short(path),
            decode=partial(decode, path),
            bottom_first=None if codec in STILL_CODECS else is_bottom_first(stream.codec_context.field_order),
            wanted=wanted,
        )


def _open_images(folder: Path, wanted: RigFrames) -> Film:
    images = find_numbered_images(folder)
    if wanted.rate_hz is None:
        raise RigError(f"{folder}: numbered pictures have no times: declare frames: {{rate_hz: …}} in rig.yaml")
    decode_all = partial(decode_images, folder, images, wanted.rate_hz)
    picture = _first_picture(decode_all())
    assert picture is not None  # else its decoder has raised
    return Film(
        path=folder,
        display=read_display(folder, picture, None),
        declared_frames=0,
        codec=images[min(images)].suffix[1:].lower(),
        coarse_colour=_has_coarse_colour(picture.format),
        cut_short=False,
        decode=decode_all,
        wanted=wanted,
    )


def _first_picture(rows: Iterator[Row]) -> av.VideoFrame | None:
    return next((picture for _, picture in rows if picture is not None), None)


def _declared_frames(container: av.container.InputContainer, stream: av.VideoStream) -> int:
    """Return the container's count of frames; where an MP4 has an edit list, without those that it leaves out."""
    index = stream.index_entries
    if not container.format.name.startswith("mov") or not len(index):
        return stream.frames
    return sum(not entry.is_discard for entry in index)


def _has_coarse_colour(form: av.VideoFormat | None) -> bool:
    planes = form.components if form else ()
    return any(plane.width < planes[0].width for plane in planes)


def _bytes(row: Row) -> int:
    picture = row[1]
    return 0 if picture is None else sum(plane.buffer_size for plane in picture.planes)
