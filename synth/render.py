"""Frames by the thousand: spawned workers, one a core, each with a renderer of its own.

A forked renderer hangs, so the workers are spawned. They are asked for a few frames at a time and answer with
finished pictures, noise included, so that nothing depends on which worker drew a frame: the noise of frame k of
recording r comes from the seed, r and k alone.
"""

from __future__ import annotations

import collections
import multiprocessing
import multiprocessing.util
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synth.camera import Pinhole
from synth.mesh import build, poses
from synth.spec import Rig

Frames = NDArray[np.uint8]

CHUNK = 8
"""Frames a worker draws at a time."""
REPLACEMENTS = 2
"""How often dead workers are replaced before we give up."""


_NEEDED = "Mesa's EGL is needed: apt-get install libegl1 libgl1 libgl1-mesa-dri"


class RenderError(Exception):
    """The machine cannot draw; the text is the one line that the user reads."""


@dataclass(frozen=True)
class Shot:
    """What every worker needs to know."""

    rig: Rig
    camera: Pinhole
    noise_grey: float
    """Standard deviation, grey levels."""
    seed: int


def workers() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0))


class Studio:
    """Workers at the ready; use it in a ``with`` block."""

    def __init__(self, shot: Shot, count: int) -> None:
        self._shot = shot
        self._count = count
        self._replacements = REPLACEMENTS
        self._pool = self._hire()

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def film(self, recording: int, angles: Sequence[float]) -> Iterator[Frames]:
        """Draw the frames of one recording, in order.

        Parameters
        ----------
        recording : int
            Its number in the spec; part of the noise's seed.
        angles : sequence of float
            Head angle of each frame, rad.

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
        while done < len(angles):
            try:
                for drawn in self._draw_ahead(recording, angles, done):
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
            self._count, mp_context=multiprocessing.get_context("spawn"), initializer=_set_up, initargs=(self._shot,)
        )

    def _draw_ahead(self, recording: int, angles: Sequence[float], first: int) -> Iterator[Frames]:
        starts = iter(range(first, len(angles), CHUNK))
        waiting: collections.deque[Future[Frames]] = collections.deque()
        while True:
            # enough ahead that no worker idles, not so much that pictures pile up
            while len(waiting) < 3 * self._count and (start := next(starts, None)) is not None:
                waiting.append(self._pool.submit(_draw, recording, start, angles[start : start + CHUNK]))
            if not waiting:
                return
            yield waiting.popleft().result()


_shot: Shot
_stage: Any
"""What this worker draws with: a Stage, or why there is none."""


def _set_up(shot: Shot) -> None:
    """Prepare a worker; the renderer is given back when the process ends, whatever ends it."""
    global _shot, _stage
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    _shot = shot
    try:
        from synth.offscreen import Stage  # graphics libraries load in the workers only

        _stage = Stage(shot.camera, build(shot.rig, shot.seed))
    except Exception as error:  # noqa: BLE001 - whatever it is, the parent must hear of it in one line
        _stage = error
    else:
        multiprocessing.util.Finalize(_stage, _stage.close, exitpriority=10)


def _draw(recording: int, first: int, angles: Sequence[float]) -> Frames:
    if isinstance(_stage, Exception):
        raise RenderError(f"no picture can be drawn off-screen ({type(_stage).__name__}: {_stage}); {_NEEDED}")
    pictures = []
    for frame, angle in enumerate(angles, first):
        picture = _stage.picture(poses(_shot.rig.linkage, float(angle)))
        if _shot.noise_grey > 0:
            # the same as SeedSequence(seed).spawn(...)[recording].spawn(...)[1].spawn(...)[frame]
            rng = np.random.default_rng(np.random.SeedSequence(_shot.seed, spawn_key=(recording, 1, frame)))
            noisy = rng.standard_normal(picture.shape, dtype=np.float32)
            noisy *= _shot.noise_grey
            noisy += picture
            picture = np.clip(np.rint(noisy, out=noisy), 0, 255, out=noisy).astype(np.uint8)
        pictures.append(picture)
    return np.stack(pictures)
