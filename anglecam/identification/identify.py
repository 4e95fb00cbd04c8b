"""Recordings to a model: the paper's filter, or output error of second or third order or of the neck itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from anglecam.data.record import Record
from anglecam.data.step_figures import NO_STEP, StepFigures
from anglecam.data.typing import Floats
from anglecam.errors import RigError
from anglecam.identification.fit import Fit
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.noise import autoregression, noise_floor
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.identification.systematic import systematic_covariance
from anglecam.io.rig import Rig
from anglecam.models.large_angle import DEFAULT, FREE_SWING, LargeAngle
from anglecam.models.plant import Plant
from anglecam.models.third_order import ThirdOrder
from anglecam.models.unit_step import step_figures
from anglecam.neck.large_angle import LargeAngleNeck, linearise

Estimator = Literal["ekf", "oe2", "oe3", "neck"]
ESTIMATORS: tuple[str, ...] = get_args(Estimator)
DOUBTFUL = 3.0
"""Times the stated noise that a model may leave over before its uncertainties are called into question."""


@dataclass(frozen=True)
class Identified:
    """A model with its uncertainty and its errors."""

    estimator: str
    names: tuple[str, ...]
    values: Floats
    """In the units of ``names``."""
    covariance: Floats
    """(p, p), in the products of those units."""
    fit: Fit
    """Free run on the recordings that were fitted."""
    held_out: Fit | None
    """Free run on those that were not; ``None`` where none is declared."""
    step: StepFigures
    fitted: tuple[Record, ...]
    """The recordings that were fitted."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the parameters or their uncertainties are not to be relied on, a line each; empty where they are."""
        held = [name for name, sigma in zip(self.names, self.sigmas, strict=True) if not np.isfinite(sigma)]
        told = [f"{', '.join(held)}: held by a bound of what is possible, so without an uncertainty"] if held else []
        stated = np.concatenate([r.sigma for r in self.fitted])
        noise = float(np.sqrt(np.mean(stated**2))) if np.all(np.isfinite(stated)) else np.nan
        if self.fit.rmse > DOUBTFUL * noise:
            told.append(
                f"the model leaves over {np.degrees(self.fit.rmse):.2g}°, {self.fit.rmse / noise:.0f} times the angle's"
                f" uncertainty: it lacks something, and its ± do not hold; anglecam close looks for what"
            )
        return tuple(told)

    @property
    def sigmas(self) -> Floats:
        """Standard uncertainties, in the units of ``names``."""
        return np.sqrt(np.diag(self.covariance))

    def as_dict(self) -> dict[str, Any]:
        """Return the content of ``model.json``."""
        parameters = {
            name: {"value": value, "sigma": sigma}
            for name, value, sigma in zip(self.names, self.values, self.sigmas, strict=True)
        }
        if "a_per_s" in parameters and "c_per_s2" not in parameters:
            parameters["c_per_s2"] = {"value": np.nan, "sigma": np.nan}  # a free swing does not tell
        return {
            "estimator": self.estimator,
            "parameters": parameters,
            "covariance": {"names": list(self.names), "matrix": self.covariance},
            "rmse_deg": {
                "fit": np.degrees(self.fit.rmse),
                "held_out": np.degrees(self.held_out.rmse) if self.held_out else None,
            },
            "step": {
                "command_deg": 1.0,
                "rise_time_s": self.step.rise_time,
                "overshoot": self.step.overshoot,
                "overshoot_percent": 100.0 * self.step.overshoot,
                "settling_time_s": self.step.settling_time,
                "steady_state_deg": self.step.steady_state,
            },
            "residual_correlation": phi(self.fit),
        }


def identify_records(
    fitted: Sequence[Record],
    rig: Rig,
    estimator: Estimator,
    *,
    held_out: Sequence[Record] = (),
    neck: LargeAngleNeck | None = None,
) -> Identified:
    """Fit a model to recordings of one rig.

    Parameters
    ----------
    fitted : sequence of Record
        With or without commands; initial states are unknown in each.
    rig : Rig
        For the starting values of the model, where declared.
    estimator : {'ekf', 'oe2', 'oe3', 'neck'}
        The paper's extended Kalman filter (SYS1), output error of second order, output error of third order with
        zeros (SYS2, Eq. (36)), output error of the neck at large angles, Eq. (31), in physical parameters.
    held_out : sequence of Record
        Recordings to predict only.
    neck : LargeAngleNeck, optional
        What is known of the neck, for that estimator; the paper's otherwise.

    Returns
    -------
    Identified
        The model.

    Raises
    ------
    RigError
        Where there is no such estimator, or the neck as it is declared cannot move as it did.
    """
    if estimator not in ESTIMATORS:
        raise RigError(f"no estimator {estimator!r}; choose one of {', '.join(ESTIMATORS)}")
    driven = any(r.command is not None for r in fitted)
    starts = start_parameters(fitted)
    if "model" in rig.model_fields_set:
        starts.insert(0, declared_start(rig)[: 3 if driven else 2])
    plant = Plant(driven=driven)
    fit = fit_output_error(plant, fitted, starts)
    if estimator == "ekf":
        run, values, covariance = _by_filter(fit, fitted, starts[0])
    else:
        if estimator == "oe3":
            fit = _third_order(fit, fitted)
        elif estimator == "neck":
            fit = _large_angle(fit, fitted, neck or LargeAngleNeck())
        run, values, covariance = fit, fit.parameters, fit.coloured_covariance(fitted, phi(fit))
    if noise := noise_floor(fitted):  # what a systematic error does to the optimum it does to a filter's parameters
        covariance = covariance + systematic_covariance(fit, fitted, noise)
    scale = run.model.to_file
    return Identified(
        estimator,
        run.model.names,
        values * scale,
        covariance * np.outer(scale, scale),
        run,
        predict_output_error(run, held_out) if held_out else None,
        _step(run) if driven else NO_STEP,
        tuple(fitted),
    )


def phi(fit: Fit) -> float:
    """Return the correlation from frame to frame that a fit's residual shows."""
    return autoregression(fit.residuals, "residual").phi


def declared_start(rig: Rig) -> Floats:
    """Return the rig's starting values a (1/s), b (1/s²), c (1/s²)."""
    return np.array([rig.model.a, rig.model.b, rig.model.c])


def _by_filter(fit: Fit, records: Sequence[Record], start: Floats) -> tuple[Fit, Floats, Floats]:
    from anglecam.identification.ekf import (  # filterpy takes a second to load, which others are spared
        fit_ekf,
        settings_for,
    )

    noise = noise_floor(records)
    sigma = max(noise.sigma if noise else 0.0, fit.rmse)
    initial = start if len(start) == 3 else np.append(start, 0.0)
    estimate = fit_ekf(records, initial, settings_for(records, initial, sigma))
    n = len(fit.parameters)
    free_run = fit_output_error(fit.model, records, [estimate.parameters[:n]], nuisance=fit.nuisance, fixed=True)
    return free_run, estimate.parameters[:n], estimate.covariance[:n, :n]


def _third_order(second: Fit, records: Sequence[Record]) -> Fit:
    """Start from the second-order model times (s + p)/(s + p), for a few p, and let the fit part the two."""
    a, b, *c = second.parameters
    fast = np.sqrt(abs(b))
    starts = [
        np.array([a + p, b + a * p, b * p] + [n for gain in c for n in (0.0, gain, gain * p)])
        for p in (0.5 * fast, fast, 3.0 * fast)
    ]
    return fit_output_error(ThirdOrder(driven=bool(c)), records, starts)


def _large_angle(second: Fit, records: Sequence[Record], neck: LargeAngleNeck) -> Fit:
    driven = len(second.parameters) == 3
    model = LargeAngle(neck, DEFAULT if driven else FREE_SWING)
    starts = model.starts(second.parameters) if driven else [model.nominal]
    fit = fit_output_error(model, records, starts)
    if not np.isfinite(fit.cost):
        raise RigError(
            "the neck as it is declared cannot move as it did: from every start it leaves the reach of its linkage;"
            " check linkage_slope and spring.common_stretch_m in the neck file"
        )
    return fit


def _step(fit: Fit) -> StepFigures:
    p = fit.parameters
    if isinstance(fit.model, LargeAngle):
        # a unit step is beyond any linkage: the figures are those of small angles
        neck = fit.model.neck_at(p)
        near = linearise(neck)
        p = np.array([near.a, near.b, near.c * neck.parameters.servo.command_gain])
        return step_figures(Plant(), p, np.roots([1.0, near.a, near.b]), p[2] / p[1])
    if isinstance(fit.model, Plant):
        return step_figures(fit.model, p, np.roots([1.0, p[0], p[1]]), p[2] / p[1] if p[1] else 0.0)
    return step_figures(fit.model, p, np.roots([1.0, *p[:3]]), p[5] / p[2] if p[2] else 0.0)
