"""Batches in the test's process: what measures their clips is no process, and measures each clip once.

A clip of eight frames takes a third of a second to measure and to plot, and hundreds of them are measured in tests in
which the angles do not matter. The files that a clip was given are kept with a hash of everything that they depend on:
its bytes and name, and every small file in its folder. Failures are not kept, because they name paths.

How measuring processes start, die and are replaced is for tests that do not use this: of `anglecam.batch.run.run_batch`
as it is, of commands in processes of their own, and of Dask's workers.
"""

from __future__ import annotations

import hashlib
import json
import threading
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from anglecam.batch import run, serve
from anglecam.batch.measuring_process import Abandoned, MeasuringProcess
from anglecam.io.session import CLIP_ENDINGS

_FAILURES = ("cause", "unreadable", "not_written")
_LONG_S = 600.0
"""Time limits that a batch sets itself are at least as long; a shorter one is for a process that can be ended."""


@dataclass(frozen=True)
class _Measured:
    """What a clip was given."""

    answer: dict[str, Any]
    files: dict[str, bytes]
    series: bytes | None


class MeasuredHere:
    """Measures in this process, one clip or session at a time, because Matplotlib draws one figure at a time."""

    _free = threading.Lock()
    _kept: ClassVar[dict[str, _Measured]] = {}

    def __init__(self) -> None:
        self._process = MeasuringProcess()
        self._closed = False

    def ask(self, request: dict[str, Any], time_limit: float) -> dict[str, Any]:
        """Do what a measuring process does; have one do it where it must not take long."""
        if time_limit < _LONG_S:
            return self._process.ask(request, time_limit)
        with self._free:
            if not self._closed:
                answer = serve.fit(request) if "session" in request else self._measure(request)
        if self._closed:
            raise Abandoned
        sent: dict[str, Any] = json.loads(json.dumps(answer))
        return sent

    def close(self) -> None:
        """Give no more answers."""
        self._closed = True
        self._process.close()

    def _measure(self, request: dict[str, Any]) -> dict[str, Any]:
        into, series, key = Path(request["into"]), request["series_file"], _key(request)
        if key not in self._kept:
            answer = serve.measure(request)
            if any(failure in answer for failure in _FAILURES):
                return answer
            files = {file.name: file.read_bytes() for file in into.iterdir()}
            self._kept[key] = _Measured(answer, files, Path(series).read_bytes() if series else None)
            return answer
        found = self._kept[key]
        for name, content in found.files.items():
            (into / name).write_bytes(content)
        if found.series is not None:
            Path(series).write_bytes(found.series)
        return found.answer


def _key(request: dict[str, Any]) -> str:
    """Return a hash of everything that a clip's results depend on."""
    clip, rig = Path(request["clip"]), request["rig"]
    small = [p for p in sorted(clip.parent.rglob("*")) if p.is_file() and not p.name.lower().endswith(CLIP_ENDINGS)]
    files = [clip, *([Path(rig)] if rig else []), *small]
    names = [str(file.relative_to(clip.parent)) if file in (clip, *small) else "the rig" for file in files]
    whole = hashlib.sha256(repr((names, bool(request["series_file"]))).encode())
    for file in files:
        whole.update(hashlib.sha256(file.read_bytes()).digest())
    return whole.hexdigest()


run_batch = partial(run.run_batch, measurer=MeasuredHere)
"""A batch that is measured in this process."""
