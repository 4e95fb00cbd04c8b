"""Draws the frames of a session, in one spawned worker process per core, or in this process if there are few.

Workers are spawned because a forked renderer hangs. Each sets up the scene once, takes plans of a few frames at a time
and returns finished pictures including noise, so that the result does not depend on which worker drew a frame.
"""

from __future__ import annotations

import collections
import contextlib
import ctypes
import multiprocessing
import multiprocessing.util
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from synth.errors import RenderError
from synth.spec import Spec
from synth.take import Exposure, Take, View, plan

if TYPE_CHECKING:
    from synth.camera import Pinhole
    from synth.draw.edge_error import EdgeError
    from synth.draw.engine import Engine
    from synth.film import Stage
    from synth.mechanism import Part

Frames = NDArray[np.uint8]

CHUNK = 4
"""Frames that a worker draws at a time."""
WORTH_A_WORKER = 60
"""Number of frames that take about as long to draw as another worker takes to start."""
REPLACEMENTS = 2
"""Number of times that dead workers are replaced before giving up."""


_PR_SET_PDEATHSIG = 1
_EGL = "Mesa's EGL is needed: apt-get install libegl1 libgl1 libgl1-mesa-dri; or set render: {engine: raster}"


def workers() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def studio(spec: Spec, seen: View, frames: int) -> Studio | Solo:
    """Return workers to draw a session of so many frames, or this process if a single worker would suffice.

    A renderer that needs a graphics library always runs in a separate process.
    """
    count = min(workers(), 1 + frames // WORTH_A_WORKER)
    return Solo(spec, seen) if count == 1 and spec.render.engine == "raster" else Studio(spec, seen, count)


class Solo:
    """Draws in this process, with the methods of `Studio`; use it in a ``with`` block."""

    def __init__(self, spec: Spec, seen: View) -> None:
        self._spec, self._seen = spec, seen
        self._painter = _Painter(spec, seen)

    def __enter__(self) -> Solo:
        return self

    def __exit__(self, *_: object) -> None:
        self._painter.strike()

    def edge_error(self) -> EdgeError:
        """Measure the engine's edge errors at the rendered quality."""
        return self._painter.measure_edges()

    def film(self, take: Take, frames: Sequence[int]) -> Iterator[NDArray[np.uint8]]:
        """Draw frames of one recording, in order."""
        for frame in frames:
            yield self._painter.draw(take.number, [plan(self._spec, self._seen, take, frame)])[0]


class Studio:
    """A pool of worker processes; use it in a ``with`` block."""

    def __init__(self, spec: Spec, seen: View, count: int) -> None:
        self._spec = spec
        self._seen = seen
        self._count = count
        self._replacements = REPLACEMENTS
        self._pool = self._hire()

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def edge_error(self) -> EdgeError:
        """Measure the engine's edge errors at the rendered quality.

        Returns
        -------
        EdgeError
            Errors in px.

        Raises
        ------
        RenderError
            If the machine cannot draw off-screen.
        """
        return self._pool.submit(_measure_edges).result()

    def film(self, take: Take, frames: Sequence[int]) -> Iterator[NDArray[np.uint8]]:
        """Draw frames of one recording, in order.

        Parameters
        ----------
        take : Take
            The recording.
        frames : sequence of int
            Numbers of the frames.

        Yields
        ------
        ndarray
            A frame, (height, width, 3), RGB.

        Raises
        ------
        RenderError
            If the machine cannot draw off-screen.
        """
        done = 0
        while done < len(frames):
            try:
                for drawn in self._draw_ahead(take, frames[done:]):
                    done += len(drawn)
                    yield from drawn
            except BrokenProcessPool as error:
                # Out of memory, or killed from outside. Frames are independent, so new workers simply continue.
                if self._replacements == 0:
                    raise RenderError(
                        f"the drawing processes died {REPLACEMENTS + 1} times; is memory short?"
                    ) from error
                self._replacements -= 1
                self._pool.shutdown(cancel_futures=True)
                self._pool = self._hire()

    def _hire(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self._count,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_set_up,
            initargs=(self._spec, self._seen),
        )

    def _draw_ahead(self, take: Take, frames: Sequence[int]) -> Iterator[Frames]:
        starts = iter(range(0, len(frames), CHUNK))
        waiting: collections.deque[Future[Frames]] = collections.deque()
        while True:
            # enough jobs that no worker idles, few enough that finished pictures do not pile up
            while len(waiting) < 3 * self._count and (start := next(starts, None)) is not None:
                plans = [plan(self._spec, self._seen, take, frame) for frame in frames[start : start + CHUNK]]
                waiting.append(self._pool.submit(_draw, take.number, plans))
            if not waiting:
                return
            yield waiting.popleft().result()


class _Painter:
    """Draws one session; the scene is set up with the first drawing."""

    def __init__(self, spec: Spec, seen: View) -> None:
        self._spec, self._seen = spec, seen
        self._stage: Stage | None = None

    def measure_edges(self) -> EdgeError:
        with _one_line(self._spec):
            from synth.draw.edge_error import edge_error
            from synth.draw.engine import make_engine

            def make(parts: Sequence[Part], camera: Pinhole, quality: str, gamma: float) -> Engine:
                return make_engine(self._spec.render, parts, camera, gamma)

            self.strike()  # OpenGL allows one live renderer per process
            return edge_error(make, self._spec.render.quality)

    def draw(self, recording: int, plans: Sequence[Exposure]) -> Frames:
        with _one_line(self._spec):
            if self._stage is None:
                from synth.film import Stage  # so that renderers load only in processes that draw

                self._stage = Stage(self._spec, self._seen)
            return np.stack([self._stage.picture(recording, exposure) for exposure in plans])

    def strike(self) -> None:
        """Take the stage down."""
        if self._stage is not None:
            self._stage.close()
        self._stage = None


_painter: _Painter
"""The painter of this worker process."""


def _set_up(spec: Spec, seen: View) -> None:
    """Prepare a worker; the renderer is released when the process ends for any reason."""
    global _painter
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    if sys.platform == "linux":
        # die with the parent, even if it was killed before this worker was ready
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        parent = multiprocessing.parent_process()
        if parent is not None and os.getppid() != parent.pid:
            os._exit(1)
    _painter = _Painter(spec, seen)
    multiprocessing.util.Finalize(None, _painter.strike, exitpriority=10)


def _measure_edges() -> EdgeError:
    return _painter.measure_edges()


def _draw(recording: int, plans: Sequence[Exposure]) -> Frames:
    return _painter.draw(recording, plans)


@contextlib.contextmanager
def _one_line(spec: Spec) -> Iterator[None]:
    """Raise any drawing error as a one-line `RenderError`; some graphics libraries' exceptions cannot be pickled."""
    try:
        yield
    except Exception as error:  # noqa: BLE001
        advice = f"; {_EGL}" if spec.render.engine == "pyrender" else ""
        said = " ".join(str(error).split())[:200]
        raise RenderError(f"no picture can be drawn off-screen ({type(error).__name__}: {said}){advice}") from None
