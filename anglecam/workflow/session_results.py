"""Identify or close one session and write the results to a folder."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from anglecam.data.record import Record
from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.errors import InputError
from anglecam.identification.clocks import Clocks
from anglecam.identification.export import fitted_model, transfer_as_dict, write_mat
from anglecam.identification.fit import Fit
from anglecam.identification.identified import Identified
from anglecam.identification.identify_records import identify_records
from anglecam.io.files import write_json
from anglecam.io.rig import Rig
from anglecam.io.series_csv import write_series
from anglecam.io.session import CORRECTED, SERIES_ENDING, Session, clip_beside
from anglecam.loop.camera_correction import correct_camera_effects
from anglecam.loop.close import with_free_form
from anglecam.loop.cross_validation import split_records
from anglecam.loop.next_experiment.design import Experiment
from anglecam.loop.refit import plant_of
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import NEXT_COMMAND, next_experiment, verdict_as_dict, write_next_command
from anglecam.neck.large_angle import LargeAngleNeck
from anglecam.progress import Progress, Stage, unseen
from anglecam.report.origin import Run, origin_of
from anglecam.report.page import write_report
from anglecam.terminal import make_folder
from anglecam.video.film import Film
from anglecam.video.open_film import open_film
from anglecam.workflow.clip import inputs_of
from anglecam.workflow.clock import session_clocks
from anglecam.workflow.session import LoopInput, MeasuredSession, close_session, identify_session
from anglecam.workflow.side_products import attempt

REPORT = "report.html"


@dataclass(frozen=True)
class Closed:
    """The results of closing the loop."""

    models: tuple[Identified, ...]
    """From the paper's filter and from output error, as far as they could be fitted."""
    verdict: Verdict
    experiment: Experiment | None
    """The recommended next recording; ``None`` where no further recording would separate the models."""
    missing: tuple[str, ...]
    """A line for each part beside the verdict that failed, with its cause."""


def write_identified(
    measured: MeasuredSession, out: Path, estimator: str = "oe2", neck: LargeAngleNeck | None = None
) -> Identified:
    """Fit a model to a session and write it as ``model.json`` and ``model.mat``.

    Parameters
    ----------
    measured, estimator, neck
        As of `anglecam.workflow.session.identify_session`, which also states what it raises.
    out : Path
        Folder for the files.

    Returns
    -------
    Identified
        The model.
    """
    model = identify_session(measured, estimator, neck=neck)
    model = replace(model, clock=attempt("the clocks", lambda: session_clocks(measured, model.fitted), []))
    _write_model(model, out, "model")
    return model


def write_closed(
    measured: MeasuredSession,
    shown: LoopInput,
    out: Path,
    *,
    hold_out: Sequence[str] = (),
    progress: Progress = unseen,
    run: Run | None = None,
) -> Closed:
    """Close the loop; write the models, ``loop.json``, ``report.html`` and the command of the next experiment.

    Parameters
    ----------
    measured, hold_out, progress
        As of `anglecam.workflow.session.close_session`, which also states what it raises.
    shown : LoopInput
        From `anglecam.workflow.session.loop_input`.
    out : Path
        Folder for the files.
    run : Run, optional
        How the command was called, for the report.

    Returns
    -------
    Closed
        Models, verdict and next experiment.
    """
    session = measured.session
    measured.split(hold_out)
    fitted, held_out = split_records(shown.records, [*session.rig.held_out, *hold_out])
    verdict = close_session(measured, hold_out=hold_out, shown=shown, progress=progress)
    missing: list[str] = []
    progress(Stage("looking for a torque of free form"))
    verdict = attempt("free form", partial(with_free_form, verdict), missing) or verdict
    progress(Stage("fitting the clocks"))
    models = []
    effects = _fitted_effects(verdict.after)
    clock = attempt("the clocks", lambda: session_clocks(measured, fitted, effects), missing)
    estimators = (("extended Kalman filter", "ekf", "ekf", None), ("output error", "oe2", "model", clock))
    for title, estimator, name, clocks in estimators:
        progress(Stage(f"fitting the model by {title}"))
        model = attempt(
            f"{name}.json", partial(_identify, fitted, held_out, session.rig, estimator, out, name, clocks), missing
        )
        models += [] if model is None else [model]
    progress(Stage("designing the next experiment"))
    experiment = attempt("the next experiment", lambda: next_experiment(verdict), missing)
    attempt(NEXT_COMMAND, lambda: write_next_command(experiment, out), missing)
    attempt(CORRECTED, lambda: _write_corrected(shown, verdict, out / CORRECTED, missing), missing)
    progress(Stage("working out the smallest effects that would be seen"))
    result = verdict_as_dict(verdict, experiment)
    title, page = session.directory.resolve().name, out / REPORT
    problems = [*map(str, measured.problems), *missing]
    page.unlink(missing_ok=True)  # an older report would contradict the verdict

    def report() -> None:
        uncorrected = _with_uncorrected(measured.series, shown) if shown.differs else None
        films, made = _films(session), origin_of(_inputs(session, run), run)
        write_report(
            page, title, verdict, result, experiment, measured.series, models, problems,
            shown=uncorrected, films=films, made=made,
        )  # fmt: skip

    progress(Stage("writing the report"))
    attempt(REPORT, report, missing)
    write_json(out / "loop.json", result | {"missing": missing})
    return Closed(tuple(models), verdict, experiment, tuple(missing))


def _with_uncorrected(measured: Sequence[AngleSeries], shown: LoopInput) -> list[AngleSeries]:
    """Return the measured series, with the angles that the loop starts from where it uses them."""
    used = {series.name: series for series in shown.series}
    return [used.get(series.name, series) for series in measured]


def _films(session: Session) -> dict[str, Film]:
    """Open the films of a session's recordings for the pictures of the report; without one there are none."""
    films = {}
    for recording in session.recordings:
        clip = recording.source if recording.is_clip else clip_beside(recording.source)
        if recording.is_series or clip is None:
            continue
        with contextlib.suppress(InputError):  # a batch does not fetch films again that it has measured
            films[recording.name] = open_film(clip, session.rig.frames)
    return films


def _inputs(session: Session, run: Run | None) -> list[Path]:
    """Return the files that the results of a session depend on."""
    found = [inputs_of(recording.source, session.rig, run) for recording in session.recordings]
    return sorted({path for files in found for path in files})


def _fitted_effects(fit: Fit) -> list[tuple[Effect, Floats]]:
    """Return the effects of a fitted plant with their fitted parameters."""
    plant = plant_of(fit)
    edges = plant.base_count + np.cumsum([0, *(len(e.parameters) for e in plant.effects)])
    return [(e, fit.parameters[i:j]) for e, i, j in zip(plant.effects, edges, edges[1:], strict=False)]


def _identify(
    fitted: Sequence[Record],
    held_out: Sequence[Record],
    rig: Rig,
    estimator: str,
    out: Path,
    name: str,
    clock: Clocks | None,
) -> Identified:
    """Fit a model and write it; delete an older one first."""
    for ending in (".json", ".mat"):
        (out / f"{name}{ending}").unlink(missing_ok=True)
    model = replace(identify_records(fitted, rig, estimator, held_out=held_out), clock=clock)
    _write_model(model, out, name)
    return model


def _write_model(model: Identified, out: Path, name: str) -> None:
    """Write a model as ``NAME.json`` and for MATLAB as ``NAME.mat``."""
    exported = fitted_model(model)
    write_json(out / f"{name}.json", model.as_dict() | {"transfer_function": transfer_as_dict(exported)})
    write_mat(exported, out / f"{name}.mat")


def _write_corrected(shown: LoopInput, verdict: Verdict, folder: Path, missing: list[str]) -> None:
    """Write the series without the camera's effects that the loop found, where it found any; delete older ones."""
    for series, record in zip(shown.series, shown.records, strict=True):
        path = folder / f"{series.name}{SERIES_ENDING}"
        path.unlink(missing_ok=True)
        try:
            right = correct_camera_effects(series, verdict.after, record.view)
        except InputError as cause:
            missing.append(f"{CORRECTED}: {cause}")
            continue
        if right is not None:
            make_folder(folder)
            write_series(right, path)
