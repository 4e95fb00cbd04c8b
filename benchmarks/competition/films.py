"""Drawn films, what each tracker of anglecam makes of them, and the truth, as proposals on one sample of frames.

A film is drawn and followed once; sample and proposals are kept, because the trackers take most of the time.
"""

from __future__ import annotations

import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anglecam.data.series import OK
from anglecam.data.typing import Floats
from anglecam.engine.sample import FRAMES, Sample, Stills, sample_of, sample_stills
from anglecam.engine.score import Proposal
from anglecam.errors import AnglecamError
from anglecam.io.rig import Rig
from anglecam.measurement.angles import coarse_angles, turns
from anglecam.measurement.camera_pass import HeldCamera, hold_camera
from anglecam.measurement.detections import Detections
from anglecam.measurement.mark_pass import detect_mark
from anglecam.progress import unseen
from anglecam.video.open_film import open_film
from anglecam.vision.stabilise.background_motion import CameraMove
from benchmarks.drawn.film import Drawn, draw

TRACKERS: dict[str, Callable[[HeldCamera, Rig], Detections | str]] = {
    "mark": lambda camera, rig: detect_mark(camera.film, rig, camera),
}
LONGEST_S = 60.0
"""CPU time after which a tracker is given up."""
TRUE = "true "
"""Begins the name of a proposal that is the truth of a part."""


@dataclass(frozen=True)
class Contest:
    """A sample of one film, and what may explain it."""

    name: str
    faults: str
    sample: Sample
    proposals: tuple[Proposal, ...]

    @property
    def true(self) -> tuple[Proposal, ...]:
        """Those that are the truth of a part."""
        return tuple(one for one in self.proposals if one.name.startswith(TRUE))

    @property
    def found(self) -> tuple[Proposal, ...]:
        """Those of the trackers."""
        return tuple(one for one in self.proposals if not one.name.startswith(TRUE))


def contest(kind: str, seed: int, kept: Path) -> Contest | str:
    """Return a film's sample and proposals; or why there are none.

    Parameters
    ----------
    kind : str
        A key of `benchmarks.drawn.kinds.KINDS`.
    seed : int
        Of the film.
    kept : Path
        Folder in which the result is kept, and looked for first.
    """
    file = kept / f"{kind}-{seed}.npz"
    if not file.exists():
        content = _followed(kind, seed)
        kept.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=kept, suffix=".npz", delete=False) as made:
            np.savez(made, **content)
        Path(made.name).replace(file)
    with np.load(file) as stored:
        if str(stored["why"]):
            return str(stored["why"])
        sample = sample_of(stored["cut"], stored["frames"], float(stored["scale"]), stored["corner_px"])
        each = zip(stored["names"].tolist(), stored["centres_px"], stored["turns"], strict=True)
        return Contest(file.stem, str(stored["faults"]), sample, tuple(Proposal(*one) for one in each))


def _followed(kind: str, seed: int) -> dict[str, Any]:
    """Draw a film, sample it and follow it; return the content of its file."""
    with tempfile.TemporaryDirectory() as folder:
        film = draw(kind, seed, Path(folder))
        common = {"why": "", "faults": " ".join(sorted(film.faults.names))}
        try:
            opened = open_film(film.path)
            opened.learn(unseen)
            camera = hold_camera(opened)
        except AnglecamError as problem:
            return {**common, "why": str(problem).replace(f"{film.path}: ", "")}
        sample = sample_stills(_steadied(camera))
        if sample is None:
            return {**common, "why": "the sample shows no change"}
        numbers = sample.frames
        proposals = [*_by_trackers(camera, numbers), *_truth(film, numbers)]
    return {
        **common,
        "cut": sample.pictures.round().astype(np.uint8),
        "frames": numbers,
        "scale": sample.scale,
        "corner_px": sample.corner_px,
        "names": [one.name for one in proposals],
        "centres_px": np.array([one.centre_px for one in proposals]),
        "turns": np.array([one.turn for one in proposals]),
    }


def _steadied(camera: HeldCamera) -> Stills:
    """Return the sampled frames in which the camera's motion is known, as a camera at rest would see them."""
    frames = [frame for frame in camera.film.sample(FRAMES).frames if frame.image is not None]
    images = [frame.image for frame in frames if frame.image is not None]
    maps: list[Floats | None] = [None] * len(images)
    if camera.steady is not None:
        moves = [camera.steady.at(image) for image in images]
        known = [k for k, move in enumerate(moves) if move.known]
        frames, images = [frames[k] for k in known], [images[k] for k in known]
        maps = [_affine(moves[k]) for k in known]
    return Stills(images, maps, np.array([frame.index for frame in frames]))


def _affine(move: CameraMove) -> Floats:
    origin, x, y = (move.to_frame(np.array(point, float)) for point in ((0, 0), (1, 0), (0, 1)))
    return np.column_stack([x - origin, y - origin, origin])


def _by_trackers(camera: HeldCamera, numbers: Floats) -> Iterator[Proposal]:
    rig = Rig()
    for name, follow in TRACKERS.items():
        try:
            with _at_most(LONGEST_S):
                detections = follow(camera, rig)
        except (AnglecamError, TimeoutError):
            continue
        if isinstance(detections, Detections):
            ok = np.array([status == OK for status in detections.status])
            angles = coarse_angles(detections, ok, detections.time, rig, None)
            turn = np.full(len(ok), np.nan)
            turn[ok] = turns(angles, rig)
            yield Proposal(name, angles.pivot.centre_px, turn[numbers])


def _truth(film: Drawn, numbers: Floats) -> Iterator[Proposal]:
    for part, angle_deg in film.angles_deg.items():
        turn = np.radians(angle_deg[numbers])
        yield Proposal(f"{TRUE}{part}", film.pivot_px, turn - np.median(turn))


@contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    """Raise `TimeoutError` after some CPU time of this process."""

    def late(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
