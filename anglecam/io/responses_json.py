"""``NAME.responses.json``: how a measured angle answered each change of the command."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from anglecam.errors import InputError
from anglecam.io.files import read_json
from anglecam.neck.pd_tuning import NodTarget


def nod_from_responses(path: Path, number: int | None = None) -> NodTarget:
    """Take the wanted nod from a measured one, robot's or person's.

    Parameters
    ----------
    path : Path
        ``NAME.responses.json`` of ``anglecam measure``.
    number : int, optional
        Which of its responses, from 0; the median of all without it.

    Returns
    -------
    NodTarget
        With twice the measured uncertainty for tolerance, where that is more than the usual one.

    Raises
    ------
    InputError
        Naming the file and what is wrong with it.
    """
    try:
        told = read_json(path)
        all_of_it = [[_figure(r[key]) for key in ("rise_time_s", "overshoot")] for r in told]
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or fault})") from fault
    except (ValueError, KeyError, TypeError) as fault:
        raise InputError(f"{path}: not a list of responses with rise_time_s and overshoot") from fault
    if number is not None and not 0 <= number < len(all_of_it):
        raise InputError(f"{path}: no response {number} among {len(all_of_it)}, counted from 0")
    chosen = all_of_it if number is None else all_of_it[number : number + 1]
    whole = np.array([r for r in chosen if np.isfinite([r[0][0], r[1][0]]).all()])
    if not len(whole):
        raise InputError(f"{path}: none of {len(chosen)} responses has both a rise time and an overshoot")
    (rise, rise_sigma), (overshoot, overshoot_sigma) = np.median(whole, axis=0)
    if not rise > 0.0:
        raise InputError(f"{path}: the rise time is {rise:g} s")
    usual = NodTarget()
    return NodTarget(
        float(rise),
        float(overshoot),
        float(np.nanmax([usual.rise_tolerance, 2.0 * rise_sigma / rise])),
        float(np.nanmax([usual.overshoot_tolerance, 2.0 * overshoot_sigma])),
    )


def _figure(told: dict[str, float | None]) -> tuple[float, float]:
    """Return value and sigma; a missing one is NaN."""
    value, sigma = told["value"], told.get("sigma")
    return math.nan if value is None else float(value), math.nan if sigma is None else float(sigma)
