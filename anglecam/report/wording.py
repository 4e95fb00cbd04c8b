"""The verdict in words, for the report page and the tables in the terminal."""

from __future__ import annotations

import numpy as np

from anglecam.data.rounding import with_uncertainty
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.loop.free_form.result import FreeForm
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import FACTORS, fitted_parameters


def sentence(verdict: Verdict) -> str:
    """Return the verdict as one sentence that a student understands."""
    before, after = (f"{np.degrees(p.rmse):.3g}°" for p in (verdict.before_held_out, verdict.after_held_out))
    on = predicted_frames(verdict)
    if verdict.verdict == "nothing_missing" and not verdict.first_test.passed:
        limit = (
            f"it is no larger than errors of the measurement can be; the uncertainty of its angles is "
            f"{np.degrees(verdict.noise.sigma):.3g}°"
            if verdict.noise.filmed
            else "it is no larger than numerical errors of models and files"
        )
        return (
            f"Nothing is missing that this measurement can show: the error of the model θ̈ = c·u − a·θ̇ − b·θ on {on} "
            f"({before}) is not noise alone, but {limit}."
        )
    if verdict.verdict == "nothing_missing":
        return (
            f"Nothing is missing: the error of the model θ̈ = c·u − a·θ̇ − b·θ on {on} ({before}) cannot be "
            f"distinguished from noise."
        )
    if verdict.verdict == "unexplained":
        return (
            f"Something is missing: the error of the model on {on} is {before}, and none of "
            f"the effects that anglecam knows explains it with sufficient evidence.{seat_in_words(verdict)}"
        )
    rest = "; what remains is more than noise, and no effect that anglecam knows explains it"
    first, *others = [_cause(a.effect, a.alias_set[1:], verdict.after) for a in verdict.accepted]
    causes = "; ".join([first, *(cause[0].lower() + cause[1:] for cause in others)])
    this = "this" if len(verdict.accepted) == 1 else "these"
    return (
        f"{causes}; with {this} in the model, its error on {on} falls from {before} to {after}"
        f"{rest if verdict.verdict == 'partly_explained' else ''}.{seat_in_words(verdict)}"
    )


def seat_in_words(verdict: Verdict) -> str:
    """Return where most of what remains sits, as a sentence; empty if nothing remains, or it is everywhere."""
    if not verdict.where:
        return ""
    most = verdict.where[0]
    start, stop = (f"{FACTORS[most.variable] * value:.3g}" for value in (most.start, most.stop))
    return (
        f" Of what remains {100 * min(1.0, most.share_of_excess):.0f} % is seen where the "
        f"{QUANTITIES[most.variable]} is {start} to {stop}{UNITS[most.variable]}."
    )


UNITS = {"angle": "°", "velocity": "°/s", "command": "°", "phase": "", "time": " s"}
QUANTITIES = {
    "angle": "angle",
    "velocity": "velocity",
    "command": "command",
    "phase": "phase within the command's period",
    "time": "time",
}
"""What a torque of free form can depend on, in words."""


def missing_torque(verdict: Verdict) -> str:
    """Return `free_form_sentence` of a verdict's torque; empty if it has none."""
    if verdict.free_form is None:
        return ""
    return free_form_sentence(verdict.free_form, bool(verdict.held_out), verdict.searched is not verdict.fitted)


def free_form_sentence(found: FreeForm, held_out: bool, stretches: bool) -> str:
    """Return what a torque of free form means, of what data its errors are, and the causes with such a shape.

    Parameters
    ----------
    found : FreeForm
        The torque.
    held_out : bool
        Whether recordings were held out; if not, its errors are those of cross-validation.
    stretches : bool
        Whether it was sought on stretches of long recordings.
    """
    over = " and on the ".join(QUANTITIES[name] for name in found.band.over)
    before, after = (f"{np.degrees(p.rmse):.3g}°" for p in (found.before, found.after))
    effects = ", ".join(plain(name) for name in found.resembles)
    causes = f"Effects with a similar shape: {effects}." if effects else "No known effect has such a shape."
    if held_out:
        on = "stretches of the held-out recordings" if stretches else "the held-out recordings"
    else:
        part = "stretches of " if stretches else ""
        on = f"blocks of {part}the recordings, each left out of the fit that predicts it,"
    whole = " The verdict's prediction error is another one: it is of all frames." if stretches else ""
    return (
        f"The model lacks a torque that depends on the {over}; with a smooth function of it, the error on {on} "
        f"falls from {before} to {after}.{whole} {causes}"
    )


def predicted_frames(verdict: Verdict) -> str:
    """Return on which frames the prediction error was computed."""
    if verdict.held_out:
        return "the held-out recordings"
    several = len({r.name for r in verdict.fitted}) > 1
    return f"blocks of the recording{'s' if several else ''} that it was not fitted to"


def free_run(verdict: Verdict) -> str:
    """Return how far the predictions run freely: through whole recordings, or through windows of them."""
    records = [*verdict.fitted, *verdict.held_out]
    return "free run through windows" if len({r.name for r in records}) < len(records) else "free run"


def noise_in_words(verdict: Verdict) -> str:
    """Return the size of the angle's noise, °, and its source, or that it is unknown."""
    size = f"{np.degrees(verdict.noise.sigma):.4f}"
    return f"{size} ({verdict.noise.source})" if verdict.noise.known else f"unknown; at most {size}, the residual"


def remaining_structure(verdict: Verdict) -> str:
    """Return why the structure that the final model leaves is not investigated further; empty if it leaves none."""
    test, limits = verdict.last_test, verdict.policy.stepwise
    if (
        verdict.verdict in ("unexplained", "partly_explained")
        or test.p_value >= verdict.policy.residual_test.false_alarm_rate
    ):
        return ""
    if test.passed:
        return f"not certain: p = {test.p_value:.3f}; only below {test.level:.2g} is a further effect searched"
    if verdict.noise.filmed and verdict.after.rmse <= limits.film_error_sigmas * verdict.noise.sigma:
        return "no larger than the angle's uncertainty; not investigated further"
    if not verdict.noise.known:
        return "significant; the noise is unknown, so its size cannot be judged"
    return "significant, but small against the error of the base model; no further effect explains it"


def plain(effect_id: str) -> str:
    """Return the name of an effect with spaces.

    Examples
    --------
    >>> plain("coulomb_friction")
    'Coulomb friction'
    """
    return effect_id.replace("_", " ").replace("coulomb", "Coulomb")


def describe(effect: Effect, verdict: Verdict) -> str:
    """Return the fitted parameters of an effect with their standard uncertainties, as text."""
    model = fitted_parameters(verdict)
    fitted = ((p.name, model[p.name]) for p in effect.parameters)
    return ", ".join(f"{name} = {with_uncertainty(one['value'], one['sigma'])}" for name, one in fitted)


def summary_of(effect: Effect, fit: Fit) -> str:
    """Return what an effect does with the sign that a fit gives its size."""
    size = effect.parameters[0]
    value = dict(zip(fit.model.names, fit.parameters, strict=True)).get(size.name, size.null)
    return effect.opposite if effect.opposite and value < size.null else effect.summary


def _cause(effect: Effect, others: tuple[str, ...], fit: Fit) -> str:
    """Return an effect's summary, whether it is the camera's, and its rivals."""
    cause = summary_of(effect, fit).removesuffix(".")
    if effect.station == "camera":
        cause += ", which is an effect of the camera and not of the mechanism"
    if others:
        *most, last = (plain(other) for other in others)
        either = f"{', '.join(most)} or {last}" if most else last
        cause += f" (or {either}, which these recordings cannot distinguish from it)"
    return cause
