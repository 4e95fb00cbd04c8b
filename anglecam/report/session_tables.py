"""Tables for the terminal: models and verdicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from anglecam.data.rounding import with_uncertainty
from anglecam.identification.estimators import ESTIMATORS
from anglecam.identification.identified import Identified
from anglecam.loop.next_experiment.design import Experiment
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import NEXT_COMMAND
from anglecam.report.wording import describe, missing_torque, noise_in_words, remaining_structure, sentence


def model_table(models: Sequence[Identified]) -> Table:
    """Tabulate parameters and errors of models."""
    table = Table("estimator", "parameters", "fit, ° RMS", "held out, ° RMS")
    for model in models:
        parameters = zip(model.names, model.values, model.sigmas, strict=True)
        table.add_row(
            f"{model.estimator}: {ESTIMATORS[model.estimator].summary}",
            "\n".join(f"{name} = {_stated(value, sigma)}" for name, value, sigma in parameters),
            f"{np.degrees(model.fit.rmse):.4f}",
            "" if model.held_out is None else f"{np.degrees(model.held_out.rmse):.4f}",
        )
    return table


def _stated(value: float, sigma: float) -> str:
    return with_uncertainty(value, sigma) if np.isfinite(sigma) else f"{value:.4g}, no uncertainty"


def loop_table(verdict: Verdict, experiment: Experiment | None = None) -> Table:
    """Tabulate a verdict, its errors and the next recording."""
    table = Table("verdict", verdict.verdict.replace("_", " "), title=sentence(verdict), title_justify="left")
    for accepted in verdict.accepted:
        table.add_row(accepted.effect.id, describe(accepted.effect, verdict))
        if len(accepted.alias_set) > 1:
            table.add_row("cannot be distinguished from", ", ".join(accepted.alias_set[1:]))
    if experiment is not None and experiment.separated:
        file = "" if experiment.command is None else f": {NEXT_COMMAND}"
        table.add_row("record this next", f"{experiment.description}, {experiment.duration:g} s{file}")
    if verdict.free_form is not None:
        table.add_row("missing torque", missing_torque(verdict))
    before, after = np.degrees(verdict.before_held_out.rmse), np.degrees(verdict.after_held_out.rmse)
    table.add_row("prediction error, ° RMS", f"{before:.4f} before, {after:.4f} after")
    table.add_row("noise floor, ° RMS", noise_in_words(verdict))
    table.add_row("p-value of the base model's residual", f"{verdict.first_test.p_value:.3f}")
    if remains := remaining_structure(verdict):
        table.add_row("remaining structure", remains)
    return table
