"""Models beside a measurement that none of them was fitted to, as Figs. 11 and 15 set SYS1 and SYS2."""

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
    """What such a figure draws; arrays of length n."""

    time: Floats
    """s."""
    command: Floats
    """rad; zeros without a command."""
    measured: Floats
    """rad."""
    predicted: dict[str, Floats]
    """Free run of each model, rad, by its name."""
    rmse: dict[str, float]
    """Root mean square of measured minus predicted, rad."""


def compare_models(record: Record, fits: Mapping[str, Fit]) -> Comparison:
    """Let models predict a recording in free run.

    Parameters
    ----------
    record : Record
        Held out: only its first state, and its zero unless declared, are fitted.
    fits : mapping of str to Fit
        Models by name, such as SYS1 and SYS2.

    Returns
    -------
    Comparison
        In the order of ``fits``.
    """
    runs = {name: predict_output_error(fit, [record]) for name, fit in fits.items()}
    return Comparison(
        record.time,
        np.zeros(len(record.time)) if record.command is None else record.command.at(record.time),
        record.angle,
        {name: record.angle - run.residuals[0] for name, run in runs.items()},
        {name: run.rmse for name, run in runs.items()},
    )
