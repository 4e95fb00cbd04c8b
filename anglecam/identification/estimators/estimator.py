"""What an entry of the registry declares: one way to get a model's parameters from recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from anglecam.data.record import Record
from anglecam.data.step_figures import StepFigures
from anglecam.data.typing import Floats

if TYPE_CHECKING:
    from anglecam.identification.fit import Fit
    from anglecam.neck.large_angle import LargeAngleNeck


@dataclass(frozen=True)
class Estimate:
    """What an estimator returns."""

    free_run: Fit
    """The model with the estimated parameters, run freely on the fitted recordings."""
    parameters: Floats
    """(p,) SI, in the order of ``free_run.model.names``."""
    covariance: Floats
    """(p, p) SI, of random errors only; NaN where they are not known."""
    optimum: Fit
    """Output-error fit whose sensitivities propagate systematic errors: where an estimator converges to the optimum of
    output error, a systematic error shifts its parameters as it shifts that optimum."""
    settled: bool = True
    """Whether an iteration ended where another step would change nothing."""


class FitFunction(Protocol):
    """Signature of the function that fits."""

    def __call__(
        self, second_order: Fit, records: Sequence[Record], start: Floats, neck: LargeAngleNeck | None
    ) -> Estimate:
        """Estimate a model's parameters.

        Parameters
        ----------
        second_order : Fit
            Output-error fit of θ̈ = c·u − a·θ̇ − b·θ to ``records``.
        records : sequence of Record
            Recordings to fit, at least one.
        start : (3,) or (2,) ndarray
            First starting values of that fit, a (1/s), b (1/s²) and, where any recording is driven, c (1/s²).
        neck : LargeAngleNeck or None
            Declared neck; ``None`` for the paper's, and for an estimator that takes none.
        """
        ...


@dataclass(frozen=True)
class Estimator:
    """One entry of the registry."""

    id: str
    """As in ``--estimator`` and ``model.json``."""
    summary: str
    """The method and the model, in one line."""
    fit: FitFunction
    step_response: Callable[[Fit], StepFigures]
    """Figures of the driven model's response to a unit step of the command."""
    takes_neck: bool = False
    """Whether a declared neck is part of the model."""


def optimum_estimate(fit: Fit, records: Sequence[Record]) -> Estimate:
    """Return the estimate of an output-error fit, its covariance for residuals that are AR(1) noise."""
    return Estimate(fit, fit.parameters, fit.autoregressive_covariance(records, fit.residual_phi), fit)
