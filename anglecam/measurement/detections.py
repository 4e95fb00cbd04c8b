"""The result of the coarse pass over a clip: the mark in every frame, and the pivot.

Positions are in the plane of motion: the effects of lens, tilt and a shaking camera are corrected for points. The
frames themselves are not transformed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats
from anglecam.engine.learn import Learnt
from anglecam.errors import InputError
from anglecam.io.rig import RigMark
from anglecam.measurement.body_ahead import TurnsAhead
from anglecam.measurement.rigid_motion import RigidMotion
from anglecam.video.film import Film, Frame
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.segment import Region
from anglecam.vision.pivot.circle import Circle
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.pivot.marker import RoundMarker
from anglecam.vision.stabilise.background_motion import CameraMove

_SAMPLE_BYTES = 100_000_000
"""Memory for the frames that the first pass keeps."""
_SAMPLES = 32
"""Frames that the first pass keeps at most."""


@dataclass(frozen=True)
class Detections:
    """The mark in a clip; sequences have an entry a frame."""

    time: Floats
    """Time stamps of the frames, s."""
    status: tuple[str, ...]
    regions: tuple[Region | None, ...]
    """The mark where it was found, in the plane of motion."""
    smeared: NDArray[np.bool_]
    """Frames whose status is ``occluded`` although motion blur may be the cause."""
    pivot: PivotEstimate
    """In the plane of motion."""
    marker: RoundMarker | None
    """The round marker at the pivot, in the picture."""
    circle: Circle | None
    """Fitted to the mark's path in the plane of motion; ``None`` where it does not move."""
    moves: bool
    """Whether the mark or the body moves."""
    lens: Lens
    """From the picture of a camera at rest to the plane of motion."""
    camera_moves: tuple[CameraMove, ...] | None
    """Motion of the camera in each frame; ``None`` where it stands still."""
    body: RigidMotion | None
    """Motion of the rigid body where there is no mark; ``regions`` are empty then."""
    by: str
    """What is followed: ``mark`` or ``body``."""
    clear: bool
    """Whether nothing else in the clip may be the mark."""
    noise: float
    """Standard deviation of the pixels, grey levels."""
    repeated: NDArray[np.bool_]
    """Frames that equal the previous frame bit for bit."""
    colour_rgb: tuple[int, int, int] | None
    """The mark's colour in this clip."""
    size: tuple[int, int]
    """Width and height of the picture, px."""
    truncated: str | None
    """``truncated: 71 of 120 frames could be read`` where the file ends too early."""
    notes: tuple[str, ...]
    """Messages to the user, a line each."""
    turns: TurnsAhead | None = None
    """Rotation of the body, where it was learnt before all frames were read."""
    doubt: str | None = None
    """Why what was followed may be another thing in a part of the frames, or another one than the rig means."""
    learnt: Learnt | None = None
    """What moves in the film, where a body is followed without a mark."""
    found: FoundMark | None = None
    """The mark by a sample of frames; ``None`` where a body is followed without one."""
    scatter: float = 0.0
    """Standard deviation by which the turns differ from frame to frame beyond what the pictures explain, rad."""

    @property
    def places_px(self) -> Floats:
        """(frames, 2) position of the mark in the plane of motion, px; NaN where it is not found."""
        nowhere = np.full(2, np.nan)
        return np.array([nowhere if r is None else r.centre_px for r in self.regions])

    def in_picture(self, places_px: Floats) -> Floats:
        """Return the picture positions, px, of (frames, 2) positions in the plane of motion, one for each frame."""
        filmed = self.lens.distort(places_px)
        if self.camera_moves is None:
            return filmed
        return np.array([move.to_frame(place) for move, place in zip(self.camera_moves, filmed, strict=True)])

    @property
    def rolls(self) -> Floats:
        """(frames,) roll of the camera, rad; NaN where it is unknown."""
        moves = self.camera_moves
        return np.zeros(len(self.time)) if moves is None else np.array([move.roll for move in moves])

    @property
    def turn_sigma(self) -> Floats:
        """(frames,) standard uncertainty of turns that no picture of the body shows, rad: by camera and scatter."""
        moves = self.camera_moves
        roll2 = np.zeros(len(self.time)) if moves is None else [move.covariance[2, 2] for move in moves]
        return np.sqrt(roll2 + np.square(self.scatter))


def frames_to_keep(film: Film) -> int:
    """Return how many frames the first reading keeps."""
    return int(np.clip(_SAMPLE_BYTES // max(3 * film.width * film.height, 1), 8, _SAMPLES))


def frame_of_mark(film: Film, mark: RigMark) -> Frame:
    """Return the frame in which the rig points at the mark.

    Raises
    ------
    InputError
        Where the film does not have that frame, the rig leaves it out, or it cannot be decoded.
    """
    found = next((frame for frame in film.frames() if film.first_frame + frame.index == mark.frame), None)
    if found is None:
        left_out = film.rows.wanted.first is not None or film.rows.wanted.last is not None
        why = "is not among the frames that are measured" if left_out else "the film does not have"
        raise InputError(f"{film.path}: the mark is declared in frame {mark.frame}, which {why}")
    if found.image is None:
        raise InputError(f"{film.path}: the mark is declared in frame {mark.frame}, which cannot be decoded")
    return found


def in_all_frames(ok: NDArray[np.bool_], values: Floats) -> Floats:
    """Arrange values (m, …) of the measured frames in all frames (n, …); NaN elsewhere."""
    placed = np.full((len(ok), *values.shape[1:]), np.nan)
    placed[ok] = values
    return placed
