"""Check a clip before a day of filming: read a few seconds, measure them, and predict."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from anglecam.check.advice import advice, contrast_of
from anglecam.check.blur import exposure_from_blur
from anglecam.check.prediction import Prediction
from anglecam.check.sigma_terms import sigma_terms, whole_film
from anglecam.check.smallest import (
    RECORDINGS,
    Played,
    Sizes,
    best_command,
    duration_of,
    fit_plant,
    planned,
    smallest_sizes,
)
from anglecam.data.command import Command
from anglecam.data.record import record_from_series
from anglecam.errors import InputError, blame
from anglecam.identification.identify_records import declared_start
from anglecam.identification.noise import noise_floor
from anglecam.io.rig import Rig, RigFrames
from anglecam.io.session import command_beside, rig_beside
from anglecam.measurement.clip import Measurement
from anglecam.progress import Progress, Stage, unseen
from anglecam.video.film import Film
from anglecam.video.open_film import open_film
from anglecam.workflow.clip import measure_source, open_recording

SECONDS = 4.0
"""Length of the part that is read, s."""
FEWEST, MOST = 60, 240
"""Frames of that part."""
PEEK = 8
"""Frames that show the rate."""


def check_clip(
    path: Path,
    rig: Rig | None = None,
    command: Command | None = None,
    first: int | None = None,
    *,
    progress: Progress = unseen,
) -> Prediction:
    """Predict how well a clip can be measured, and what a session of recordings like it would show.

    Parameters
    ----------
    path : Path
        A film.
    rig : Rig, optional
        In place of the ``rig.yaml`` in the folder of ``path``.
    command : Command, optional
        What shall be played in the session; otherwise the clip's command, or its natural motion.
    first : int, optional
        Number of the first frame that is read.
    progress : Progress
        Called with each stage, and after each frame.

    Returns
    -------
    Prediction
        From at most `MOST` frames.

    Raises
    ------
    InputError
        Where the clip cannot be read or measured: one line with the cause, and what would mend it.
    RigError
        Where the rig file is wrong.
    """
    with blame(path):
        declared = rig_beside(path) if rig is None else rig
        progress(Stage("reading the first pictures"))
        part, film, frames = _part_of(path, declared, first)
        filmed_with = command_beside(path, declared)
        measured = measure_source(open_recording(path, part, filmed_with), progress=progress)
        assert isinstance(measured, Measurement)  # a film is no file of tracks
        if measured.unsure:
            raise InputError(f"{path}: {measured.unsure}")
        progress(Stage("predicting what a session would show"))
        return _predict(measured, part, film, frames, filmed_with, command)


def _part_of(path: Path, rig: Rig, first: int | None) -> tuple[Rig, Film, int]:
    """Return a rig that restricts the film to the part that is read, the film, and its frames as far as known."""
    begin = rig.frames.first or 0 if first is None else first
    rate = rig.frames.rate_hz
    peek = open_film(path, _range(begin, begin + PEEK, rate))
    steps = np.diff(peek.times)
    interval = float(np.median(steps)) if len(steps) else 1.0 / 30.0
    count = int(np.clip(math.ceil(SECONDS / interval), FEWEST, MOST))
    last = begin + count - 1 if rig.frames.last is None else min(begin + count - 1, rig.frames.last)
    end = peek.declared_frames if rig.frames.last is None else rig.frames.last + 1
    return rig.model_copy(update={"frames": _range(begin, max(last, begin), rate)}), peek, max(end - begin, 0)


def _range(first: int, last: int, rate_hz: float | None) -> RigFrames:
    return RigFrames.model_validate({"from": first, "to": last, "rate_hz": rate_hz})


def _predict(
    measured: Measurement, rig: Rig, film: Film, frames: int, filmed_with: Command | None, command: Command | None
) -> Prediction:
    """Return the prediction from a measured part."""
    series, ok = measured.series, measured.series.ok
    part = sigma_terms(measured, rig)
    interval = float(np.median(np.diff(series.time)))
    count = max(frames, len(series.time))
    whole = whole_film(part, measured, count, filmed_with is not None)
    blurred = None if rig.camera.exposure_s is not None else exposure_from_blur(measured)
    exposure = rig.camera.exposure_s if blurred is None else blurred[0]
    sizes, why, played = None, None, None
    try:
        sizes, played = _sizes(measured, rig, filmed_with, command, whole.scatter, whole.sigma, count * interval)
    except InputError as problem:
        why = str(problem)
    return Prediction(
        name=series.name,
        frames_read=len(series.time),
        frames_measured=int(ok.sum()),
        seconds_read=float(series.time[-1] - series.time[0]),
        rate_hz=1.0 / interval,
        mark=measured.by,
        pivot=measured.pivot,
        lever_px=float(np.median(measured.angles.lever_px)),
        noise_grey=measured.detections.noise,
        contrast_grey=contrast_of(measured),
        exposure_s=blurred,
        part=part,
        whole=whole,
        lowest=float(series.sigma[ok].min()),
        highest=float(series.sigma[ok].max()),
        sizes=sizes,
        why_no_sizes=why,
        played=played,
        advice=tuple(advice(whole, measured, film.codec, exposure, _session_frames(sizes, count, interval))),
        notes=measured.notes,
    )


def _session_frames(sizes: Sizes | None, count: int, interval: float) -> int:
    """Return the frames of a session; without a planned one, of as many recordings as long as the clip."""
    return RECORDINGS * (count if sizes is None else max(1, round(sizes.duration / interval)))


def _sizes(
    measured: Measurement,
    rig: Rig,
    filmed_with: Command | None,
    command: Command | None,
    scatter: float,
    sigma: float,
    clip_s: float,
) -> tuple[Sizes, Played | None]:
    """Return the smallest sizes in a session, and the command that would show more."""
    record = record_from_series(measured.series, filmed_with, zero_known=rig.neutral != "auto")
    parameters, first, doubt = fit_plant(record, declared_start(rig))
    play = record.command if command is None else command
    if play is not None and record.command is None:  # the film shows no gain: a servo that reaches its command
        parameters = np.append(parameters, parameters[1])
    if not parameters[1] > 0.0:
        raise InputError(f"{record.name}: the part that was read shows no stiffness (b ≤ 0); check a longer swing")
    duration = duration_of(play, clip_s)
    plan = planned(record, play, parameters, first, duration)
    if not np.all(np.isfinite(plan.angle)):
        raise InputError(f"{record.name}: the plant that the part shows is unstable; check frames of a free swing")
    floor = noise_floor([record])
    camera = sigma if floor is None else min(sigma, floor.sigma)
    motion = "a free swing as in the clip" if play is None else "the command"
    smallest = smallest_sizes(plan, parameters, scatter, camera)
    sizes = Sizes(smallest, RECORDINGS, duration, parameters, motion, doubt)
    return sizes, best_command(plan, parameters, scatter)
