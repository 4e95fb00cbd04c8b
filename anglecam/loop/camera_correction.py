"""What the camera did, undone: angles and times as they would be without the camera-side effects that were found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.series import AngleSeries
from anglecam.effects import Knots
from anglecam.identification.fit import Fit
from anglecam.models.plant import Plant

ROUNDS = 20
"""Of a fixed point whose map differs from the identity by a few per cent: each gains more than a decimal."""


def correct_camera_effects(series: AngleSeries, fit: Fit, view: View) -> AngleSeries | None:
    """Undo the camera-side effects of a fitted plant in a recording.

    Parameters
    ----------
    series : AngleSeries
        As it was fitted.
    fit : Fit
        Of a `Plant` with the effects that were found.
    view : View
        As of the recording's `Record`.

    Returns
    -------
    AngleSeries or None
        With other angles (effects at the port ``seen``) and times (at ``when``, and a clock's); ``None`` where the
        plant has no effect of the camera.
    """
    if not isinstance(fit.model, Plant):
        raise TypeError("only a Plant has effects")
    camera = [(e, own) for e, own in fit.model.parameters_by_effect(fit.parameters) if e.station == "camera"]
    if not camera:
        return None
    angle, time = series.angle, series.time
    for effect, own in reversed(camera):
        if effect.observation is not None:
            shown, angle = angle, angle.copy()
            for _ in range(ROUNDS):
                angle = angle + shown - effect.observation(series.time, angle, own, view)
        if effect.command is not None:  # the clip's clock against the command's
            ticks = np.linspace(min(2.0 * time[0], 0.0), 2.0 * time[-1], len(time))
            nothing = np.zeros(len(ticks))
            time = np.interp(time, effect.command(Knots(ticks, nothing, nothing), own).time, ticks)
    known = np.isfinite(angle)
    for effect, own in reversed(camera):
        if effect.timing is not None and known.any():
            # a frame without an angle lies between those that have one
            filled = np.interp(time, time[known], angle[known])
            time = effect.timing(time, filled, own, view)
    return replace(series, angle=angle, time=time)
