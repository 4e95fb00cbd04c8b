"""Films that several tests look at: each is drawn once and measured once in a run, by the process that needs it first.

    def test_something(films):
        path, measured = films.film(NOD), films.measured(NOD, rig_of(NOD.look))

A film is named by the hash of what it shows. The files lie in pytest's temporary folder of the run, which the processes
of pytest-xdist share, so that a change of the code is never measured by an old result.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from filelock import FileLock

from anglecam.data.command import Command
from anglecam.io.rig import Rig, RigMark, RigPivot
from anglecam.measurement.clip import Measurement, measure_clip
from anglecam.video.open_film import open_film

from . import things
from .drawn import RATE_HZ, Look, draw_frames, write_clip


class Film(Protocol):
    """What a film shows; its ``repr`` states everything that the film depends on."""

    @property
    def file(self) -> str:
        """Name of the file."""

    def write(self, path: Path) -> None:
        """Draw the film."""


@dataclass(frozen=True)
class Head:
    """The drawn head of `support.drawn`, turned by an angle in each frame."""

    look: Look
    angles_deg: tuple[float, ...]
    seed: int = 0
    file: str = "clip.avi"

    @property
    def angle(self) -> np.ndarray:
        """Return the true angles, degrees."""
        return np.array(self.angles_deg)

    def write(self, path: Path) -> None:
        """Draw the film."""
        write_clip(path, draw_frames(self.look, self.angle, seed=self.seed))


@dataclass(frozen=True)
class Thing:
    """One of `support.things` with its arguments, turned by an angle in each frame."""

    kind: str
    """ball | stick | wheel."""
    arguments: tuple[Any, ...]
    angles_deg: tuple[float, ...]
    file: str = "thing.avi"

    def write(self, path: Path) -> None:
        """Draw the film."""
        things.film(path, getattr(things, self.kind)(*self.arguments), np.array(self.angles_deg))


def nod(frames: int = 66) -> np.ndarray:
    """Return a swing of ±12° after half a second at rest, degrees."""
    time = np.arange(frames) / RATE_HZ
    return 12.0 * np.sin(2 * np.pi * 0.8 * (time - 0.5)) * (time > 0.5)


def fading(frames: int) -> np.ndarray:
    """Return a swing of ±14° that becomes slowly smaller, degrees."""
    time = np.arange(frames) / RATE_HZ
    return 14.0 * np.sin(2 * np.pi * 0.7 * time) * np.cos(0.4 * time)


NOD = Head(Look(), tuple(nod()), seed=11)
"""The usual head; the rest ends at `REST`'s first change."""
FADING = Head(Look(), tuple(fading(96)), seed=3)
SWING = Head(Look(), tuple(8.0 * np.sin(2.0 * np.pi * np.arange(45) / RATE_HZ)), file="swing.avi")
REST = Command(np.array([0.0, 0.51]), np.array([0.0, 0.1]))


def rig_of(look: Look, **more: Any) -> Rig:
    """Return a rig that declares the mark's colour and a hint for the pivot.

    With the colour a film is measured in half of the time. Whether a mark is found without it is asserted by tests of
    their own (`tests/measurement/test_clip.py`, ``SESSIONS``).
    """
    x, y = look.pivot
    declared = {
        "facing": look.facing,
        "mouth": RigMark(rgb=look.lips_rgb),
        "pivot": RigPivot(near=(x + 8, y - 7)),
    }
    return Rig(**declared | more)


class Films:
    """The films of a run and what was measured in them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kept: dict[Path, Measurement] = {}

    def film(self, film: Film) -> Path:
        """Return the path of a film; draw it if no process has."""
        path = self._folder / _hash(repr(film)) / film.file
        self._once(path, film.write)
        return path

    def measured(self, film: Film, rig: Rig | None = None, command: Command | None = None) -> Measurement:
        """Return what `measure_clip` gives for a film; measure it if no process has."""
        rig, path = rig or Rig(), self.film(film)
        changes = None if command is None else (command.time.tolist(), command.angle.tolist())
        result = path.with_name(f"{_hash(repr((rig, changes)))}.pickle")
        if result not in self._kept:
            self._once(result, lambda unfinished: _measure(path, rig, command, unfinished))
            self._kept[result] = pickle.loads(result.read_bytes())
        return self._kept[result]

    @staticmethod
    def _once(path: Path, write: Callable[[Path], object]) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with FileLock(f"{path}.lock"):
            if not path.exists():
                unfinished = path.with_name(f"unfinished-{path.name}")
                write(unfinished)
                unfinished.replace(path)


def _measure(film: Path, rig: Rig, command: Command | None, result: Path) -> None:
    result.write_bytes(pickle.dumps(measure_clip(open_film(film), rig, command)))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]
