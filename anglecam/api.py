"""The public face: three functions, each from a path to a result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from anglecam.data.series import AngleSeries
from anglecam.errors import InputError
from anglecam.identification.identify import Estimator, Identified, declared_start, identify_records
from anglecam.io.rig import Rig
from anglecam.io.session import Session, command_beside, read_session, rig_beside
from anglecam.loop.close import close_records
from anglecam.loop.verdict import Verdict
from anglecam.workflow.recordings import Measured, measure_recording, measure_session, shown_to_loop


def measure(clip: str | Path, rig: Rig | None = None) -> AngleSeries:
    """Measure the angle in every frame of a clip, or of tracks of points in its place.

    Parameters
    ----------
    clip : path
        A film, or DeepLabCut's or SLEAP's tracks; ``rig.yaml`` and ``NAME.command.csv`` beside it are read.
    rig : Rig, optional
        In place of the ``rig.yaml`` beside the clip.

    Returns
    -------
    AngleSeries
        A row a frame, radians.

    Raises
    ------
    InputError
        Where the clip cannot be measured.
    RigError
        Where the rig file is wrong.
    """
    path = Path(clip)
    return measure_recording(path, rig or rig_beside(path), command_beside(path)).series


def identify(session: str | Path, estimator: Estimator = "oe2") -> Identified:
    """Fit a model to a session's recordings, those that its rig file holds out apart.

    Parameters
    ----------
    session : path
        A folder of clips or angle series, with commands or without.
    estimator : {'ekf', 'oe2', 'oe3'}
        See `anglecam.identification.identify.identify_records`.

    Returns
    -------
    Identified
        The model, its uncertainties, its errors.

    Raises
    ------
    AnglecamError
        Where nothing can be fitted.
    """
    opened, measured = _measured(session)
    records = measured.records
    held_out = [r for r in records if r.name in opened.rig.held_out]
    fitted = [r for r in records if r.name not in opened.rig.held_out]
    return identify_records(fitted, opened.rig, estimator, held_out=held_out)


def close_loop(session: str | Path, hold_out: Sequence[str] = ()) -> Verdict:
    """Find what the base model lacks in a session.

    Parameters
    ----------
    session : path
        A folder of clips or angle series.
    hold_out : sequence of str
        Recordings to predict only, besides those that the rig file names.

    Returns
    -------
    Verdict
        What was added, the evidence, the error before and after.

    Raises
    ------
    AnglecamError
        Where nothing can be fitted.
    """
    opened, measured = _measured(session)
    records = shown_to_loop(opened, measured).records
    starts = [declared_start(opened.rig)]
    return close_records(records, held_out=[*opened.rig.held_out, *hold_out], starts=starts)


def _measured(session: str | Path) -> tuple[Session, Measured]:
    opened = read_session(Path(session))
    measured = measure_session(opened)
    if not measured.records:
        raise InputError(f"{session}: no recording can be used; {'; '.join(map(str, measured.problems))}")
    return opened, measured
