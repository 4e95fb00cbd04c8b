"""The registry of estimators: every module of this package that defines ``ESTIMATOR`` is an entry.

To add an estimator, add a file. `identify_records`, the command line and its help read their choices from `ESTIMATORS`.
The help must appear at once, so a module imports what fits when it fits.
"""

from __future__ import annotations

import importlib
import pkgutil

from anglecam.identification.estimators.estimator import Estimate, Estimator

__all__ = ["ESTIMATORS", "Estimate", "Estimator"]


def _collect() -> dict[str, Estimator]:
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    found = (m.ESTIMATOR for m in modules if hasattr(m, "ESTIMATOR"))
    return {entry.id: entry for entry in sorted(found, key=lambda entry: entry.id)}


ESTIMATORS: dict[str, Estimator] = _collect()
"""All estimators by id, in the order of their ids."""
