"""A decision threshold with its documentation, as a field of a frozen dataclass."""

from __future__ import annotations

from dataclasses import field
from typing import Any

NOT_CALIBRATED = "not calibrated"


def threshold(value: float, unit: str, meaning: str, controls: str, calibration: str = NOT_CALIBRATED) -> Any:
    """Declare a field with its documentation, which ``loop.json`` prints.

    Parameters
    ----------
    value : float
        The default.
    unit : str
        Of the value.
    meaning : str
        What is compared with it.
    controls : str
        The error whose rate it sets.
    calibration : str
        How the value was chosen, and on what it was tested.

    Returns
    -------
    field
        For a dataclass; its metadata hold the four texts.
    """
    documentation = {"unit": unit, "meaning": meaning, "controls": controls, "calibration": calibration}
    return field(default=value, metadata=documentation)
