"""The ledger of effects: every module of this package that defines ``EFFECT`` is an entry. To add one, add a file."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable

from anglecam.effects.effect import Effect, Knots, Parameter

__all__ = ["LEDGER", "Effect", "Knots", "Parameter", "effect", "ledger_of"]


def ledger_of(modules: Iterable[object]) -> tuple[Effect, ...]:
    """Return the effects that some modules define as ``EFFECT``, in the order of their ids."""
    return tuple(sorted((m.EFFECT for m in modules if hasattr(m, "EFFECT")), key=lambda e: e.id))


LEDGER: tuple[Effect, ...] = ledger_of(
    importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__)
)
"""All effects of this package, in the order of their ids."""


def effect(effect_id: str) -> Effect:
    """Return the ledger's entry of that id; `KeyError` if there is none."""
    return {e.id: e for e in LEDGER}[effect_id]
