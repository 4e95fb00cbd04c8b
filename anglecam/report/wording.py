"""The verdict in words, for the report page and the tables in the terminal."""

from __future__ import annotations

import numpy as np

from anglecam.effects import Effect
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import fitted_parameters


def sentence(verdict: Verdict) -> str:
    """Say the verdict in one sentence that a student understands."""
    before, after = (f"{np.degrees(p.rmse):.3g}°" for p in (verdict.before_held_out, verdict.after_held_out))
    if verdict.verdict == "nothing_missing" and not verdict.first_test.passed:
        return (
            f"Nothing is missing that this camera could show: what θ̈ = c·u − a·θ̇ − b·θ leaves over ({before} on "
            f"recordings that it was not fitted to) is not noise alone, but no larger than errors of the measurement "
            f"itself may be, whose angles are uncertain by {np.degrees(verdict.noise.sigma):.3g}°."
        )
    if verdict.verdict == "nothing_missing":
        return (
            f"Nothing is missing: what θ̈ = c·u − a·θ̇ − b·θ leaves over ({before} on recordings that it was not "
            f"fitted to) looks like the camera's noise and like nothing else."
        )
    if verdict.verdict == "unexplained":
        return (
            f"Something is missing (the model errs by {before} on recordings that it was not fitted to), and none "
            f"of the effects that anglecam knows surely explains it."
        )
    first, *others = [_cause(a.effect, a.alias_set[1:]) for a in verdict.accepted]
    causes = "; ".join([first, *(cause[0].lower() + cause[1:] for cause in others)])
    this = "this" if len(verdict.accepted) == 1 else "these"
    return (
        f"{causes}; with {this} in the model its error on recordings that it was not fitted to falls from {before} "
        f"to {after}."
    )


def plain(effect_id: str) -> str:
    """Return an effect's name as it is spoken."""
    return effect_id.replace("_", " ").replace("coulomb", "Coulomb")


def describe(effect: Effect, verdict: Verdict) -> str:
    """Return an effect's fitted parameters with their standard uncertainties, as text."""
    model = fitted_parameters(verdict)
    fitted = ((p.name, model[p.name]) for p in effect.parameters)
    return ", ".join(f"{name} = {with_uncertainty(told['value'], told['sigma'])}" for name, told in fitted)


def with_uncertainty(value: float, sigma: float, unit: str = "") -> str:
    """Write a value to the second digit of its standard uncertainty, if it has one, and ``unit`` as it is behind it."""
    if not np.isfinite(value):
        return "none"
    if not 0.0 < sigma < np.inf:
        return f"{value:.4g}{unit} (not told by these recordings, or held by a bound of what is possible)"
    digits = int(np.clip(1 - np.floor(np.log10(sigma)), 0, 8))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}{unit}"


def _cause(effect: Effect, others: tuple[str, ...]) -> str:
    """Say what an effect is, whose doing, and what else it may be."""
    told = effect.summary.removesuffix(".")
    if effect.station == "camera":
        told += ", which is the camera's doing and not the mechanism's"
    if others:
        *most, last = (plain(other) for other in others)
        either = f"{', '.join(most)} or {last}" if most else last
        told += f" (or it is {either}, which these recordings cannot tell from it)"
    return told
