"""Frames by the thousand: spawned workers, one a core, each with a stage of its own; a few frames without any.

A forked renderer hangs, so the workers are spawned. They are given plans of a few frames at a time and answer with
finished pictures, noise included, so that nothing depends on which worker drew a frame.
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

CHUNK = 8
"""Frames a worker draws at a time."""
WORTH_A_WORKER = 60
"""Frames that take about as long as it takes another worker to start."""
REPLACEMENTS = 2
"""How often dead workers are replaced before we give up."""


_PR_SET_PDEATHSIG = 1
_EGL = "Mesa's EGL is needed: apt-get install libegl1 libgl1 libgl1-mesa-dri; or say render: {engine: raster}"


def workers() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0))


def studio(spec: Spec, seen: View, frames: int) -> Studio | Solo:
    """Choose who draws a session of so many frames: workers, or this process itself where one worker would do.

    A renderer that needs a graphics library always works in a process of its own.
    """
    count = min(workers(), 1 + frames // WORTH_A_WORKER)
    return Solo(spec, seen) if count == 1 and spec.render.engine == "raster" else Studio(spec, seen, count)


class Solo:
    """A single process at work, this one, with the methods of `Studio`; use it in a ``with`` block."""

    def __init__(self, spec: Spec, seen: View) -> None:
        self._spec, self._seen = spec, seen
        self._painter = _Painter(spec, seen)

    def __enter__(self) -> Solo:
        return self

    def __exit__(self, *_: object) -> None:
        self._painter.strike()

    def edge_error(self) -> EdgeError:
        """Measure how far the engine's edges are from exact areas, at the quality that is rendered."""
        return self._painter.measure_edges()

    def film(self, take: Take, frames: Sequence[int]) -> Iterator[NDArray[np.uint8]]:
        """Draw frames of one recording, in order."""
        for frame in frames:
            yield self._painter.draw(take.number, [plan(self._spec, self._seen, take, frame)])[0]


class Studio:
    """Workers at the ready; use it in a ``with`` block."""

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
        """Measure how far the engine's edges are from exact areas, at the quality that is rendered.

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
            Numbers of the wanted frames.

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
                # Short of memory or killed from outside. A frame depends on no other, so new workers just go on.
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
            # enough ahead that no worker idles, not so much that pictures pile up
            while len(waiting) < 3 * self._count and (start := next(starts, None)) is not None:
                plans = [plan(self._spec, self._seen, take, frame) for frame in frames[start : start + CHUNK]]
                waiting.append(self._pool.submit(_draw, take.number, plans))
            if not waiting:
                return
            yield waiting.popleft().result()


class _Painter:
    """A spec, the view of it, and what it is drawn with, once it has been drawn."""

    def __init__(self, spec: Spec, seen: View) -> None:
        self._spec, self._seen = spec, seen
        self._stage: Stage | None = None

    def measure_edges(self) -> EdgeError:
        with _one_line(self._spec):
            from synth.draw.edge_error import edge_error
            from synth.draw.engine import make_engine

            def make(parts: Sequence[Part], camera: Pinhole, quality: str, gamma: float) -> Engine:
                return make_engine(self._spec.render, parts, camera, gamma)

            self.strike()  # OpenGL has one live renderer a process
            return edge_error(make, self._spec.render.quality)

    def draw(self, recording: int, plans: Sequence[Exposure]) -> Frames:
        with _one_line(self._spec):
            if self._stage is None:
                from synth.film import Stage  # renderers load only where they draw

                self._stage = Stage(self._spec, self._seen)
            return np.stack([self._stage.picture(recording, exposure) for exposure in plans])

    def strike(self) -> None:
        """Take the stage down."""
        if self._stage is not None:
            self._stage.close()
        self._stage = None


_painter: _Painter
"""This worker's own."""


def _set_up(spec: Spec, seen: View) -> None:
    """Prepare a worker; the renderer is given back when the process ends, whatever ends it."""
    global _painter
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    if sys.platform == "linux":
        # nobody draws for a parent that was killed, be it before this worker was ready
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
    """Say whatever goes wrong in drawing in one line; graphics libraries raise what cannot even be pickled."""
    try:
        yield
    except Exception as error:  # noqa: BLE001
        advice = f"; {_EGL}" if spec.render.engine == "pyrender" else ""
        said = " ".join(str(error).split())[:200]
        raise RenderError(f"no picture can be drawn off-screen ({type(error).__name__}: {said}){advice}") from None
