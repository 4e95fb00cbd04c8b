"""The ledger of effects: every module of this package that defines ``EFFECT`` is an entry. To add one, add a file."""

from __future__ import annotations

import importlib
import pkgutil

from anglecam.effects.effect import Effect, Knots, Parameter

__all__ = ["LEDGER", "Effect", "Knots", "Parameter", "effect"]


def _collect() -> tuple[Effect, ...]:
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return tuple(sorted((m.EFFECT for m in modules if hasattr(m, "EFFECT")), key=lambda e: e.id))


LEDGER: tuple[Effect, ...] = _collect()
"""All effects in the order of their ids."""


def effect(effect_id: str) -> Effect:
    """Return the ledger's entry of that id; `KeyError` if there is none."""
    return {e.id: e for e in LEDGER}[effect_id]
