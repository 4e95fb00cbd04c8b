"""Correction of camera effects: angles and times without the camera's effects that the loop attributed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats
from anglecam.effects import Effect, Knots
from anglecam.errors import InputError
from anglecam.identification.fit import Fit
from anglecam.measurement.derivatives import with_derivatives
from anglecam.models.plant import Plant

DRAWS = 100
"""Draws of the parameters; they give the correction's standard uncertainty to 7 %."""
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
        if the plant has no camera effect. `AngleSeries.sigma` includes the uncertainty of the effects' parameters,
        with those of the times as errors of the angle.

    Raises
    ------
    InputError
        If the correction cannot be trusted: a parameter has no uncertainty, or the uncertainty of the correction is
        larger than the correction (RMS over the recording).
    TypeError
        If another model than a `Plant` was fitted.
    """
    if not isinstance(fit.model, Plant):
        raise TypeError("only a Plant has effects")
    camera = [one for one in fit.model.parameters_by_effect(fit.parameters) if one[0].station == "camera"]
    if not camera:
        return None
    right = _inverted(series, camera, view)
    known = np.isfinite(right.angle)
    drawn = []
    for values in _drawn_parameters(fit, [effect for effect, _ in camera]):
        effects = [one for one in fit.model.parameters_by_effect(values) if one[0].station == "camera"]
        one = _inverted(series, effects, view)
        drawn.append(np.interp(right.time[known], one.time[known], one.angle[known]) - right.angle[known])
    spread = np.sqrt(np.mean(np.square(drawn), axis=0))
    moved = right.angle[known] - np.interp(right.time[known], series.time[known], series.angle[known])
    uncertain, size = (float(np.sqrt(np.mean(one**2))) for one in (spread, moved))
    if not uncertain <= size:
        raise InputError(
            f"{series.name}: not corrected for {', '.join(effect.id for effect, _ in camera)}: the correction is "
            f"{np.degrees(size):.2g}° RMS, its standard uncertainty {np.degrees(uncertain):.2g}°"
        )
    sigma = right.sigma.copy()
    sigma[known] = np.hypot(sigma[known], spread)
    return with_derivatives(replace(right, sigma=sigma))


def _inverted(series: AngleSeries, camera: Sequence[tuple[Effect, Floats]], view: View) -> AngleSeries:
    """Return a series without camera effects of given parameters."""
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


def _drawn_parameters(fit: Fit, camera: Sequence[Effect]) -> Floats:
    """Draw (DRAWS, p) parameters within their bounds; correlations are those of white noise, σ is the fit's.

    Parameters of the mechanism that are at a bound stay there.
    """
    sigma = fit.sigma
    names = [p.name for effect in camera for p in effect.parameters]
    missing = [name for name, s in zip(fit.model.names, sigma, strict=True) if name in names and not np.isfinite(s)]
    if missing:
        raise InputError(f"not corrected: these recordings do not determine {', '.join(missing)}, or it is at a bound")
    free = np.flatnonzero(sigma > 0.0)
    white = fit.covariance[np.ix_(free, free)]
    spread = sigma[free] / np.sqrt(np.diag(white))
    drawn = np.tile(fit.parameters, (DRAWS, 1))
    drawn[:, free] += np.random.default_rng(0).multivariate_normal(
        np.zeros(len(free)), white * np.outer(spread, spread), DRAWS, method="eigh"
    )
    return np.clip(drawn, fit.model.lower, fit.model.upper)
