"""Models compared with a measurement that none of them was fitted to, as SYS1 and SYS2 in Figs. 11 and 15."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.data.record import Record
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import predict_output_error

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Comparison:
    """Data of such a figure; arrays of length n."""

    time: Floats
    """Frame times, s."""
    command: Floats
    """Command, rad; zeros without a command."""
    measured: Floats
    """Measured angle, rad."""
    predicted: dict[str, Floats]
    """Free run of each model, rad, by its name."""
    rmse: dict[str, float]
    """Root mean square of measured minus predicted, rad."""


def compare_models(record: Record, fits: Mapping[str, Fit]) -> Comparison:
    """Predict a recording with several models in free run.

    Parameters
    ----------
    record : Record
        Held-out recording: only its first state, and its zero unless declared, are fitted.
    fits : mapping of str to Fit
        Models by name, for example SYS1 and SYS2.

    Returns
    -------
    Comparison
        Predictions and errors in the order of ``fits``.
    """
    runs = {name: predict_output_error(fit, [record]) for name, fit in fits.items()}
    return Comparison(
        record.time,
        np.zeros(len(record.time)) if record.command is None else record.command.at(record.time),
        record.angle,
        {name: record.angle - run.residuals[0] for name, run in runs.items()},
        {name: run.rmse for name, run in runs.items()},
    )
