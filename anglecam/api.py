"""The public face: three functions, each from a path to a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from anglecam.data.series import AngleSeries
from anglecam.identification.identified import Identified
from anglecam.io.rig import Rig, read_rig
from anglecam.io.session import read_session
from anglecam.io.yaml_schema import validate
from anglecam.loop.verdict import Verdict
from anglecam.measurement.clip import Measurement
from anglecam.neck.large_angle import LargeAngleNeck
from anglecam.workflow.clip import measure_source, open_source
from anglecam.workflow.session import close_session, identify_session, measure_session


def measure(
    clip: str | Path,
    rig: Rig | Mapping[str, Any] | str | Path | None = None,
    *,
    bodies: Literal["first", "all"] = "first",
) -> AngleSeries:
    """Measure the angle in every frame of a clip, or of tracks of points in its place.

    Parameters
    ----------
    clip : path
        A film, or tracks from another program. ``rig.yaml`` and ``NAME.command.csv`` in the same folder are read.
    rig : Rig, mapping or path, optional
        In place of that ``rig.yaml``: a `Rig`, the keys of such a file, or another such file. Angles in it are degrees,
        as their names say.
    bodies : {'first', 'all'}
        ``all``: look for all bodies that move in a film, and measure those that turn.

    Returns
    -------
    AngleSeries
        A row a frame, radians. Its ``bodies`` are what moves in the film, each with its series if it was measured.

    Raises
    ------
    InputError
        Where the clip cannot be measured.
    RigError
        Where the rig or its file is wrong.

    Examples
    --------
    ``clip`` is a film of 60 frames in which a mark swings by ±8° about a marked pivot.

    >>> import numpy as np
    >>> series = measure(clip)
    >>> len(series.time), bool(series.ok.all())
    (60, True)
    >>> bool(np.nanmax(series.sigma) < np.radians(0.1))
    True
    >>> last_second = measure(clip, rig={"frames": {"from": 30}})
    >>> len(last_second.time)
    30
    """
    measured = measure_source(open_source(Path(clip), _rig(rig)), every_body=bodies == "all")
    return replace(measured.series, bodies=measured.bodies) if isinstance(measured, Measurement) else measured.series


def _rig(rig: Rig | Mapping[str, Any] | str | Path | None) -> Rig | None:
    if rig is None or isinstance(rig, Rig):
        return rig
    return validate(dict(rig), Rig, "rig") if isinstance(rig, Mapping) else read_rig(Path(rig))


def identify(
    session: str | Path,
    estimator: str = "oe2",
    *,
    hold_out: Sequence[str] = (),
    neck: LargeAngleNeck | None = None,
) -> Identified:
    """Fit a model to a session's recordings, except those that are held out.

    Parameters
    ----------
    session : path
        A folder of clips or angle series, with or without commands.
    estimator : {'ekf', 'oe2', 'oe3', 'neck'}
        See `anglecam.identification.identify_records.identify_records`.
    hold_out : sequence of str
        Recordings to predict only, besides those that the rig file names.
    neck : LargeAngleNeck, optional
        What is known of the neck, for the estimator ``neck``; the paper's neck otherwise.

    Returns
    -------
    Identified
        The model, its uncertainties, its errors.

    Raises
    ------
    AnglecamError
        Where nothing can be fitted.

    Examples
    --------
    ``session`` is a folder with two angle series and their commands. The plant that was simulated has a = 26 1/s,
    b = 524 1/s² and c = 508 1/s².

    >>> model = identify(session)
    >>> model.names
    ('a_per_s', 'b_per_s2', 'c_per_s2')
    >>> bool(abs(model.values[1] - 524.0) < 4.0 * model.sigmas[1])
    True
    """
    return identify_session(measure_session(read_session(Path(session))), estimator, hold_out=hold_out, neck=neck)


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

    Examples
    --------
    Nothing is missing from the model of ``session``.

    >>> close_loop(session).verdict
    'nothing_missing'
    """
    from anglecam.loop.close import with_free_form

    return with_free_form(close_session(measure_session(read_session(Path(session))), hold_out=hold_out))
