"""Every decision threshold of the loop: what it is, which error it controls, and how its value was set.

A threshold belongs here if another value could change a verdict, an alias set or the experiment that is proposed.
`Policy` is passed to `anglecam.loop.close.close_records`, and ``loop.json`` lists every threshold under ``policy``.
"Not calibrated" means that no record exists of how the value was chosen or tested. "Films 0007, 0013 and 0015" are
cases of ``tests/blind``, and the error rates are those of ``benchmarks/README.md``.

Settings of algorithms that decide nothing stay where they are used: numbers of bootstrap draws and of lags
(`noise_draws`, `structure_p_values`, `cross_validation`), starts of a fit (`screen.START_SHARES`,
`fit_effect.STAGED_STARTS`), knots and substeps (`torque_basis`), window lengths of the residual torque
(`residual_torque`), fixed-point rounds (`camera_correction`), tolerances against rounding, and the family of commands
(`next_experiment.commands`).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from typing import Any

from anglecam.loop.search_policy import CandidatePolicy, CrossValidationPolicy, ScreenPolicy, StepwisePolicy
from anglecam.loop.verdict_policy import FreeFormPolicy, NextExperimentPolicy, ResidualTestPolicy, VerdictPolicy


@dataclass(frozen=True)
class Policy:
    """All thresholds, grouped by the step of the loop that uses them."""

    residual_test: ResidualTestPolicy = field(default_factory=ResidualTestPolicy)
    screen: ScreenPolicy = field(default_factory=ScreenPolicy)
    candidates: CandidatePolicy = field(default_factory=CandidatePolicy)
    cross_validation: CrossValidationPolicy = field(default_factory=CrossValidationPolicy)
    stepwise: StepwisePolicy = field(default_factory=StepwisePolicy)
    verdict: VerdictPolicy = field(default_factory=VerdictPolicy)
    free_form: FreeFormPolicy = field(default_factory=FreeFormPolicy)
    next_experiment: NextExperimentPolicy = field(default_factory=NextExperimentPolicy)

    def level(self, effects: int) -> float:
        """Return the p-value below which structure is significant in a round of the search.

        Parameters
        ----------
        effects : int
            Number of effects that the model of this round has.

        Returns
        -------
        float
            The round's part of the false-alarm budget.

        Examples
        --------
        >>> [round(Policy().level(effects), 4) for effects in range(4)]
        [0.04, 0.0033, 0.0033, 0.0033]
        """
        budget, first = self.residual_test.false_alarm_rate, self.residual_test.first_round_share
        return budget * first if effects == 0 else budget * (1.0 - first) / self.stepwise.most_effects

    def as_list(self) -> list[dict[str, Any]]:
        """Return one dict for each threshold, as ``loop.json`` lists it.

        Examples
        --------
        >>> Policy().as_list()[0]["name"]
        'residual_test.false_alarm_rate'
        >>> Policy(residual_test=ResidualTestPolicy(false_alarm_rate=0.01)).as_list()[0]["value"]
        0.01
        """
        return [
            {"name": f"{group.name}.{one.name}", "value": values[one.name], **one.metadata}
            for group in fields(self)
            for values in [asdict(getattr(self, group.name))]
            for one in fields(getattr(self, group.name))
        ]


DEFAULT = Policy()
"""The thresholds that the benchmarks were measured with."""
