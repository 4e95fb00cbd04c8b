"""The content of ``certificate.json``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from anglecam.certificate.certify import Certificate, Certified
from anglecam.certificate.statement import aliases, conditions, doubt, statement
from anglecam.effects import effect
from anglecam.identification.systematic import full_sigma
from anglecam.loop.refit import effects_of, plant_of

COMMAND_ENDING = ".next.command.csv"
"""``QUANTITY.next.command.csv``: the command that would determine a quantity."""


def certificate_as_dict(certificate: Certificate) -> dict[str, Any]:
    """Return the content of ``certificate.json``, in the units that its keys name.

    Parameters
    ----------
    certificate : Certificate
        From `anglecam.certificate.certify.certify`.

    Returns
    -------
    dict
        A limit that is not there, and an end that an interval does not have, are infinite, and ``null`` in the file.
    """
    verdict, fit = certificate.verdict, certificate.verdict.after
    sigma = full_sigma(fit, verdict.fitted, verdict.noise)
    base = list(zip(fit.model.names, fit.parameters, sigma, strict=True))[: plant_of(fit).base_count]
    return {
        "verdict": verdict.verdict,
        "intervals_hold": certificate.holds,
        "doubt": doubt(certificate),
        "conditions": conditions(certificate),
        "effects": [e.id for e in effects_of(fit)],
        "recordings": list(dict.fromkeys(r.name for r in verdict.fitted)),
        "noise_deg": float(np.degrees(verdict.noise.sigma)),
        "lamp": certificate.clock.lamp,
        "model": {name: {"value": value, "sigma": s} for name, value, s in base},
        "quantities": [_quantity_as_dict(one, certificate) for one in certificate.quantities],
    }


def command_gain(certificate: Certificate) -> float | None:
    """Return c, 1/s², which converts torques per inertia to degrees of command; ``None`` without a command."""
    fit = certificate.verdict.after
    return float(fit.parameters[2]) if plant_of(fit).driven and fit.parameters[2] > 0.0 else None


def what_to_play(one: Certified) -> str | None:
    """Return the recording that would determine a quantity, in words; ``None`` where these recordings do."""
    if one.state != "not_determined":
        return None
    if one.experiment is not None:
        return f"{one.experiment.description}, {one.experiment.duration:g} s"
    return effect(one.quantity.effect_id).separating_experiment


def _quantity_as_dict(one: Certified, certificate: Certificate) -> dict[str, Any]:
    quantity, play = one.quantity, what_to_play(one)
    certified = certificate.certifies(one)
    value = quantity.in_file(one.profile.estimate) if certified and one.profile is not None else math.nan
    low, high = quantity.interval_in_file(*one.interval) if certified else (-math.inf, math.inf)
    content: dict[str, Any] = {
        "id": quantity.id,
        "meaning": quantity.meaning,
        "effect": quantity.effect_id,
        "attributed": one.accepted,
        "state": one.state if certified else "not_certified",
        "statement": statement(one, certificate.clock.shared, certified),
        quantity.key: {"value": value, "interval_95": [low, high]},
    }
    gain = command_gain(certificate)
    if certified and quantity.is_torque and gain is not None:
        content["command_deg"] = {"value": value / gain, "interval_95": [low / gain, high / gain]}
    command = one.experiment.command if one.experiment else None
    return content | {
        "rivals": list(one.rivals),
        "aliases": aliases(one, certificate),
        "determined_by": play,
        "command_file": None if command is None else f"{quantity.id}{COMMAND_ENDING}",
    }
