"""The coarse pass over a clip: the mouth in every frame, and the pivot that it turns about.

The first reading keeps a few frames, from which the mouth's colour, its rough path and the pivot's marker are learnt;
the second finds the mouth in every frame. Where there is no mouth to see, a head that turns as one rigid body will do.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.camera.lens import Lens, lens_from_rig
from anglecam.data.series import OK
from anglecam.data.typing import Floats, Image
from anglecam.errors import InputError
from anglecam.io.rig import Rig
from anglecam.measurement.detections import Detections, find_pivot, frames_to_keep, why_truncated
from anglecam.measurement.rigid_body_pass import detect_rigid_body
from anglecam.video.frames import Sample, inspect_clip, read_frames, sample_frames
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.mark.search import Found, find_mark
from anglecam.vision.mark.segment import Region, find_regions
from anglecam.vision.mark.track import Track, follow_mark
from anglecam.vision.pivot.marker import Marker, Pivot
from anglecam.vision.stabilise.background_motion import LOST, CameraMove, BackgroundMotion
from anglecam.vision.stabilise.learn import learn_background

_SMALLEST_SHARE = 0.25
"""Of the mouth's area; a smaller region is no mouth even if partly hidden."""


def detect_mark(path: Path, rig: Rig, progress: Callable[[int, int], None] | None = None) -> Detections:
    """Find the mouth in every frame of a clip, and the pivot.

    Parameters
    ----------
    path : Path
        The clip.
    rig : Rig
        What is declared about mouth, pivot and camera.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.

    Returns
    -------
    Detections
        At least one frame of it with status ``ok``.

    Raises
    ------
    InputError
        Where the file cannot be read, or no frame of it can be measured: one line with file, count and cause.
    """
    info = inspect_clip(path)
    lens = lens_from_rig(rig, (info.width, info.height), path)
    sample = sample_frames(path, frames_to_keep(info))
    images = [f.image for f in sample.frames if f.image is not None]
    noise = pixel_noise(images)
    steady = learn_background(images)
    moves = [] if steady is None else [steady.at(image) for image in images]
    near = None if rig.pivot.near is None else lens.rectify(rig.pivot.near)

    def placed(i: int, point: Floats) -> Floats:
        return lens.rectify(moves[i].to_reference(point) if moves else point)

    found = find_mark(images, rig.mark_rgb, near, placed) if images else None
    if found is None:
        head = detect_rigid_body(path, rig) if rig.mark_rgb is None and images else None
        if isinstance(head, Detections):
            return head
        besides = "" if head is None else f"; nor can the head be followed without one: {head}"
        raise InputError(_no_mouth(path, sample, rig) + besides)
    time, filmed, decoded, repeated, shakes = _read_regions(path, found, sample.count, steady, progress)
    candidates = filmed if shakes is None else [_unshaken(r, move) for r, move in zip(filmed, shakes, strict=True)]
    images = [_levelled(image, move) for image, move in zip(images, moves, strict=True)] if moves else images
    lens, track, marker, pivot, disagreement = _follow(candidates, time, found, images, rig, lens)
    hidden = np.zeros(len(time), bool) if shakes is None else np.array([not move.known for move in shakes])
    status = tuple(
        "undecodable" if not d else "occluded" if h else s
        for s, d, h in zip(track.status, decoded, hidden, strict=True)
    )
    if OK not in status:
        raise InputError(_nothing_measured(path, status, sample, rig))
    if pivot is None:
        raise InputError(
            f"{path}: no pivot found: the mouth's way is too short to tell, and no round marker is to be seen near its"
            " centre; say where it is: pivot: {near: [x, y]} in rig.yaml"
        )
    notes = [disagreement] if disagreement else []
    if shakes is not None:
        notes.append(
            f"the camera shakes by {_restlessness(shakes):.2f} px RMS; the scenery tells how, and it is undone"
        )
    if found.circle is None:
        notes.append("the mouth does not move in this clip")
    return Detections(
        time=time,
        status=status,
        regions=track.regions,
        smeared=track.smeared & ~hidden,
        pivot=pivot,
        marker=marker,
        circle=track.circle,
        moves=found.circle is not None,
        lens=lens,
        shakes=shakes,
        head=None,
        noise=noise,
        repeated=repeated,
        colour_rgb=found.model.mean_rgb,
        size=(info.width, info.height),
        truncated=why_truncated(info, sample),
        notes=tuple(notes),
    )


def _follow(
    candidates: Sequence[Sequence[Region]], time: Floats, found: Found, images: Sequence[Image], rig: Rig, lens: Lens
) -> tuple[Lens, Track, Marker | None, Pivot | None, str | None]:
    """Follow the mouth in the plane of motion; where the view is a tilted perspective, once more about its pivot."""
    for again in (lens.tilt != 0.0 and lens.focal_px is not None, False):
        placed = [[_in_plane(region, lens) for region in regions] for regions in candidates]
        track = follow_mark(placed, time, found)
        marker, pivot, disagreement = find_pivot(images, rig, track.circle, lens)
        if not again or pivot is None:
            break
        centred = lens.looking_at(lens.distort(pivot.centre_px))
        if found.circle is not None:
            place, radius = found.circle
            found = replace(found, circle=(centred.rectify(lens.distort(place)), radius))
        found = replace(found, place_px=centred.rectify(lens.distort(found.place_px)))
        lens = centred
    return lens, track, marker, pivot, disagreement


def _unshaken(regions: Sequence[Region], move: CameraMove) -> list[Region]:
    """Bring a frame's regions to where a camera at rest would show them; none where that is not known."""
    return [replace(r, centre_px=move.to_reference(r.centre_px)) for r in regions] if move.known else []


def _levelled(image: Image, move: CameraMove) -> Image:
    """Bring a frame to where a camera at rest would show it, for what is sought in the middle of many frames."""
    if not move.known:
        return image
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    to_frame = move.to_frame(corners)
    matrix = np.column_stack([to_frame[1] - to_frame[0], to_frame[2] - to_frame[0], to_frame[0]])
    size = (image.shape[1], image.shape[0])
    return np.asarray(cv2.warpAffine(image, matrix, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP))


def _restlessness(moves: Sequence[CameraMove]) -> float:
    shifts = np.array([move.shift_px for move in moves if move.known])
    return float(np.sqrt(((shifts - shifts.mean(axis=0)) ** 2).mean())) if len(shifts) else 0.0


def _in_plane(region: Region, lens: Lens) -> Region:
    if lens.is_identity:
        return region
    J = lens.jacobian(region.centre_px)
    return replace(
        region,
        centre_px=lens.rectify(region.centre_px),
        area_px2=region.area_px2 * float(np.linalg.det(J)),
        moments_px2=J @ region.moments_px2 @ J.T,
        noise_px2=J @ region.noise_px2 @ J.T,
    )


def _read_regions(
    path: Path, found: Found, count: int, steady: BackgroundMotion | None, progress: Callable[[int, int], None] | None
) -> tuple[Floats, list[list[Region]], list[bool], NDArray[np.bool_], tuple[CameraMove, ...] | None]:
    """Find the regions of the mouth's colour in every frame, and how the camera moved if it did.

    Tell too which frames repeat the one before bit by bit.
    """
    time: list[float] = []
    candidates: list[list[Region]] = []
    decoded: list[bool] = []
    repeated: list[bool] = []
    moves: list[CameraMove] = []
    before = None
    for frame in read_frames(path):
        image = frame.image
        if steady is not None:
            moves.append(LOST if image is None else steady.at(image, frame.predicted))
        time.append(frame.time)
        decoded.append(image is not None)
        repeated.append(image is not None and before is not None and np.array_equal(image, before))
        regions = [] if image is None else find_regions(image, found.model, _SMALLEST_SHARE * found.area_px2)
        candidates.append(regions)
        before = image
        if progress is not None:
            progress(frame.index + 1, count)
    return np.array(time), candidates, decoded, np.array(repeated), tuple(moves) if steady is not None else None


def _colour(rig: Rig) -> str:
    return "auto" if rig.mark_rgb is None else ",".join(map(str, rig.mark_rgb))


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
