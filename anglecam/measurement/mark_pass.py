"""The coarse pass over a clip: find the mark in every frame, and the pivot.

The mark's colour, its rough path and the pivot's marker are learnt from evenly spaced frames. One reading then finds
the mark in every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace

import cv2
import numpy as np

from anglecam.camera.lens import Lens, lens_from_rig
from anglecam.data.series import OK
from anglecam.data.typing import Floats, Image
from anglecam.errors import InputError
from anglecam.io.rig import Rig, RigMark
from anglecam.measurement.body_ahead import BodyAhead, TurnsAhead, learn_body_ahead
from anglecam.measurement.camera_pass import HeldCamera
from anglecam.measurement.detections import Detections, frame_of_mark, frames_to_keep
from anglecam.measurement.frame_reading import Sought, read_frames
from anglecam.measurement.parallel_reading import read_in_parts, readers_for
from anglecam.measurement.pivot import HEIGHT_SHARE, find_pivot
from anglecam.measurement.trust import shows_its_centre, travel
from anglecam.measurement.what_is_seen import DECLARE_MARK, causes_seen, where_it_moves
from anglecam.progress import Progress, Stage, counted, unseen
from anglecam.video.film import Film, Frame, Sample
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.mark.found_mark import FoundMark, Samples, region_in_plane
from anglecam.vision.mark.own_rotation import widened_by_own_rotation
from anglecam.vision.mark.search import find_mark
from anglecam.vision.mark.segment import Region
from anglecam.vision.mark.track import MarkTrack, follow_mark
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.pivot.marker import RoundMarker
from anglecam.vision.stabilise.background_motion import CameraMove
from anglecam.vision.stabilise.dominant_shift import CameraMotion

_CLEAR = 2.0
"""Ratio of the best score to the next best from which on the choice of the mark is clear."""


class MarkNotFoundError(InputError):
    """No thing of the clip can be followed as a mark."""


def seek_mark(film: Film, rig: Rig) -> FoundMark:
    """Find the mark in evenly spaced frames of a film whose camera stands.

    Parameters
    ----------
    film : Film
        The clip.
    rig : Rig
        Declares mark, pivot and camera.

    Returns
    -------
    FoundMark
        Its colour and its rough path.

    Raises
    ------
    MarkNotFoundError
        Where there is none.
    InputError
        Where the file cannot be read.
    """
    lens = lens_from_rig(rig, film.size, film.path)
    sample, samples = _sampled(film, rig, None, lens)
    found = _sought(rig, samples, lens, any_colour=True)
    if found is None:
        raise MarkNotFoundError(f"{film.path}: {_no_mark(sample, rig)}")
    return found


def detect_mark(
    film: Film,
    rig: Rig,
    camera: HeldCamera | None = None,
    progress: Progress = unseen,
    mark: FoundMark | None = None,
) -> Detections | str:
    """Find the mark in every frame of a clip, and the pivot.

    Parameters
    ----------
    film : Film
        The clip.
    rig : Rig
        Declares mark, pivot and camera.
    camera : HeldCamera, optional
        How the camera moves; without it the camera is at rest.
    progress : Progress
        Called with each stage, and after each frame.
    mark : FoundMark, optional
        The mark, where it was found before; it is sought by default.

    Returns
    -------
    Detections or str
        At least one frame has the status ``ok``. Or why there is no mark, no frame in which it can be measured, or no
        point about which it turns.

    Raises
    ------
    InputError
        Where the file cannot be read: one line with file and cause.
    """
    path, steady = film.path, None if camera is None else camera.steady
    lens = lens_from_rig(rig, film.size, path)
    progress(Stage("looking for the mark"))
    sample, samples = _sampled(film, rig, steady, lens)
    noise = pixel_noise([f.image for f in sample.frames if f.image is not None])
    with readers_for(film) if steady is None else nullcontext() as readers:
        found = _sought(rig, samples, lens) if mark is None else mark
        if found is None:
            return _no_mark(sample, rig)
        if camera is not None and camera.unknown is not None:
            return camera.unknown
        progress(Stage("learning how the body looks"))
        body = _body_ahead(film, found, samples, rig, lens) if steady is None else None
        sought = Sought(found, body, steady)
        done = counted(progress, "measuring", sample.count)
        reading = read_frames(film, sought, done) if readers is None else read_in_parts(readers, film, sought, done)
    time, filmed, shakes = reading.time, reading.regions, None if steady is None else tuple(reading.moves)
    candidates = filmed if shakes is None else [_unshaken(r, move) for r, move in zip(filmed, shakes, strict=True)]
    lens, track, marker, pivot, disagreement = _follow(candidates, time, found, samples.stabilised, rig, lens)
    hidden = np.zeros(len(time), bool) if shakes is None else np.array([not move.known for move in shakes])
    status = tuple(
        "undecodable" if not d else "occluded" if h else s
        for s, d, h in zip(track.status, reading.decoded, hidden, strict=True)
    )
    if OK not in status:
        return _nothing_measured(status, sample, rig)
    if pivot is None:
        return (
            "no pivot found: the mark's path is too short to determine its centre, and there is no round"
            " marker near it; declare it, also outside the picture: pivot: {at: [x, y], sigma_px: s} in rig.yaml"
        )
    notes = [note for note in (_choice(found, track), disagreement) if note]
    if shakes is not None:
        notes.append(
            f"the camera shakes by {_rms_shift(shakes):.2f} px RMS; this was measured on the background and corrected"
        )
    if found.circle is None:
        notes.append("the mark does not move in this clip")
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
        camera_moves=shakes,
        body=None,
        by="mark",
        clear=found.cue in ("declared", "pointed") or found.margin > _CLEAR,
        noise=noise,
        repeated=reading.repeated,
        colour_rgb=found.model.mean_rgb,
        size=film.size,
        truncated=film.why_truncated(sample),
        notes=tuple(notes),
        turns=None if body is None else TurnsAhead(body, reading.begun, reading.turns),
        found=found,
    )


def _sampled(film: Film, rig: Rig, steady: CameraMotion | None, lens: Lens) -> tuple[Sample, Samples]:
    """Return evenly spaced frames, as read and as the mark is sought in them."""
    sample, pointed = film.sample(frames_to_keep(film)), rig.pointed_mark
    frames = [*([] if pointed is None else [frame_of_mark(film, pointed)]), *sample.frames]
    return sample, _samples(film, frames, pointed, steady, lens)


def _sought(rig: Rig, samples: Samples, lens: Lens, *, any_colour: bool = False) -> FoundMark | None:
    near = None if rig.pivot.expected is None else lens.rectify(rig.pivot.expected)
    return find_mark(samples, rig.mark_rgb, near, any_colour=any_colour) if samples.images else None


def _body_ahead(film: Film, found: FoundMark, samples: Samples, rig: Rig, lens: Lens) -> BodyAhead | None:
    """Learn the body before all frames are read, where nothing but evenly spaced frames is needed for it."""
    simple = found.circle is not None and rig.camera.row_time_s is None and lens.tilt == 0.0
    some = film.thinned() if simple else None
    return None if some is None else learn_body_ahead(some, found, samples.images, rig, lens)


def _samples(
    film: Film, frames: Sequence[Frame], pointed: RigMark | None, steady: CameraMotion | None, lens: Lens
) -> Samples:
    """Return the frames in which the mark is sought: those in which the camera's motion is known."""
    pictures = [(frame.time, frame.image) for frame in frames if frame.image is not None]
    still = CameraMove(np.zeros(2), np.zeros(2), 0.0, np.zeros((3, 3)))
    moves = [still if steady is None else steady.at(image) for _, image in pictures]
    if pointed is not None and not moves[0].known:
        where = f"{film.path}: the camera's motion is unknown in frame {pointed.frame}"
        raise InputError(f"{where}; declare the mark in another frame")
    kept = [(time, image, move) for (time, image), move in zip(pictures, moves, strict=True) if move.known]
    images = [image for _, image, _ in kept]
    return Samples(
        images=images,
        stabilised=images if steady is None else [_stabilised(image, move) for _, image, move in kept],
        time=np.array([time for time, _, _ in kept]),
        to_plane=lambda i, point: lens.rectify(point if steady is None else kept[i][2].to_reference(point)),
        in_plane=lambda i, region: region_in_plane(
            region if steady is None else _unshaken([region], kept[i][2])[0], lens
        ),
        pointed_px=None if pointed is None else np.array(pointed.as_box),
    )


def _follow(
    candidates: Sequence[Sequence[Region]],
    time: Floats,
    found: FoundMark,
    images: Sequence[Image],
    rig: Rig,
    lens: Lens,
) -> tuple[Lens, MarkTrack, RoundMarker | None, PivotEstimate | None, str | None]:
    """Follow the mark in the plane of motion; in a tilted perspective, repeat it with the lens centred on the pivot."""
    for again in (lens.tilt != 0.0 and lens.focal_px is not None, False):
        placed = [[region_in_plane(region, lens) for region in regions] for regions in candidates]
        track = _widened(follow_mark(placed, time, found))
        marker, pivot, disagreement = find_pivot(images, rig, track.circle, lens)
        if not again or pivot is None:
            break
        height = 0.0 if track.circle is None else HEIGHT_SHARE * track.circle.radius_px
        centred = lens.looking_at(lens.distort(pivot.centre_px), height)
        if found.circle is not None:
            place, radius = found.circle
            found = replace(found, circle=(centred.rectify(lens.distort(place)), radius))
        found = replace(found, place_px=centred.rectify(lens.distort(found.place_px)))
        lens = centred
    return lens, track, marker, pivot, disagreement


def _widened(track: MarkTrack) -> MarkTrack:
    """Return a track whose circle is as uncertain as the mark's own rotation says."""
    whole = [r for r, s in zip(track.regions, track.status, strict=True) if s == OK and r is not None]
    return track if track.circle is None else replace(track, circle=widened_by_own_rotation(track.circle, whole))


def _choice(found: FoundMark, track: MarkTrack) -> str | None:
    """Return what was taken for the mark; ``None`` for a clear red one, and for a declared one that is seen to turn."""
    declared = found.cue in ("declared", "pointed")
    if declared and (found.circle is None or shows_its_centre(track.circle)):
        return None
    if found.cue == "red" and found.margin > _CLEAR:
        return None
    places = np.array(
        [r.centre_px for r, s in zip(track.regions, track.status, strict=True) if r is not None and s == OK]
    )
    if declared:
        x, y = np.median(places, axis=0)
        return (
            f"what is taken for the declared mark, around {x:.0f},{y:.0f}, travels {travel(places):.2g} px RMS, too "
            "little to show that it turns about the pivot: is it the mark?"
        )
    where = "" if not len(places) else " around {:.0f},{:.0f}".format(*np.median(places, axis=0))
    rgb = ",".join(map(str, found.model.mean_rgb))
    rival = "" if np.isinf(found.margin) else f"; its score is {found.margin:.1f} times that of the next best"
    point = "" if found.margin > _CLEAR else "; if it is not, declare it: mark: {at: [x, y], frame: k} in rig.yaml"
    return f"the mark is the thing of colour {rgb}{where}, found by how it moves{rival}{point}"


def _unshaken(regions: Sequence[Region], move: CameraMove) -> list[Region]:
    """Return a frame's regions where a camera at rest would show them; none where the camera's motion is not known."""
    return [replace(r, centre_px=move.to_reference(r.centre_px)) for r in regions] if move.known else []


def _stabilised(image: Image, move: CameraMove) -> Image:
    """Return a frame as a camera at rest would show it; used for the median of many frames."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    to_frame = move.to_frame(corners)
    matrix = np.column_stack([to_frame[1] - to_frame[0], to_frame[2] - to_frame[0], to_frame[0]])
    size = (image.shape[1], image.shape[0])
    return np.asarray(cv2.warpAffine(image, matrix, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP))


def _rms_shift(moves: Sequence[CameraMove]) -> float:
    shifts = np.array([move.shift_px for move in moves if move.known])
    return float(np.sqrt(((shifts - shifts.mean(axis=0)) ** 2).mean())) if len(shifts) else 0.0


def _colour(rig: Rig) -> str:
    if rig.pointed_mark is not None:
        return f"of what is declared in frame {rig.pointed_mark.frame}"
    return "auto" if rig.mark_rgb is None else ",".join(map(str, rig.mark_rgb))


def _no_mark(sample: Sample, rig: Rig) -> str:
    if not sample.decoded:
        return f"none of its {sample.count} frames can be decoded"
    hint = "" if rig.pivot.expected is None else ", rotating about {:g},{:g}".format(*rig.pivot.expected)
    seen = f"no mark found in {sample.count} of {sample.count} frames (colour {_colour(rig)}{hint})"
    place = where_it_moves([frame.image for frame in sample.frames if frame.image is not None])
    moves = "nothing is seen to move" if place is None else "something moves around {},{}".format(*place)
    return f"{seen}; {moves}; {DECLARE_MARK}"


def _nothing_measured(status: Sequence[str], sample: Sample, rig: Rig) -> str:
    if set(status) <= {"no_mouth", "undecodable"}:
        return _no_mark(sample, rig)
    return f"none of {len(status)} frames could be measured: {causes_seen(status)}"
