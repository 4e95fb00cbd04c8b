"""``NAME.responses.json``: the measured response to each change of the command."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from anglecam.errors import InputError
from anglecam.io.files import read_json
from anglecam.neck.pd_tuning import NodTarget


def nod_from_responses(path: Path, number: int | None = None) -> NodTarget:
    """Return the wanted nod from a measured one, of a robot or a person.

    Parameters
    ----------
    path : Path
        ``NAME.responses.json`` of ``anglecam measure``.
    number : int, optional
        Index of the response, from 0; default: the median of all responses.

    Returns
    -------
    NodTarget
        Its tolerances are twice the measured uncertainties, or the usual ones where these are larger.

    Raises
    ------
    InputError
        With the file and the cause.
    """
    try:
        content = read_json(path)
        responses = [[_value_and_sigma(r[key]) for key in ("rise_time_s", "overshoot")] for r in content]
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or fault})") from fault
    except (ValueError, KeyError, TypeError) as fault:
        raise InputError(f"{path}: not a list of responses with rise_time_s and overshoot") from fault
    if number is not None and not 0 <= number < len(responses):
        raise InputError(f"{path}: no response {number} among {len(responses)}, counted from 0")
    chosen = responses if number is None else responses[number : number + 1]
    complete = np.array([r for r in chosen if np.isfinite([r[0][0], r[1][0]]).all()])
    if not len(complete):
        raise InputError(f"{path}: none of {len(chosen)} responses has both a rise time and an overshoot")
    (rise, rise_sigma), (overshoot, overshoot_sigma) = np.median(complete, axis=0)
    if not rise > 0.0:
        raise InputError(f"{path}: the rise time is {rise:g} s")
    usual = NodTarget()
    return NodTarget(
        float(rise),
        float(overshoot),
        float(np.nanmax([usual.rise_tolerance, 2.0 * rise_sigma / rise])),
        float(np.nanmax([usual.overshoot_tolerance, 2.0 * overshoot_sigma])),
    )


def _value_and_sigma(figure: dict[str, float | None]) -> tuple[float, float]:
    """Return value and sigma, NaN where missing."""
    value, sigma = figure["value"], figure.get("sigma")
    return math.nan if value is None else float(value), math.nan if sigma is None else float(sigma)
