"""Help of ``--estimator``: its choices come from the registry, which is loaded only when the help is shown."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand, TyperOption


class EstimatorCommand(TyperCommand):
    """A command whose option ``--estimator`` lists every estimator of the registry in its help."""

    def format_help(self, ctx: typer.Context, formatter: Any) -> None:  # type: ignore[override]
        """Write the help, the choices filled in."""
        from anglecam.identification.estimators import ESTIMATORS

        for option in self.params:
            if isinstance(option, TyperOption) and option.name == "estimator":
                option.help = "; ".join(f"{entry.id}: {entry.summary}" for entry in ESTIMATORS.values())
        super().format_help(ctx, formatter)
