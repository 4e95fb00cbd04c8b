"""The verdict as ``loop.json`` holds it, and as one sentence."""

from __future__ import annotations

from typing import Any

import numpy as np

from anglecam.effects import Effect, Parameter, effect
from anglecam.loop.close import Verdict

MODEL_NAMES = ("a_per_s", "b_per_s2", "c_per_s2")


def verdict_as_dict(verdict: Verdict) -> dict[str, Any]:
    """Return the content of ``loop.json``, in the units that its keys name."""
    model = dict(zip(verdict.after.model.names, _values(verdict), strict=True))
    return {
        "verdict": verdict.verdict,
        "effects": [
            {
                "id": accepted.effect.id,
                "parameters": {
                    p.name: model[p.name] | {"null": p.null * p.to_file} for p in accepted.effect.parameters
                },
                "relaxes": accepted.effect.relaxes,
                "alias_set": list(accepted.alias_set),
                "separating_experiment": accepted.effect.separating_experiment,
            }
            for accepted in verdict.accepted
        ],
        "rmse_deg": {
            "before": {
                "fit": np.degrees(verdict.before.rmse),
                "held_out": np.degrees(verdict.before_held_out.rmse),
            },
            "after": {"fit": np.degrees(verdict.after.rmse), "held_out": np.degrees(verdict.after_held_out.rmse)},
            "noise_floor": np.degrees(verdict.noise.sigma),
        },
        "held_out_gain": {"ratio": verdict.gain.ratio, "interval_95": list(verdict.gain.interval_95)},
        "held_out": [r.name for r in verdict.held_out],
        "p_value": verdict.first_gate.p_value,
        "p_value_after": verdict.last_gate.p_value,
        "model": {name: model[name] for name in MODEL_NAMES if name in model},
        "detectable": [
            {"id": name, "smallest": smallest * _first(name).to_file, "unit": unit(_first(name).name)}
            for name, smallest in verdict.last_gate.detectable.items()
        ],
        "candidates": [
            {
                "id": c.effect.id,
                "log_likelihood_gain": c.log_likelihood_gain,
                "held_out_rmse_deg": np.degrees(c.prediction.rmse),
            }
            for c in verdict.candidates
        ],
    }


def sentence(verdict: Verdict) -> str:
    """Say the verdict so that a student understands it."""
    before, after = np.degrees(verdict.before_held_out.rmse), np.degrees(verdict.after_held_out.rmse)
    if verdict.verdict == "nothing_missing" and not verdict.first_gate.passed:
        return (
            f"Nothing is missing that this camera could show: what θ̈ = c·u − a·θ̇ − b·θ leaves over ({before:.3g}° on "
            f"recordings that it was not fitted to) is no larger than the camera's noise allows "
            f"({np.degrees(verdict.noise.sigma):.3g}°)."
        )
    if verdict.verdict == "nothing_missing":
        return (
            f"Nothing is missing: what θ̈ = c·u − a·θ̇ − b·θ leaves over ({before:.3g}° on recordings that it was not "
            f"fitted to) looks like the camera's noise and like nothing else."
        )
    if verdict.verdict == "unexplained":
        return (
            f"Something is missing (the model errs by {before:.3g}° on recordings that it was not fitted to), and none "
            f"of the effects that anglecam knows explains it."
        )
    causes = " ".join(a.effect.summary for a in verdict.accepted)
    return (
        f"{causes} With this in the model its error on recordings that it was not fitted to falls from {before:.3g}° "
        f"to {after:.3g}°."
    )


def describe(effect: Effect, verdict: Verdict) -> str:
    """Return an effect's fitted parameters with their standard uncertainties, as text."""
    model = dict(zip(verdict.after.model.names, _values(verdict), strict=True))
    return ", ".join(
        f"{p.name} = {model[p.name]['value']:.4g} ± {model[p.name]['sigma']:.2g}" for p in effect.parameters
    )


def unit(name: str) -> str:
    """Return the unit that a parameter's name ends in (``friction_deg_per_s2`` → ``deg/s2``)."""
    words = name.split("_")[1:]
    if words and words[0] == "per":
        return "1/" + words[1]
    return " ".join(words).replace(" per ", "/")


def _values(verdict: Verdict) -> list[dict[str, float]]:
    fit = verdict.after
    scale = fit.model.to_file
    return [
        {"value": float(v), "sigma": float(s)} for v, s in zip(fit.parameters * scale, fit.sigma * scale, strict=True)
    ]


def _first(effect_id: str) -> Parameter:
    return effect(effect_id).parameters[0]
