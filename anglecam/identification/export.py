"""A fitted model for other programs: python-control, scipy.signal, MATLAB and JSON.

    θ(s)/U(s) = num(s)/den(s),   highest power of s first

Command U and angle θ refer to the same axis and have one unit, degrees in files, so the numbers also hold in radians.
The parameters are those of the estimator, in the units that their names end in, with their full covariance. A model at
large angles is exported as its linearisation at neutral, Eq. (33), together with its physical parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.errors import InputError
from anglecam.identification.identified import Identified
from anglecam.io.files import read_json
from anglecam.models.large_angle import QUANTITIES, LargeAngle
from anglecam.neck.large_angle import linearise

if TYPE_CHECKING:
    import control
    from scipy import signal


SECOND_ORDER = ("a_per_s", "b_per_s2", "c_per_s2")
"""Parameters of the second-order model, in the order of the transfer function's coefficients."""
THIRD_ORDER = ("d2_per_s", "d1_per_s2", "d0_per_s3", "n2_per_s", "n1_per_s2", "n0_per_s3")
"""Parameters of the third-order model, likewise."""
_MAT_TEXT = b"MATLAB 5.0 MAT-file, written by anglecam".ljust(116)
"""The descriptive text that a MAT-file of version 5 begins with: 116 bytes (MathWorks, MAT-File Format, 1-5)."""


@dataclass(frozen=True)
class FittedModel:
    """A fitted model in the form in which it is exported."""

    name: str
    """Id of the estimator, or another name of the model."""
    names: tuple[str, ...]
    """Names of the parameters; each ends in its unit."""
    values: Floats
    """(p,) in the units of ``names``."""
    covariance: Floats
    """(p, p) in the products of those units; NaN where it is not known."""
    numerator: Floats
    """Numerator of angle per command, highest power of s first; empty where nothing was commanded."""
    denominator: Floats
    """Denominator, highest power of s first; its first coefficient is 1."""

    @property
    def linearised(self) -> bool:
        """Whether the parameters are those of a model at large angles, and the transfer function its linearisation."""
        return self.names[0] not in (SECOND_ORDER[0], THIRD_ORDER[0])

    @property
    def sigmas(self) -> Floats:
        """(p,) standard uncertainties, in the units of ``names``."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Roots of the denominator, 1/s."""
        return np.roots(self.denominator).astype(complex)


def fitted_model(model: Identified) -> FittedModel:
    """Return the exported form of an identified model.

    Parameters
    ----------
    model : Identified
        From `anglecam.identification.identify_records.identify_records`, with any estimator.

    Returns
    -------
    FittedModel
        With its covariance.
    """
    if isinstance(model.fit.model, LargeAngle):
        scale = model.fit.model.to_file
        return fitted_large_angle(model.fit.model, model.values / scale, model.covariance / np.outer(scale, scale))
    return _by_names(model.estimator, model.names, model.values, model.covariance)


def fitted_large_angle(model: LargeAngle, parameters: Floats, covariance: Floats) -> FittedModel:
    """Return the exported form of a model at large angles that output error has fitted.

    Parameters
    ----------
    model : LargeAngle
        The fitted model.
    parameters : (p,) ndarray
        SI, in the order of ``model.names``.
    covariance : (p, p) ndarray
        SI.

    Returns
    -------
    FittedModel
        With the transfer function of its linearisation at neutral.
    """
    neck = model.neck_at(parameters)
    near = linearise(neck)
    gain = near.c * neck.parameters.servo.command_gain
    scale = model.to_file
    return FittedModel(
        "large angle",
        model.names,
        parameters * scale,
        covariance * np.outer(scale, scale),
        np.array([gain]),
        np.array([1.0, near.a, near.b]),
    )


def read_model(path: Path) -> FittedModel:
    """Read a ``model.json`` of ``anglecam identify``.

    Parameters
    ----------
    path : Path
        The file. Without ``covariance`` in it, the parameters count as uncorrelated.

    Returns
    -------
    FittedModel
        Of second or third order, or of the neck at large angles with its linearisation at neutral.

    Raises
    ------
    InputError
        Naming the file and the cause.
    """
    try:
        content = read_json(path)
        parameters = content["parameters"]
        large = {q.name for q in QUANTITIES} >= set(parameters)
        order = tuple(parameters) if large else THIRD_ORDER if "d0_per_s3" in parameters else SECOND_ORDER
        names = tuple(name for name in order if parameters.get(name, {}).get("value") is not None)
        values = np.array([float(parameters[name]["value"]) for name in names])
        covariance = _covariance(content.get("covariance"), parameters, names)
        name = str(content.get("estimator", "model"))
        transfer = content["transfer_function"] if large and names else None
        sides = transfer and [np.asarray(transfer[side], dtype=float) for side in ("numerator", "denominator")]
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or fault})") from fault
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as fault:
        raise InputError(f"{path}: not a model.json of anglecam identify") from fault
    if sides and np.isfinite(values).all():
        return FittedModel(f"{name} at neutral", names, values, covariance, *sides)
    if len(names) < 2 or not np.isfinite(values).all():
        raise InputError(f"{path}: not a model.json of anglecam identify: a_per_s and b_per_s2 are missing")
    return _by_names(name, names, values, covariance)


def transfer_function(model: FittedModel) -> control.TransferFunction:
    """Return a model as a transfer function of python-control.

    Raises
    ------
    ValueError
        If nothing was commanded, so that the input is unknown.
    """
    import control

    return control.tf(*_driven(model), name=model.name.replace(" ", "_"), inputs=["command"], outputs=["angle"])


def scipy_system(model: FittedModel) -> signal.TransferFunction:
    """Return a model as a transfer function of scipy.signal; raises `ValueError` if nothing was commanded."""
    from scipy import signal

    return signal.TransferFunction(*_driven(model))


def model_as_dict(model: FittedModel) -> dict[str, Any]:
    """Return a model with covariance, transfer function and units as the content of a JSON file."""
    parameters = zip(model.names, model.values, model.sigmas, strict=True)
    return {
        "model": model.name,
        "parameters": {name: {"value": v, "sigma": s, "unit": unit_of(name)} for name, v, s in parameters},
        "covariance": {"names": list(model.names), "matrix": model.covariance},
        "transfer_function": transfer_as_dict(model),
    }


def transfer_as_dict(model: FittedModel) -> dict[str, Any]:
    """Return a transfer function as the content of a JSON file; the numerator is empty if nothing was commanded."""
    return {
        "numerator": model.numerator,
        "denominator": model.denominator,
        "variable": "s, 1/s; highest power first",
        "input": "command, deg",
        "output": "angle, deg",
    }


def write_mat(model: FittedModel, path: Path) -> None:
    """Write a model as a MATLAB file: one struct ``model``, for ``tf(model.num, model.den)``.

    The same model always gives the same bytes: the text at the beginning, in which SciPy states the system and the
    time, is replaced by a constant one.

    Parameters
    ----------
    model : FittedModel
        Model to write.
    path : Path
        A ``.mat`` file, version 5; an existing file is replaced.
    """

    def cells(texts: tuple[str, ...]) -> NDArray[np.object_]:
        column = np.empty((len(texts), 1), dtype=object)
        column[:, 0] = texts
        return column

    content = {
        "name": model.name,
        "num": model.numerator.reshape(1, -1),
        "den": model.denominator.reshape(1, -1),
        "poles_per_s": model.poles.reshape(-1, 1),
        "names": cells(model.names),
        "units": cells(tuple(unit_of(name) for name in model.names)),
        "values": model.values.reshape(-1, 1),
        "covariance": model.covariance,
        "input": "command",
        "input_unit": "deg",
        "output": "angle",
        "output_unit": "deg",
    }
    from scipy import io  # SciPy takes most of a second to load

    path.parent.mkdir(parents=True, exist_ok=True)
    made = BytesIO()
    io.savemat(made, {"model": content}, oned_as="column")
    path.write_bytes(_MAT_TEXT + made.getvalue()[len(_MAT_TEXT) :])


_UNITS = {"nms": "N*m*s", "nm": "N*m", "n": "N", "m": "m", "v": "V", "rad": "rad", "deg": "deg", "s": "s", "s2": "s^2"}
_UNITS |= {"s3": "s^3"}


def unit_of(name: str) -> str:
    """Return the unit that a parameter's name ends in: ``b_per_s2`` → ``1/s^2``; empty for a name without one."""
    words = name.split("_")
    if "per" in words:
        at = words.index("per")
        above = _UNITS.get(words[at - 1], "1")
        return f"{above}/{_UNITS.get(words[at + 1], words[at + 1])}"
    return _UNITS.get(words[-1], "")


def _by_names(name: str, names: tuple[str, ...], values: Floats, covariance: Floats) -> FittedModel:
    """Return a model whose parameters' names determine the form of its transfer function."""
    half = 3 if names[0] == THIRD_ORDER[0] else 2
    return FittedModel(name, names, values, covariance, values[half:], np.array([1.0, *values[:half]]))


def _covariance(stated: dict[str, Any] | None, parameters: dict[str, Any], names: tuple[str, ...]) -> Floats:
    """Return (p, p) in the order of ``names``, from the file's covariance, else from its standard uncertainties."""
    if stated is None:
        return np.diag([_number(parameters[name]["sigma"]) ** 2 for name in names])
    at = [stated["names"].index(name) for name in names]
    whole = np.array([[_number(cell) for cell in row] for row in stated["matrix"]]).reshape(len(stated["names"]), -1)
    return np.asarray(whole[np.ix_(at, at)], dtype=float)


def _number(cell: float | None) -> float:
    return np.nan if cell is None else float(cell)


def _driven(model: FittedModel) -> tuple[Floats, Floats]:
    if len(model.numerator) == 0:
        raise ValueError("nothing was commanded: the model has no input")
    return model.numerator, model.denominator
