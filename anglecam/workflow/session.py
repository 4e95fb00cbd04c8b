"""What identifying and closing leave in a folder, for one session at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from anglecam.errors import RigError
from anglecam.identification.export import fitted_model, transfer_as_dict, write_mat
from anglecam.identification.identify import Estimator, Identified, declared_start, identify_records
from anglecam.io.files import write_json
from anglecam.io.series_csv import write_series
from anglecam.io.session import CORRECTED, SERIES_ENDING, Session
from anglecam.loop.camera_correction import correct_camera_effects
from anglecam.loop.close import close_records
from anglecam.loop.cross_validation import split_records
from anglecam.loop.next_experiment.design import Experiment
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import next_experiment, verdict_as_dict, write_next_command
from anglecam.neck.large_angle import LargeAngleNeck
from anglecam.report.page import write_report
from anglecam.terminal import make_folder
from anglecam.workflow.recordings import Measured, Shown


@dataclass(frozen=True)
class Closed:
    """What closing the loop gave."""

    models: tuple[Identified, Identified]
    """The paper's filter and output error."""
    verdict: Verdict
    experiment: Experiment | None
    """What to record next, where that would tell something."""


def identify_session(
    opened: Session, measured: Measured, out: Path, estimator: Estimator = "oe2", neck: LargeAngleNeck | None = None
) -> Identified:
    """Fit a model to what is not held out of a session and write it as ``model.json`` and ``model.mat``.

    Parameters
    ----------
    opened : Session
        From `anglecam.io.session.read_session`.
    measured : Measured
        Its recordings.
    out : Path
        Folder for the files.
    estimator : {'ekf', 'oe2', 'oe3', 'neck'}
        See `anglecam.identification.identify.identify_records`.
    neck : LargeAngleNeck, optional
        What is known of the neck, for ``neck``.

    Returns
    -------
    Identified
        The model.

    Raises
    ------
    AnglecamError
        Where nothing is left to fit, or it cannot be fitted.
    """
    fitted = [r for r in measured.records if r.name not in opened.rig.held_out]
    held_out = [r for r in measured.records if r.name in opened.rig.held_out]
    if not fitted:
        raise RigError(f"{opened.directory}: every recording that can be used is held out; nothing is left to fit")
    model = identify_records(fitted, opened.rig, estimator, held_out=held_out, neck=neck)
    _write_model(model, out, "model")
    return model


def close_session(
    opened: Session,
    measured: Measured,
    shown: Shown,
    out: Path,
    *,
    held_out: list[str],
    progress: Callable[[str], None] = lambda stage: None,
) -> Closed:
    """Find what the model lacks, and write models, ``loop.json``, ``report.html`` and the command to play next.

    Parameters
    ----------
    opened : Session
        From `anglecam.io.session.read_session`.
    measured : Measured
        Its recordings.
    shown : Shown
        From `anglecam.workflow.recordings.shown_to_loop`.
    out : Path
        Folder for the files.
    held_out : list of str
        Recordings to predict only.
    progress : callable
        Told each stage.

    Returns
    -------
    Closed
        Models, verdict and the experiment to do next.

    Raises
    ------
    AnglecamError
        Where nothing can be fitted.
    """
    fitted, unseen = split_records(shown.records, held_out)
    progress("extended Kalman filter")
    ekf, model = (identify_records(fitted, opened.rig, name, held_out=unseen) for name in ("ekf", "oe2"))
    starts = [declared_start(opened.rig)]
    verdict = close_records(shown.records, held_out=held_out, starts=starts, progress=progress)
    progress("report")
    _write_model(ekf, out, "ekf")
    _write_model(model, out, "model")
    experiment = next_experiment(verdict)
    write_next_command(experiment, out)
    result = verdict_as_dict(verdict, experiment)
    write_json(out / "loop.json", result)
    _write_corrected(shown, verdict, out / CORRECTED)
    title, models = opened.directory.resolve().name, (ekf, model)
    page = out / "report.html"
    write_report(page, title, verdict, result, experiment, measured.series, list(models), measured.problems)
    return Closed(models, verdict, experiment)


def _write_model(model: Identified, out: Path, name: str) -> None:
    """Write a model as ``NAME.json`` and for MATLAB as ``NAME.mat``."""
    exported = fitted_model(model)
    write_json(out / f"{name}.json", model.as_dict() | {"transfer_function": transfer_as_dict(exported)})
    write_mat(exported, out / f"{name}.mat")


def _write_corrected(shown: Shown, verdict: Verdict, folder: Path) -> None:
    """Write the series that the loop saw without what it found the camera to do, if it found anything."""
    for series, record in zip(shown.series, shown.records, strict=True):
        right = correct_camera_effects(series, verdict.after, record.view)
        if right is not None:
            make_folder(folder)
            write_series(right, folder / f"{series.name}{SERIES_ENDING}")
