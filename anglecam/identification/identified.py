"""An identified model: parameters, uncertainties, errors in free run, and what ``model.json`` holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from anglecam.data.record import Record
from anglecam.data.rounding import UNDETERMINED
from anglecam.data.step_figures import StepFigures
from anglecam.data.tables import html_table, pandas_table, xarray_dataset
from anglecam.data.typing import Floats
from anglecam.identification.clocks import Clocks
from anglecam.identification.fit import Fit
from anglecam.identification.multiple_shooting import loses_step, rms_motion
from anglecam.identification.noise import DOUBTFUL_RESIDUAL, angle_uncertainty

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@dataclass(frozen=True)
class Identified:
    """A model with its uncertainty and its errors."""

    estimator: str
    """Id of the estimator."""
    names: tuple[str, ...]
    """Names of the parameters; each ends in its unit."""
    values: Floats
    """(p,) in the units of ``names``."""
    covariance: Floats
    """(p, p), in the products of those units."""
    fit: Fit
    """Free run on the recordings that were fitted."""
    held_out: Fit | None
    """Free run on the recordings that were held out; ``None`` where none is declared."""
    step: StepFigures
    """Response to a unit step of the command."""
    fitted: tuple[Record, ...]
    """The recordings that were fitted."""
    settled: bool = True
    """Whether the estimator settled. If it did not, ``covariance`` is NaN."""
    clock: Clocks | None = None
    """Clocks of the commands; ``None`` where no recording has a command, or they were not fitted."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why the parameters or their uncertainties are unreliable, one line each; empty if there are none."""
        doubts = [f"{self.estimator}: {self.no_uncertainty}"] if self.no_uncertainty else []
        noise = angle_uncertainty(self.fitted)
        if noise > 0.0 and self.fit.rmse > DOUBTFUL_RESIDUAL * noise:
            doubts.append(
                f"the model leaves a residual of {np.degrees(self.fit.rmse):.2g}°, {self.fit.rmse / noise:.0f} times"
                f" the angle's uncertainty: it lacks something, and its ± do not hold; anglecam close searches for it"
            )
        elif not noise > 0.0 and loses_step(self.fit, self.fitted):
            doubts.append(
                f"the model leaves a residual of {np.degrees(self.fit.rmse):.2g}° of a motion of"
                f" {np.degrees(rms_motion(self.fitted)):.2g}° RMS: unless the angle is so noisy, it lacks something,"
                f" and its ± do not hold; anglecam close searches for it"
            )
        usual = max(self.fit.rmse, noise) if noise > 0.0 else self.fit.rmse
        if self.held_out is not None and self.held_out.rmse > DOUBTFUL_RESIDUAL * usual:
            doubts.append(
                f"held-out recordings are predicted with an error of {np.degrees(self.held_out.rmse):.2g}°, those that"
                f" were fitted with {np.degrees(self.fit.rmse):.2g}°: the model does not hold for the others"
            )
        if self.clock is not None and self.clock.notes:
            doubts.append(f"clock: {'; '.join(self.clock.notes)}; a, b, c take these time stamps as they are")
        return tuple(doubts)

    @property
    def no_uncertainty(self) -> str:
        """Which parameters have no uncertainty, and why, in one line; empty if all have one."""
        if not self.settled:
            return "no uncertainty (it did not settle; its parameters are the best that it reached)"
        missing = [name for name, sigma in zip(self.names, self.sigmas, strict=True) if not np.isfinite(sigma)]
        return f"no uncertainty of {', '.join(missing)} ({UNDETERMINED})" if missing else ""

    @property
    def sigmas(self) -> Floats:
        """Standard uncertainties, in the units of ``names``."""
        variance = np.diag(self.covariance)
        return np.sqrt(np.where(variance >= 0.0, variance, np.nan))  # rounding leaves less than zero of hardly any

    def as_dict(self) -> dict[str, Any]:
        """Return the content of ``model.json``."""
        parameters = {
            name: {"value": value, "sigma": sigma}
            for name, value, sigma in zip(self.names, self.values, self.sigmas, strict=True)
        }
        if "a_per_s" in parameters and "c_per_s2" not in parameters:
            parameters["c_per_s2"] = {"value": np.nan, "sigma": np.nan}  # a free swing does not determine c
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
            "residual_correlation": self.fit.residual_phi,
            "clock": None if self.clock is None else self.clock.as_dict(),
        }

    def to_pandas(self) -> pd.DataFrame:
        """Return the parameters as a table by name: ``value`` and ``sigma``, in the unit that the name ends in.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return pandas_table({"parameter": self.names, "value": self.values, "sigma": self.sigmas}, "parameter")

    def to_xarray(self) -> xr.Dataset:
        """Return the parameters as a dataset, with their covariance.

        Returns
        -------
        xarray.Dataset
            ``value`` and ``sigma`` (parameter), ``covariance`` (parameter, other), in the units that the names end in;
            the errors in free run as attributes, degrees.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        return xarray_dataset(
            {
                "value": (("parameter",), self.values),
                "sigma": (("parameter",), self.sigmas),
                "covariance": (("parameter", "other"), self.covariance),
            },
            {"parameter": (("parameter",), list(self.names)), "other": (("other",), list(self.names))},
            {"estimator": self.estimator} | {f"rmse_{key}_deg": value for key, value in self._rmse_deg.items()},
        )

    def _repr_html_(self) -> str:
        """Return parameters and errors for notebooks."""
        pairs = zip(self.names, self.values, self.sigmas, strict=True)
        rows = [
            [name, f"{value:.5g}", f"{sigma:.2g}" if np.isfinite(sigma) else "none"] for name, value, sigma in pairs
        ]
        errors = [
            [f"error in free run, {key.replace('_', ' ')}", f"{rmse:.4g}° RMS", ""]
            for key, rmse in self._rmse_deg.items()
        ]
        doubts = [["mind", doubt, ""] for doubt in self.doubts]
        header = ["parameter", "value", "standard uncertainty"]
        return html_table(f"model by {self.estimator}", header, [*rows, *errors, *doubts])

    @property
    def _rmse_deg(self) -> dict[str, float]:
        """RMS errors in free run, degrees; ``held_out`` only where recordings are held out."""
        errors = {"fit": self.fit.rmse} | ({} if self.held_out is None else {"held_out": self.held_out.rmse})
        return {key: float(np.degrees(rmse)) for key, rmse in errors.items()}
