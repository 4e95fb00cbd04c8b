"""Correction of camera effects: angles and times without the camera's effects that the loop attributed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.series import AngleSeries
from anglecam.effects import Knots
from anglecam.identification.fit import Fit
from anglecam.models.plant import Plant

ROUNDS = 20
"""Fixed-point iterations; the map differs from the identity by a few per cent, so each gains more than one decimal."""


def correct_camera_effects(series: AngleSeries, fit: Fit, view: View) -> AngleSeries | None:
    """Invert the camera effects of a fitted plant in a recording.

    Parameters
    ----------
    series : AngleSeries
        The series that was fitted.
    fit : Fit
        Of a `Plant` with the attributed effects.
    view : View
        Of the recording's `Record`.

    Returns
    -------
    AngleSeries or None
        With corrected angles (effects at the port ``seen``) and times (effects at ``when``, and of a clock); ``None``
        if the plant has no camera effect.

    Raises
    ------
    TypeError
        If another model than a `Plant` was fitted.
    """
    if not isinstance(fit.model, Plant):
        raise TypeError("only a Plant has effects")
    camera = [(e, values) for e, values in fit.model.parameters_by_effect(fit.parameters) if e.station == "camera"]
    if not camera:
        return None
    angle, time = series.angle, series.time
    for effect, values in reversed(camera):
        if effect.observation is not None:
            shown, angle = angle, angle.copy()
            for _ in range(ROUNDS):
                angle = angle + shown - effect.observation(series.time, angle, values, view)
        if effect.command is not None:  # the clip's clock runs differently from the command's
            ticks = np.linspace(min(2.0 * time[0], 0.0), 2.0 * time[-1], len(time))
            zeros = np.zeros(len(ticks))
            time = np.interp(time, effect.command(Knots(ticks, zeros, zeros), values).time, ticks)
    known = np.isfinite(angle)
    for effect, values in reversed(camera):
        if effect.timing is not None and known.any():
            # the time of a frame without an angle depends on an angle interpolated from the others
            filled = np.interp(time, time[known], angle[known])
            time = effect.timing(time, filled, values, view)
    return replace(series, angle=angle, time=time)
