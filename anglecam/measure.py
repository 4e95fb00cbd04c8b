"""From a clip to the angle in every frame: coarse by the mouth's place, fine by the whole head.

The first reading of a clip keeps a few frames, from which the mouth's colour, its rough path and the pivot's marker
are learnt; the second finds the mouth in every frame. Where more of the head than the mouth is rigid and has edges,
`anglecam.registration` reads on and finds the turn from all of it; the more certain of the two is taken.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anglecam.angles import Angles, coarse_angles, fine_angles, turns
from anglecam.budget import worst_case
from anglecam.errors import InputError
from anglecam.registration import Registered, register_clip
from anglecam.rig import Rig
from anglecam.series import CONTRACT_RADII_PX, OK, AngleSeries
from anglecam.session import Command, recording_name
from anglecam.video.frames import Image, Sample, inspect_clip, read_frames, sample_frames
from anglecam.vision.circle import Circle
from anglecam.vision.pivot import Marker, Pivot, choose_pivot, find_marker
from anglecam.vision.search import Found, find_mouth
from anglecam.vision.segment import Region, find_regions
from anglecam.vision.track import follow_mouth

Floats = NDArray[np.float64]

_SAMPLE_BYTES = 100_000_000
"""Memory for the frames of the first pass."""
_SAMPLES = 32
_STILL = 9
"""Frames whose median shows what does not move."""
_SMALLEST_SHARE = 0.25
"""Of the mouth's area; a smaller region is no mouth even if partly hidden."""
_HINT_PX = 10.0
"""Standard uncertainty of a hint at the pivot."""
_REACH_PX = (3.0, 40.0)
"""Limits of the standard uncertainty of the centre of rotation when a marker is looked for about it."""
_MOVING = 5.0
"""Standard uncertainties by which the angle must change on both sides of a repeated frame for it to be one."""


@dataclass(frozen=True)
class Measurement:
    """What was measured in a clip, and how."""

    series: AngleSeries
    pivot: Pivot
    """Where the mechanism turns, how certain, and from what."""
    marker: Marker | None
    """The round mark at the pivot, where there is one."""
    circle: Circle | None
    """Fitted to the mouth's path, where it moved."""
    neutral: float
    """Direction of the line that counts as zero, rad."""
    angles: Angles
    """The measured frames, and what their uncertainties are made of."""
    why_coarse: str | None
    """Why the angles are the mouth's own; ``None`` where they are the whole head's."""
    colour_rgb: tuple[int, int, int]
    """The mouth's colour in this clip."""
    frames: int
    """Rows of the series."""
    truncated: str | None
    """``truncated: 71 of 120 frames could be read`` where the file ends too early; the rest is measured."""
    notes: tuple[str, ...]
    """What the user should know, a line each."""
    contours_px: tuple[NDArray[np.int32] | None, ...]
    """Each frame's (k, 2) outline of the mouth, where one was found."""


def measure_clip(
    path: Path, rig: Rig, command: Command | None = None, *, progress: Callable[[int, int], None] | None = None
) -> Measurement:
    """Measure the nodding angle in every frame of a clip.

    Parameters
    ----------
    path : Path
        The clip.
    rig : Rig
        What is declared about mouth, pivot, direction and neutral.
    command : Command, optional
        What was commanded; its first change ends the rest that defines neutral.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.

    Returns
    -------
    Measurement
        The series has a row for every frame of the file, measured or not.

    Raises
    ------
    InputError
        Where the file cannot be read, or no frame of it can be measured: one line with file, count and cause.
    """
    info = inspect_clip(path)
    most = int(np.clip(_SAMPLE_BYTES // max(3 * info.width * info.height, 1), 8, _SAMPLES))
    sample = sample_frames(path, most)
    images = [f.image for f in sample.frames if f.image is not None]
    found = find_mouth(images, rig.mouth_rgb, rig.pivot.near) if images else None
    if found is None:
        raise InputError(_no_mouth(path, sample, rig))
    time, candidates, decoded, repeated = _read_regions(path, found, sample.count, progress)
    track = follow_mouth(candidates, time, found)
    status = [s if d else "undecodable" for s, d in zip(track.status, decoded, strict=True)]
    if OK not in status:
        raise InputError(_nothing_measured(path, status, sample, rig))
    marker = _find_pivot_marker(images, rig, track.circle)
    pivot, disagreement = choose_pivot(marker, track.circle)
    if pivot is None:
        raise InputError(f"{path}: no pivot found: the mouth does not move and there is no round marker to see")
    ok = np.array([s == OK for s in status])
    regions = [r for r, s in zip(track.regions, ok, strict=True) if s and r is not None]
    noise = _pixel_noise(images)
    angles = coarse_angles(regions, time[ok], pivot, track.circle, rig, command, noise)
    why_coarse: str | None = "the mouth does not move"
    if found.circle is not None:
        rows = np.flatnonzero(ok)
        turn, sigma = np.full(len(time), np.nan), np.full(len(time), np.nan)
        turn[rows], sigma[rows] = turns(angles, rig), angles.sigma
        registered = register_clip(path, turn, sigma, pivot, noise, info.coarse_colour, progress)
        why_coarse = registered if isinstance(registered, str) else None
        if isinstance(registered, Registered):
            angles = fine_angles(angles, registered, rows, time[ok], rig, command)
    series = _series(path, rig, time, status, ok, angles, repeated)
    notes = [disagreement] if disagreement else []
    if found.circle is None:
        notes.append("the mouth does not move in this clip")
    truncated = None
    if info.cut_short and not 0 < info.declared_frames <= sample.decoded:
        of = f" of {info.declared_frames}" if info.declared_frames else ""
        truncated = f"truncated: {sample.decoded}{of} frames could be read"
    return Measurement(
        series=series,
        pivot=angles.pivot,
        marker=marker,
        circle=track.circle,
        neutral=angles.neutral,
        angles=angles,
        why_coarse=why_coarse,
        colour_rgb=found.model.mean_rgb,
        frames=len(time),
        truncated=truncated,
        notes=tuple(notes),
        contours_px=tuple(None if r is None else r.contour_px for r in track.regions),
    )


def _read_regions(
    path: Path, found: Found, count: int, progress: Callable[[int, int], None] | None
) -> tuple[Floats, list[list[Region]], list[bool], NDArray[np.bool_]]:
    """Find the regions of the mouth's colour in every frame; tell which frames repeat the one before bit by bit."""
    time: list[float] = []
    candidates: list[list[Region]] = []
    decoded: list[bool] = []
    repeated: list[bool] = []
    before = None
    for frame in read_frames(path):
        image = frame.image
        time.append(frame.time)
        decoded.append(image is not None)
        repeated.append(image is not None and before is not None and np.array_equal(image, before))
        regions = [] if image is None else find_regions(image, found.model, _SMALLEST_SHARE * found.area_px2)
        candidates.append(regions)
        before = image
        if progress is not None:
            progress(frame.index + 1, count)
    return np.array(time), candidates, decoded, np.array(repeated)


def _find_pivot_marker(images: Sequence[Image], rig: Rig, circle: Circle | None) -> Marker | None:
    if rig.pivot.marker == "none":
        return None
    few = images[:: max(1, len(images) // _STILL)]
    still = np.median(np.stack(few), axis=0).astype(np.uint8)
    if rig.pivot.near is not None:
        return find_marker(still, np.array(rig.pivot.near), _HINT_PX)
    if circle is None:
        return find_marker(still, None, 0.0)
    sigma = float(np.sqrt(np.linalg.eigvalsh(circle.centre_covariance_px2)[-1]))
    return find_marker(still, circle.centre_px, float(np.clip(sigma, *_REACH_PX)))


def _series(
    path: Path,
    rig: Rig,
    time: Floats,
    status: list[str],
    ok: NDArray[np.bool_],
    angles: Angles,
    repeated: NDArray[np.bool_],
) -> AngleSeries:
    """Lay the measured frames among all the clip's frames, less the duplicates."""
    empty = np.full(len(time), np.nan)
    lines, sigmas, levers = empty.copy(), empty.copy(), empty.copy()
    mouths = np.full((len(time), 2), np.nan)
    lines[ok], sigmas[ok], levers[ok], mouths[ok] = angles.line, angles.sigma, angles.lever_px, angles.mouth_px
    for i in _duplicates(lines, sigmas, repeated):
        status[i] = "duplicate"
        lines[i] = sigmas[i] = levers[i] = np.nan
        mouths[i] = np.nan
    return AngleSeries(
        name=recording_name(path),
        time=time,
        angle=lines - angles.neutral,
        sigma=sigmas,
        status=tuple(status),
        line=lines,
        mouth_px=mouths,
        pivot_px=np.where(np.isfinite(lines)[:, None], angles.pivot.centre_px, np.nan),
        bounds={r: worst_case(r, levers) for r in {*CONTRACT_RADII_PX, *rig.pixel_error_px}},
    )


def _duplicates(line: Floats, sigma: Floats, repeated: NDArray[np.bool_]) -> list[int]:
    """List the frames that repeat the one before while the mechanism moves before and after them."""
    rows: list[int] = []
    starts = np.flatnonzero(repeated & ~np.insert(repeated[:-1], 0, False))
    for i in starts:
        j = int(i)
        while j + 1 < len(repeated) and repeated[j + 1]:
            j += 1
        if i < 2 or j + 1 >= len(line):
            continue
        steps = np.array([line[i - 1] - line[i - 2], line[j + 1] - line[j]])
        if (np.abs(steps) > _MOVING * sigma[i - 1]).all():
            rows.extend(range(int(i), j + 1))
    return rows


def _pixel_noise(images: Sequence[Image]) -> float:
    """Estimate the pixels' standard deviation, grey levels, from what differs between frames where nothing moves."""
    if len(images) < 2:
        return 1.0
    pairs = [a[::4, ::4].astype(float) - b[::4, ::4] for a, b in itertools.pairwise(images)]
    quantised = 1.0 / np.sqrt(12.0)
    return max(quantised, 1.4826 * float(np.median(np.abs(pairs))) / np.sqrt(2.0))


def _colour(rig: Rig) -> str:
    return "auto" if rig.mouth_rgb is None else ",".join(map(str, rig.mouth_rgb))


def _no_mouth(path: Path, sample: Sample, rig: Rig) -> str:
    if not sample.decoded:
        return f"{path}: none of its {sample.count} frames can be decoded"
    hint = "" if rig.pivot.near is None else ", turning about the hint at {:g},{:g}".format(*rig.pivot.near)
    return (
        f"{path}: no mouth found in {sample.count} of {sample.count} frames (colour {_colour(rig)}{hint});"
        " is it in the picture?"
    )


def _nothing_measured(path: Path, status: Sequence[str], sample: Sample, rig: Rig) -> str:
    if set(status) <= {"no_mouth", "undecodable"}:
        return _no_mouth(path, sample, rig)
    causes = ", ".join(f"{cause} in {k}" for cause, k in Counter(status).most_common())
    return f"{path}: none of {len(status)} frames could be measured: {causes}"
