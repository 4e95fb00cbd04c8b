"""The clips that the page looks at: opened once, read frame by frame, and the marks that were learnt from them."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Generic, TypeVar

from anglecam.camera.lens import lens_from_rig
from anglecam.camera.shutter import rig_as_shown
from anglecam.data.typing import Image
from anglecam.errors import InputError
from anglecam.io.rig import Rig, RigFrames
from anglecam.measurement.mark_pass import seek_mark
from anglecam.video.film import Film
from anglecam.video.frame_reader import FrameReader
from anglecam.video.open_film import open_film
from anglecam.view.stages import LearntMark

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")
_OPEN_CLIPS = 2
"""Of which decoded pictures are kept."""
_MARKS = 32


@dataclass(frozen=True, eq=False)
class OpenClip:
    """A clip that is looked at."""

    film: Film
    reader: FrameReader

    def image(self, number: int) -> Image | None:
        """Return a frame, (h, w, 3) blue, green, red; ``None`` where it cannot be decoded; raises as `picture`."""
        return self.reader.picture(number).colours


class Clips:
    """Opens clips, and learns their marks; several threads may share it."""

    def __init__(self) -> None:
        self._open = _Recent[tuple[Path, str, float | None], OpenClip](_OPEN_CLIPS)
        self._marks = _Recent[str, LearntMark](_MARKS)
        self._lock, self._learning = Lock(), Lock()

    def open(self, clip: Path, rig: Rig) -> OpenClip:
        """Return a clip; ``rig`` declares how fast numbered pictures follow each other.

        Raises
        ------
        AnglecamError
            As `open_film`.
        """
        key = clip, version_of(clip), rig.frames.rate_hz
        with self._lock:
            known = self._open.get(key)
            if known is None:
                film = open_film(clip, RigFrames(rate_hz=rig.frames.rate_hz))
                known = OpenClip(film, FrameReader(film))
                dropped = self._open.put(key, known)
                if dropped is not None:
                    dropped.reader.close()
            return known

    def learn(self, clip: Path, rig: Rig) -> str:
        """Find the mark of a clip as measuring does, where it was not found before with the same settings.

        Returns
        -------
        str
            The key for `mark`.

        Raises
        ------
        AnglecamError
            Where there is none, or the file cannot be read.
        """
        settings = f"{clip}\n{version_of(clip)}\n{rig.model_dump_json()}"
        key = hashlib.sha256(settings.encode(errors="surrogatepass")).hexdigest()
        with self._learning:  # one at a time: it uses all cores
            if self._marks.get(key) is None:
                film = open_film(clip, rig.frames)
                shown = rig_as_shown(rig, film)
                self._marks.put(key, LearntMark(seek_mark(film, shown), lens_from_rig(shown, film.size, film.path)))
        return key

    def mark(self, key: str) -> LearntMark:
        """Return a mark that was learnt; raise `InputError` where it is forgotten."""
        found = self._marks.get(key)
        if found is None:
            raise InputError("the mark has to be learnt again")
        return found


def version_of(clip: Path) -> str:
    """Return what changes when a file is written again; of a folder of pictures, its time alone."""
    try:
        state = clip.stat()
    except OSError as problem:
        raise InputError(f"{clip}: {problem.strerror}") from problem
    return f"{state.st_mtime_ns:x}-{state.st_size:x}"


class _Recent(Generic[K, V]):
    """The values that were used last."""

    def __init__(self, most: int) -> None:
        self._most, self._values = most, OrderedDict[K, V]()

    def get(self, key: K) -> V | None:
        if key not in self._values:
            return None
        self._values.move_to_end(key)
        return self._values[key]

    def put(self, key: K, value: V) -> V | None:
        """Keep a value; return the one that is dropped for it."""
        self._values[key] = value
        return self._values.popitem(last=False)[1] if len(self._values) > self._most else None
