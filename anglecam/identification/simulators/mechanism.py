"""The mechanism that a ``model.json`` or ``loop.json`` describes: a, b, c and the effects with their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from anglecam.effects import LEDGER, Parameter
from anglecam.errors import InputError
from anglecam.identification.export import FittedModel, read_model
from anglecam.io.model_json import read_model_file

CAMERA = {e.id for e in LEDGER if e.station == "camera"}


@dataclass(frozen=True)
class Mechanism:
    """θ̈ = c·u − a·θ̇ − b·θ with effects."""

    name: str
    a: float
    """1/s."""
    b: float
    """1/s²."""
    c: float | None
    """1/s²; ``None`` where nothing was commanded."""
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Id of each effect → its parameters by their names in files, SI; a limit itself, not its reciprocal."""

    def value(self, effect_id: str, parameter: str, absent: float = 0.0) -> float:
        """Return a parameter of an effect, SI; ``absent`` where the mechanism does not have it."""
        return self.effects.get(effect_id, {}).get(parameter, absent)


@dataclass(frozen=True)
class Exported:
    """A file for another program, and what it cannot express."""

    text: str
    left_out: tuple[str, ...]
    """One line for each effect, or part of one, that the format cannot express or expresses differently."""


def read_mechanism(path: Path) -> Mechanism:
    """Read a mechanism.

    Parameters
    ----------
    path : Path
        A ``loop.json`` of ``anglecam close`` or a ``model.json`` of ``anglecam identify``.

    Returns
    -------
    Mechanism
        From a model at large angles, its linearisation at neutral.

    Raises
    ------
    InputError
        Naming the file and the cause.
    """
    content = read_model_file(path)
    if "verdict" in content:
        return _from_loop(path, content)
    model = read_model(path)
    if len(model.denominator) != 3 or len(model.numerator) > 1:
        raise InputError(
            f"{path}: a model of third order with zeros is no joint with an actuator; export the model of"
            " anglecam close, or of anglecam identify with oe2 or ekf"
        )
    c = float(model.numerator[0]) if len(model.numerator) else None
    return Mechanism(path.stem, float(model.denominator[1]), float(model.denominator[2]), c)


def linear_model(path: Path) -> tuple[FittedModel, list[str]]:
    """Return the linear part of a model as a transfer function, and a line for each effect that it leaves out.

    A first-order lag becomes a pole, with the lag's covariance unknown.
    """
    import numpy as np

    if "verdict" not in read_model_file(path):
        return read_model(path), []
    content, mechanism = read_model_file(path)["model"], read_mechanism(path)
    names = tuple(name for name in ("a_per_s", "b_per_s2", "c_per_s2") if name in content)
    values = np.array([content[name]["value"] for name in names], dtype=float)
    sigmas = np.array([_number(content[name].get("sigma")) for name in names])
    numerator, denominator = values[2:], np.array([1.0, *values[:2]])
    lag = mechanism.value("actuator_lag", "lag_s")
    if lag > 0.0:
        numerator, denominator = numerator / lag, np.polymul(denominator, [1.0, 1.0 / lag])
    left_out = [f"{name}: not in the transfer function" for name in mechanism.effects if name != "actuator_lag"]
    return FittedModel(mechanism.name, names, values, np.diag(sigmas**2), numerator, denominator), left_out


def _from_loop(path: Path, content: dict[str, Any]) -> Mechanism:
    ledger = {e.id: {p.name: p for p in e.parameters} for e in LEDGER}
    try:
        model = {name: float(one["value"]) for name, one in content["model"].items()}
        effects = {}
        for one in content["effects"]:
            fitted = {name: stated["value"] for name, stated in one["parameters"].items()} | one.get("fixed", {})
            known = ledger[one["id"]]
            effects[one["id"]] = {name: _in_si(known[name], v) for name, v in fitted.items() if v is not None}
        return Mechanism(path.stem, model["a_per_s"], model["b_per_s2"], model.get("c_per_s2"), effects)
    except (KeyError, TypeError, ValueError, AttributeError) as fault:
        raise InputError(f"{path}: not a loop.json of this version of anglecam close") from fault


def _in_si(parameter: Parameter, value: float) -> float:
    """Return a value from a file in SI."""
    return float(value) / parameter.to_file


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
