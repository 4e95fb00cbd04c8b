"""Open a film: read what its container declares, and how its pictures are shown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import av

from anglecam.errors import RigError
from anglecam.io.numbered_images import find_numbered_images
from anglecam.io.rig import RigFrames
from anglecam.video.container import open_container
from anglecam.video.decode import INTRA_CODECS, Row, decode, decode_container, decode_keys, may_skip
from anglecam.video.display import Display, read_display
from anglecam.video.fields import STILL_CODECS, is_bottom_first
from anglecam.video.film import Film
from anglecam.video.film_rows import FilmRows, ends_before
from anglecam.video.images import decode_images
from anglecam.video.row_cache import picture_bytes
from anglecam.video.truncation import is_cut_short


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
        # of a damaged film, what a decoder says of it changes with the pictures
        size, form = (stream.width, stream.height), stream.codec_context.format
        declared = _declared_frames(container, stream)
        if 0 < declared <= (wanted.first or 0):
            _require_packets(path, wanted.first or 0)
        picture = _first_picture(decode_container(path, container))
        independent = stream.codec_context.name in INTRA_CODECS
        cut_short = is_cut_short(path)
        count = 0 if cut_short else declared
        keys = partial(decode_keys, path) if may_skip(container) else None
        rows = FilmRows(path, partial(decode, path), wanted, independent, count, picture_bytes(picture), keys)
        return _film(path, stream, picture, size, form, rows, declared, cut_short)


def film_of_rows(path: Path, container: av.container.InputContainer, rows: Sequence[Row]) -> Film:
    """Return the film that consists of some rows of a stream.

    Parameters
    ----------
    path : Path
        For messages.
    container : InputContainer
        Whose first video stream the rows are from.
    rows : sequence of (float, VideoFrame or None)
        At least one; they stay in memory.

    Returns
    -------
    Film
        Of these rows.

    Raises
    ------
    InputError
        As `open_film`.
    """
    stream = container.streams.video[0]
    size, form = (stream.width, stream.height), stream.codec_context.format
    return _film(path, stream, _first_picture(iter(rows)), size, form, FilmRows(path, lambda wants: iter(rows)))


def _film(
    path: Path,
    stream: av.VideoStream,
    picture: av.VideoFrame | None,
    size: tuple[int, int],
    form: av.VideoFormat | None,
    rows: FilmRows,
    declared: int = 0,
    cut_short: bool = False,
) -> Film:
    codec = stream.codec_context.name
    return Film(
        path=path,
        display=Display(size) if picture is None else read_display(path, picture, stream.sample_aspect_ratio),
        declared_frames=declared,
        codec=codec,
        coarse_colour=_has_coarse_colour(form),
        cut_short=cut_short,
        rows=rows,
        bottom_first=None if codec in STILL_CODECS else is_bottom_first(stream.codec_context.field_order),
    )


def _open_images(folder: Path, wanted: RigFrames) -> Film:
    images = find_numbered_images(folder)
    if wanted.rate_hz is None:
        raise RigError(f"{folder}: numbered pictures have no times: declare frames: {{rate_hz: …}} in rig.yaml")
    decode_all = partial(decode_images, folder, images, wanted.rate_hz)
    picture = _first_picture(decode_all(None))
    assert picture is not None  # else its decoder has raised
    return Film(
        path=folder,
        display=read_display(folder, picture, None),
        declared_frames=0,
        codec=images[min(images)].suffix[1:].lower(),
        coarse_colour=_has_coarse_colour(picture.format),
        cut_short=False,
        rows=FilmRows(folder, decode_all, wanted, True),
    )


def _first_picture(rows: Iterator[Row]) -> av.VideoFrame | None:
    return next((picture for _, picture in rows if picture is not None), None)


def _declared_frames(container: av.container.InputContainer, stream: av.VideoStream) -> int:
    """Return the container's count of frames; where an MP4 has an edit list, without those that it leaves out."""
    index = stream.index_entries
    if not container.format.name.startswith("mov") or not len(index):
        return stream.frames
    return sum(not entry.is_discard for entry in index)


def _require_packets(path: Path, first: int) -> None:
    """Raise `InputError` where a film has fewer packets than come before its first wanted frame; none is decoded."""
    with open_container(path) as container:
        count = sum(packet.size > 0 for packet in container.demux(container.streams.video[0]))
    if count <= first:
        raise ends_before(path, first, count)


def _has_coarse_colour(form: av.VideoFormat | None) -> bool:
    planes = form.components if form else ()
    return any(plane.width < planes[0].width for plane in planes)
