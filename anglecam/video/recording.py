"""Record a stream of packets as a film, without decoding them: no quality is lost, and it costs no time to speak of.

The film is a QuickTime file in fragments of a second. It keeps time stamps as exactly as the source states them, where
Matroska rounds them to milliseconds, and a recording that is broken off can be read up to its last fragment. What
QuickTime cannot hold is recorded as Matroska. AVI states no presentation times, so what comes as AVI stays AVI.
"""

from __future__ import annotations

from pathlib import Path

import av

from anglecam.errors import InputError

_FRAGMENTS = {
    "movflags": "empty_moov+default_base_moof+delay_moov",
    "frag_duration": "1000000",
    "movie_timescale": "90000",  # of the first frame's time; milliseconds by default
}
_Form = tuple[str, str, dict[str, str]]
_AVI: tuple[_Form, ...] = (("avi", ".avi", {}),)
_OTHERS: tuple[_Form, ...] = (("mov", ".mov", _FRAGMENTS), ("matroska", ".mkv", {}))
"""FFmpeg's name of a container, the suffix, and options; the first that can hold the codec is used."""


class Recording:
    """A film that is being written.

    Parameters
    ----------
    folder : Path
        Where it is written.
    name : str
        Its name without suffix; a film of that name is overwritten.
    stream : av.VideoStream
        The packets' stream.
    is_avi : bool
        Whether they come from an AVI file.
    """

    def __init__(self, folder: Path, name: str, stream: av.VideoStream, is_avi: bool) -> None:
        self.path, self._container, self._stream = _open(folder, name, stream, is_avi)
        self._closed = False

    def add(self, packet: av.Packet) -> None:
        """Write a packet, unless the film is closed; the packet itself is not changed."""
        if self._closed:
            return
        copy = av.Packet(bytes(packet))
        copy.stream, copy.time_base = self._stream, packet.time_base
        copy.dts = packet.dts  # Matroska states none while the decoder's delay fills; the container makes them up
        copy.pts = packet.pts if packet.pts is not None else packet.dts
        copy.duration, copy.is_keyframe = packet.duration or 0, packet.is_keyframe
        try:
            self._container.mux(copy)
        except (av.error.FFmpegError, OSError) as error:
            raise InputError(f"{self.path}: the recording cannot be written ({error.strerror})") from error

    def close(self) -> None:
        """Write what is left, and close the file."""
        if not self._closed:
            self._closed = True
            self._container.close()


def _open(
    folder: Path, name: str, stream: av.VideoStream, is_avi: bool
) -> tuple[Path, av.container.OutputContainer, av.VideoStream]:
    for form, suffix, options in _AVI if is_avi else _OTHERS:
        path = folder / f"{name}{suffix}"
        container = av.open(str(path), "w", format=form, options=options)
        try:
            copy = container.add_stream_from_template(stream, opaque=True)
            copy.time_base = stream.time_base
            container.start_encoding()
        except (av.error.FFmpegError, ValueError):
            container.close()
            path.unlink(missing_ok=True)
            continue
        return path, container, copy
    raise InputError(f"{folder / name}: its codec {stream.codec_context.name} cannot be recorded")
