"""Variants of a fitted plant: another AR(1) coefficient, a parameter held, without an effect, effects reordered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import fit_output_error
from anglecam.models.plant import Plant


def effects_of(fit: Fit) -> tuple[Effect, ...]:
    """Return the effects of a fitted plant, in the order in which they were added."""
    return plant_of(fit).effects


def effects_left(ledger: Sequence[Effect], fit: Fit) -> list[Effect]:
    """Return the effects of a ledger that a fitted plant does not have."""
    ids = [e.id for e in effects_of(fit)]
    return [e for e in ledger if e.id not in ids]


def refit_with_phi(fit: Fit, records: Sequence[Record], phi: float) -> Fit:
    """Fit again with the AR(1) coefficient ``phi`` of the noise."""
    return fit_output_error(fit.model, records, [fit.parameters], nuisance=fit.nuisance, phi=phi)


def refit_without(fit: Fit, effect: Effect, records: Sequence[Record]) -> Fit:
    """Fit again without one of the plant's effects."""
    removed = [p.name for p in effect.parameters]
    keep = [i for i, name in enumerate(fit.model.names) if name not in removed]
    smaller = replace(plant_of(fit), effects=tuple(e for e in effects_of(fit) if e is not effect))
    return fit_output_error(smaller, records, [fit.parameters[keep]], nuisance=fit.nuisance, phi=fit.phi)


def refit_with_last(fit: Fit, effect: Effect, records: Sequence[Record]) -> Fit:
    """Fit again with one of the effects in last place, where a candidate's parameters are."""
    last = [p.name for p in effect.parameters]
    order = sorted(range(len(fit.model.names)), key=lambda i: fit.model.names[i] in last)
    reordered = replace(plant_of(fit), effects=tuple(sorted(effects_of(fit), key=lambda e: e is effect)))
    return fit_output_error(reordered, records, [fit.parameters[order]], nuisance=fit.nuisance, phi=fit.phi)


def plant_of(fit: Fit) -> Plant:
    """Return the fitted plant, or raise `TypeError` if another model was fitted."""
    if not isinstance(fit.model, Plant):
        raise TypeError("only a Plant has effects")
    return fit.model


def fit_at(fit: Fit, name: str, value: float, records: Sequence[Record], near: Fit | None = None) -> Fit:
    """Fit a plant again with one parameter held at a value.

    Parameters
    ----------
    fit : Fit
        With the parameter among its parameters.
    name : str
        The parameter.
    value : float
        SI.
    records : sequence of Record
        The fitted recordings.
    near : Fit, optional
        A fit of this kind, with the parameter held at another value, to start from in place of ``fit``.

    Returns
    -------
    Fit
        Without the parameter.
    """
    plant, place = plant_of(fit), fit.model.names.index(name)
    held = replace(plant, effects=tuple(e.with_fixed({name: value}) for e in plant.effects))
    start = np.delete(fit.parameters, place) if near is None else near.parameters
    return fit_output_error(held, records, [start], nuisance=(near or fit).nuisance, phi=fit.phi)
