"""Pictures that come as time goes by: from a camera, a pipe, a network stream, or a film that is played at its rate.

A thread takes the packets as they come, records them and hands them on. So nothing is lost while a picture is measured,
and what is recorded does not depend on how fast that is. Each picture carries the instant from which on it could have
been measured: of a film the instant at which a player shows it, otherwise the instant at which its packet came.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from queue import Empty, Full, Queue
from threading import Event, Thread

import av

from anglecam.errors import InputError
from anglecam.io.session import recording_name
from anglecam.video.container import open_container, open_stream
from anglecam.video.decode import Row, decode_container
from anglecam.video.film import Film
from anglecam.video.open_film import film_of_rows
from anglecam.video.recording import Recording

_MANY = 512
"""Packets that wait at most: several seconds of a camera, which does not wait."""
_FEW = 2
"""The same of a pipe: whoever writes it waits."""
_CAMERAS = {"linux": ("v4l2", "/dev/video{}"), "darwin": ("avfoundation", "{}"), "win32": ("dshow", "video={}")}
"""FFmpeg's name of the cameras' interface, and its address of a camera."""
_POLL_S = 0.05


class LiveSource:
    """A source that has been opened; made by `open_live`.

    Parameters
    ----------
    container : InputContainer
        Of which nothing was read.
    name : str
        Of the recording.
    film : Path, optional
        The film that is played; without it the source keeps its own time.
    waiting : int
        Packets that may wait.
    """

    def __init__(self, container: av.container.InputContainer, name: str, film: Path | None, waiting: int) -> None:
        self.name = name
        self.path = film or Path(name)
        """The recording, once it has begun."""
        self._container, self._film = container, film
        self._stream = container.streams.video[0]
        self._queue: Queue[av.Packet | None] = Queue(waiting)
        self._begun = self._latest = 0.0
        self._first: int | None = None
        self._came: dict[float, float] = {}
        self._failed: InputError | None = None
        self._stopped = Event()
        self._recording: Recording | None = None
        self._thread = Thread(target=self._take, name="live source", daemon=True)

    def record(self, folder: Path) -> Path:
        """Begin to take packets and to record them; return the film's path.

        A film that is played is copied. A recording of another source gets a number where its name is taken.

        Raises
        ------
        InputError
            Where its codec cannot be recorded.
        """
        if self._film is not None:
            self.path = folder / self._film.name
            if not (self.path.exists() and self.path.samefile(self._film)):
                shutil.copyfile(self._film, self.path)
        else:
            is_avi = self._container.format.name == "avi"
            self._recording = Recording(folder, _free_name(folder, self.name), self._stream, is_avi)
            self.path = self._recording.path
        self._thread.start()
        return self.path

    def rows(self) -> Iterator[tuple[Row, float]]:
        """Yield the rows, each with the instant of `time.monotonic` from which on it could have been measured, s.

        Raises
        ------
        InputError
            As `anglecam.video.decode.decode`.
        """
        for row in decode_container(self.path, self._container, packets=self._packets()):
            if self._film is None:
                yield row, self._came.pop(row[0], self._latest)
                continue
            shown = self._begun + row[0] - self._seconds(self._first or 0)
            time.sleep(max(0.0, shown - time.monotonic()))  # a decoder may be ahead of the presentation
            yield row, shown

    def film_of(self, rows: Sequence[Row]) -> Film:
        """Return the film that consists of some of the rows."""
        return film_of_rows(self.path, self._container, rows)

    def stop(self) -> None:
        """Take no more packets; those that came are still yielded."""
        self._stopped.set()

    def close(self) -> None:
        """Stop, and end the recording.

        Raises
        ------
        InputError
            Where the recording could not be written.
        """
        self.stop()
        self._thread.join(1.0)  # longer than any camera waits with its next picture; a pipe may never write again
        if self._recording is not None:
            self._recording.close()
        if not self._thread.is_alive():
            self._container.close()
        if self._failed is not None:
            raise self._failed

    def _seconds(self, stamp: int) -> float:
        return stamp * float(self._stream.time_base or 0.0)

    def _packets(self) -> Iterator[av.Packet]:
        while True:
            try:
                packet = self._queue.get(timeout=_POLL_S)
            except Empty:
                if self._stopped.is_set():
                    return
                continue
            if packet is None:
                return
            yield packet

    def _take(self) -> None:
        """Take packets, record them and hand them on, until the source ends or is stopped."""
        try:
            for packet in self._container.demux(self._stream):
                stamp = packet.dts if packet.dts is not None else packet.pts
                if stamp is not None:
                    self._arrange(packet, stamp)
                if self._stopped.is_set():
                    break
                if self._recording is not None and packet.size:
                    self._recording.add(packet)
                self._hand_on(packet)
        except InputError as error:
            self._failed = error
        except (av.error.FFmpegError, OSError):
            pass  # a stream that breaks off has ended
        finally:
            self._hand_on(None)

    def _arrange(self, packet: av.Packet, stamp: int) -> None:
        """Wait until a film's packet is due; count the stamps of another source from its first one on."""
        if self._first is None:
            self._first, self._begun = stamp, time.monotonic()
        if self._film is not None:
            due = self._begun + self._seconds(stamp - self._first)
            self._stopped.wait(max(0.0, due - time.monotonic()))
            return
        packet.dts = None if packet.dts is None else packet.dts - self._first
        packet.pts = None if packet.pts is None else packet.pts - self._first
        shown = packet.pts if packet.pts is not None else stamp - self._first
        self._came[self._seconds(shown)] = self._latest = time.monotonic()

    def _hand_on(self, packet: av.Packet | None) -> None:
        while not self._stopped.is_set():
            try:
                self._queue.put(packet, timeout=_POLL_S)
                return
            except Full:
                continue


def open_live(source: str) -> LiveSource:
    """Open a source of pictures.

    Parameters
    ----------
    source : str
        The number of a camera, the path of a film, ``-`` for the standard input, the path of a named pipe or of a
        camera, or the address of a stream, such as ``rtsp://…``.

    Returns
    -------
    LiveSource
        Of which nothing was read.

    Raises
    ------
    InputError
        Where there is no such source, or it cannot be opened: one line with the source and the cause.
    """
    path = Path(source)
    if source == "-":
        return LiveSource(open_stream("pipe:0", "standard input"), "live", None, _FEW)
    if "://" in source:
        return LiveSource(open_stream(source, source), "live", None, _MANY)
    if source.isdecimal() and not path.exists():
        return _open_camera(int(source))
    if path.is_char_device():
        return LiveSource(open_stream(source, source, _CAMERAS["linux"][0]), path.name, None, _MANY)
    if path.is_fifo():
        return LiveSource(open_stream(f"file:{path}", source), path.stem, None, _FEW)
    return LiveSource(open_container(path), recording_name(path), path, _MANY)


def _open_camera(number: int) -> LiveSource:
    form, address = _CAMERAS.get(sys.platform, _CAMERAS["linux"])
    container = open_stream(address.format(number), f"camera {number}", form)
    return LiveSource(container, f"camera{number}", None, _MANY)


def _free_name(folder: Path, name: str) -> str:
    """Return the name, with a number where the folder has files of that name."""
    free, number = name, 1
    while any(folder.glob(f"{free}.*")):
        number += 1
        free = f"{name}-{number}"
    return free
