"""Thresholds of the search: which effects are fitted, which of them are compared, and when one is added."""

from __future__ import annotations

import math
from dataclasses import dataclass

from anglecam.loop.threshold import threshold


@dataclass(frozen=True)
class ScreenPolicy:
    """Which effects are fitted, by a linear forecast of what each would explain."""

    smallest_free_share: float = threshold(
        1e-6,
        "share of the change that an effect makes",
        "an effect is not considered if the parameters of the fit can follow all but this share of its change",
        "naming an effect that the base model can represent",
    )
    most_fitted: int = threshold(
        8,
        "effects",
        "largest number of effects that are fitted in one round, best forecasts first",
        "missing an effect because its forecast ranks low",
    )
    fewest_fitted: int = threshold(
        3,
        "effects",
        "this many effects are fitted in one round however small their forecasts are, and one fewer of them, the best, "
        "are cross-validated however small their gains are",
        "missing an effect because the linear forecast of it is too small",
    )
    smallest_forecast_share: float = threshold(
        0.2,
        "share of the best forecast",
        "an effect with a smaller forecast is not fitted, or if it is among the fewest, from one start only",
        "missing an effect because the linear forecast of it is too small",
    )


@dataclass(frozen=True)
class CandidatePolicy:
    """How candidates are fitted, and which effects cannot be distinguished from the best."""

    incomplete_fit_share: float = threshold(
        0.7,
        "share of the forecast log-likelihood gain",
        "a fit of one parameter that gains less is repeated from where the screen tried the effect and from the "
        "effect's first start",
        "missing an effect because its fit ended in a local minimum",
    )
    failed_fit_share: float = threshold(
        0.2,
        "share of the forecast log-likelihood gain",
        "a fit that gains less is repeated from half and from twice the forecast parameters",
        "missing an effect because its fit ended in a local minimum",
    )
    smallest_gain_share: float = threshold(
        0.2,
        "share of the best log-likelihood gain",
        "a candidate that gains less on the fitted recordings is not cross-validated",
        "missing an effect that fits worse than another one and predicts better",
    )
    linear_size_sigmas: float = threshold(
        2.0,
        "standard uncertainties",
        "a size further from zero counts as determined; of others the profile likelihood is evaluated",
        "naming an effect whose size the recordings do not determine, because another one has the shape of its limit",
        "not calibrated; the usual 95 %",
    )
    false_size_limit_rate: float = threshold(
        0.05,
        "probability",
        "p-value of the likelihood ratio below which a size ten times as large is rejected",
        "naming an effect whose size the recordings do not determine, because another one has the shape of its limit",
        "not calibrated; the usual 95 % limit of a profile likelihood",
    )
    false_staged_parameter_rate: float = threshold(
        0.01,
        "probability",
        "p-value of the likelihood ratio below which a staged parameter of an effect is added",
        "how often noise alone adds a staged parameter, such as the breakaway torque of dry friction",
    )
    slow_speed_share: float = threshold(
        0.2,
        "share of the fastest speed in the recordings",
        "upper bound of parameters that are speeds, such as the Stribeck speed of dry friction",
        "a friction curve over all speeds that takes the place of another effect of speed",
        "set with the EMPS drive in view: at 0.5 the friction curve took the place of asymmetric damping",
    )
    true_rival_rejection_rate: float = threshold(
        0.05,
        "probability",
        "an effect stays in the alias set unless the best one is so much more likely that this would be as improbable "
        "if the other effect were true",
        "how often the true effect is missing from the alias set of another one",
        "the usual 5 %; measured on 347 sessions in which one effect as large as the noise acts and one is named: 342 "
        "alias sets hold it",
    )


@dataclass(frozen=True)
class CrossValidationPolicy:
    """How recordings are predicted by models that were not fitted to them, and when a prediction is better."""

    folds: int = threshold(
        5,
        "folds",
        "every fifth block of a recording is left out at a time",
        "overfitting: an effect is judged on frames that its model was not fitted to",
    )
    period_s: float = threshold(
        0.27,
        "s",
        "unit of the lengths below: the natural period of the base model, 2π over the magnitude of its slower pole, at "
        "most a twentieth of the longest recording",
        "nothing by itself; the search sets it from the base model",
        "0.27 s is the natural period of the paper's neck",
    )
    left_out_periods: float = threshold(
        0.3,
        "natural periods",
        "length of a block that is left out",
        "missing an effect that acts briefly, because a longer block holds everything that determines it",
        "set on four sessions in which a limit or a loss of torque acts once or twice: all predict better with blocks "
        "of 0.2 to 0.4 periods, one to three of them with 0.5 to 1.3",
    )
    independence_periods: float = threshold(
        2.0,
        "natural periods",
        "prediction errors further apart than this count as independent in the bootstrap of the gain",
        "coverage of the gain's interval: with shorter blocks correlated errors would count several times",
    )
    noise_correlation_times: float = threshold(
        2.0,
        "correlation times of the noise",
        "neither length is below this; the noise correlates by 1/e over one correlation time",
        "accepting an effect whose fit follows the noise of frames beside those that are left out, and coverage of the "
        "gain's interval",
        "two correlation times apart AR(1) noise correlates by 0.14; set with the film of a ball in view (φ = 0.94): "
        "with shorter blocks a misplaced pivot and drag were named as well",
    )
    outlier_sigmas: float = threshold(
        4.0,
        "robust standard deviations of the earlier model's prediction errors",
        "larger prediction errors count as this when it is decided whether an effect predicts better",
        "missing an effect because a few left-out frames hold everything that determines a parameter",
        "normal noise exceeds it in 1 of 16,000 frames; set with one session of a speed-dependent torque in view",
    )
    false_gain_rate: float = threshold(
        0.025,
        "probability",
        "an effect is accepted only if this quantile of the bootstrapped gain is above zero",
        "how often an effect that predicts no better is accepted",
        "not calibrated; the lower end of the 95 % interval in held_out_gain",
    )

    @property
    def left_out_s(self) -> float:
        """Length of a block that is left out, s."""
        return self.left_out_periods * self.period_s

    @property
    def independence_s(self) -> float:
        """Prediction errors further apart than this count as independent, s."""
        return self.independence_periods * self.period_s


@dataclass(frozen=True)
class StepwisePolicy:
    """When an effect is added, when the search stops, and on how many samples it works."""

    most_samples: int = threshold(
        4000,
        "samples",
        "the search works on stretches of the fitted and of the held-out recordings of about this many samples each; "
        "the model that it finds is fitted to all samples",
        "missing an effect that only a longer recording shows",
        "not calibrated; the blind sessions have 1,200 samples",
    )
    most_effects: int = threshold(
        3,
        "effects",
        "largest number of effects in the model",
        "overfitting by a sum of many effects",
    )
    film_error_sigmas: float = threshold(
        2.0,
        "stated standard uncertainties of a film's angle",
        "in a film, smaller structure (RMS) is neither searched further, nor called unexplained, nor listed as "
        "detectable",
        "how often errors of the measurement that follow the motion are taken for structure",
        "set with films 0007, 0013 and 0015 in view",
    )
    film_error_first_sigmas: float = threshold(
        1.0,
        "stated standard uncertainties of a film's angle",
        "in a film, the first effect must reduce the prediction error by at least this (RMS)",
        "how often an effect is named where only errors of the measurement act",
        "at 0.5 one of nine films in which nothing acts was called pivot_offset; at 2, the value before, two lenses "
        "were missed",
    )
    film_common_error_first_sigmas: float = threshold(
        2.0,
        "times the part of a film's stated uncertainty that does not scatter from frame to frame",
        "in a film, the first effect must also reduce the prediction error by at least this (RMS), because only that "
        "part can follow the motion as an effect does",
        "how often an effect is named where only errors of the measurement act",
        "set together with film_error_first_sigmas",
    )
    rounding_error_share: float = threshold(
        0.5,
        "share of the standard deviation of a rounding error",
        "part of a quantised angle's rounding error that may follow the motion; it takes the place of a film's stated "
        "uncertainty in film_error_sigmas and film_error_first_sigmas",
        "how often rounding errors are taken for structure: at rest they are constant, and no draw repeats them",
        "without it 28 of 100 sessions in which nothing is missing were unexplained or named an effect (seeds 100 to "
        "199); a residual below 1.12 standard deviations is now never structure",
    )
    alias_evidence_nat: float = threshold(
        5.0,
        "nat",
        "in a film, evidence above which the better of two effects is preferred although their predictions differ by "
        "less than the angle's uncertainty; below it the one with fewer parameters is named",
        "naming the wrong one of two effects because of errors that follow the motion",
        "set with films 0007, 0013 and 0015 in view, as 10 nat on fitted and predicted frames together",
    )
    better_minimum_nat: float = threshold(
        1.0,
        "nat",
        "gain by which a better fit of the same model makes its residual worth testing again",
        "taking a local minimum of the fit for structure that the model lacks",
    )
    model_error_share: float = threshold(
        0.005,
        "share of the base model's cross-validated RMS error",
        "smaller structure (RMS) is not searched, because no model of an effect is more accurate",
        "naming the approximation error of an effect's model as a further effect",
        "set with EMPS and a pendulum in view: at 0.01 the pendulum's drag is missed",
    )
    numerical_error_rad: float = threshold(
        math.radians(1e-3),
        "rad",
        "smaller structure (RMS) is not searched, because forward models and files are not much more accurate",
        "naming a numerical error as an effect",
    )
    noise_models: int = threshold(
        2,
        "effects",
        "best forecasts that are fitted to estimate the AR(1) coefficient of the noise from the best residual",
        "an AR(1) coefficient that is too large because structure is taken for correlated noise",
    )
    noise_floor_phi_errors: float = threshold(
        1.645,
        "standard errors",
        "the AR(1) coefficient may exceed that of the noise floor by this much",
        "an AR(1) coefficient that is too large because structure is taken for correlated noise",
        "not calibrated; the one-sided 95 % limit of a normal variable",
    )
