"""The content of ``loop.json``, and the experiment that a verdict proposes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anglecam.data.record import Record
from anglecam.effects import Effect, Parameter, effect
from anglecam.identification.backbone import Backbone, backbones
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.loop.candidates import Candidate
from anglecam.loop.cross_validation import predict_held_out
from anglecam.loop.free_form.result import FreeForm
from anglecam.loop.next_experiment.design import Experiment, separating_experiment, write_command
from anglecam.loop.seat import Seat
from anglecam.loop.verdict import Verdict

DEGREE = float(np.degrees(1.0))
MODEL_NAMES = ("a_per_s", "b_per_s2", "c_per_s2")
KEYS = {
    "angle": "angle_deg",
    "velocity": "velocity_deg_per_s",
    "command": "command_deg",
    "phase": "phase",
    "time": "time_s",
}
"""Keys of the quantities that a torque of free form can depend on."""
FACTORS = {"angle": DEGREE, "velocity": DEGREE, "command": DEGREE, "phase": 1.0, "time": 1.0}
NEXT_COMMAND = "next.command.csv"


def next_experiment(verdict: Verdict) -> Experiment | None:
    """Choose the recording that best distinguishes the added effects from their rivals.

    Parameters
    ----------
    verdict : Verdict
        From `anglecam.loop.close.close_records`.

    Returns
    -------
    Experiment or None
        One experiment for all alias sets; ``None`` if each contains one effect only.
    """
    rivals = [fit for accepted in verdict.accepted for fit in accepted.rivals.values()]
    return separating_experiment([verdict.after, *rivals], verdict.fitted, verdict.noise, verdict.policy)


def write_next_command(experiment: Experiment | None, folder: Path) -> None:
    """Write the command to play next as ``next.command.csv``; if no command separates any pair, delete an old one."""
    path = folder / NEXT_COMMAND
    if experiment is None or experiment.command is None or not experiment.separated:
        path.unlink(missing_ok=True)
    else:
        write_command(experiment.command, path)


def verdict_as_dict(verdict: Verdict, experiment: Experiment | None = None) -> dict[str, Any]:
    """Return the content of ``loop.json``, in the units that its keys name.

    Parameters
    ----------
    verdict : Verdict
        From `anglecam.loop.close.close_records`.
    experiment : Experiment, optional
        From `next_experiment`.

    Returns
    -------
    dict
        Candidates that the loop did not cross-validate are predicted here, so that each has its held-out error.
    """
    model = fitted_parameters(verdict)
    named = {name for accepted in verdict.accepted for name in accepted.alias_set}
    return {
        "verdict": verdict.verdict,
        "effects": [
            {
                "id": accepted.effect.id,
                "parameters": {
                    p.name: model[p.name] | {"null": p.in_file_unit(p.null)[0]} for p in accepted.effect.parameters
                },
                "size": {
                    "parameter": accepted.effect.parameters[0].name,
                    "interval_95": list(accepted.effect.parameters[0].interval_in_file_unit(*accepted.interval_95)),
                },
                "fixed": _fixed(accepted.effect),
                "relaxes": accepted.effect.relaxes,
                "alias_set": list(accepted.alias_set),
                "explains": accepted.explains,
                "stopped_by": verdict.stopped_by if accepted is verdict.accepted[-1] else None,
                "separating_experiment": _what_to_film(accepted.effect, experiment if accepted.rivals else None),
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
        "noise": {
            "source": verdict.noise.source,
            "known": verdict.noise.known,
            "sigma_deg": np.degrees(verdict.noise.sigma),
            "correlation": verdict.after.phi,
        },
        "held_out_gain": {"ratio": verdict.gain.ratio, "interval_95": list(verdict.gain.interval_95)},
        "held_out": list(dict.fromkeys(r.name for r in verdict.held_out)),
        "samples": {"fitted": _samples(verdict.fitted), "searched": _samples(verdict.searched)},
        "p_value": verdict.first_test.p_value,
        "p_value_after": verdict.last_test.p_value,
        "model": {name: model[name] for name in MODEL_NAMES if name in model},
        "detectable": [
            {"id": name, "smallest": size_of(name).in_file_unit(smallest)[0], "unit": size_of(name).unit}
            for name, smallest in verdict.last_test.detectable.items()
            if name not in named
        ],
        "candidates": [
            {
                "id": c.effect.id,
                "log_likelihood_gain": c.log_likelihood_gain,
                "held_out_rmse_deg": np.degrees(_held_out_error(c, verdict)),
            }
            for c in verdict.candidates
        ],
        "where": [seat_as_dict(one) for one in verdict.where],
        "swings": [swing_as_dict(one) for one in backbones([*verdict.fitted, *verdict.held_out])],
        "free_form": None if verdict.free_form is None else free_form_as_dict(verdict.free_form),
        "policy": verdict.policy.as_list(),
    }


def seat_as_dict(seat: Seat) -> dict[str, Any]:
    """Return a region in which the residual is larger than elsewhere, as ``loop.json`` holds it."""
    factor = FACTORS[seat.variable]
    return {
        "variable": KEYS[seat.variable],
        "from": factor * seat.start,
        "to": factor * seat.stop,
        "share_of_excess": seat.share_of_excess,
        "q_value": seat.q_value,
    }


def swing_as_dict(swing: Backbone) -> dict[str, Any]:
    """Return the cycles of a free swing as ``loop.json`` holds them."""
    columns = {
        "time_s": swing.time,
        "amplitude_deg": np.degrees(swing.amplitude),
        "amplitude_sigma_deg": np.degrees(swing.amplitude_sigma),
        "period_s": swing.period,
        "period_sigma_s": swing.period_sigma,
        "decay_per_s": swing.decay,
        "decay_sigma_per_s": swing.decay_sigma,
    }
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return {"recording": swing.name, "cycles": [dict(zip(columns, row, strict=True)) for row in rows]}


def free_form_as_dict(found: FreeForm) -> dict[str, Any]:
    """Return a torque of free form as ``loop.json`` holds it."""
    band = found.band
    columns = [x * FACTORS[name] for name, x in zip(band.over, band.points, strict=True)]
    keys = [*(KEYS[name] for name in band.over), "acceleration_deg_per_s2", "sigma", "visited"]
    columns += [np.degrees(band.acceleration), np.degrees(band.sigma), band.visited]
    return {
        "over": list(band.over),
        "rmse_deg": {"before": np.degrees(found.before.rmse), "after": np.degrees(found.after.rmse)},
        "gain": {"ratio": found.gain.ratio, "interval_95": list(found.gain.interval_95)},
        "curve": [dict(zip(keys, row, strict=True)) for row in np.column_stack(columns).tolist()],
        "resembles": [{"id": name, "similarity": value} for name, value in found.resembles.items()],
    }


def _samples(records: Sequence[Record]) -> int:
    return sum(len(record.time) for record in records)


def _fixed(found: Effect) -> dict[str, float]:
    """Return the parameters that were not fitted, such as a declared direction, in the units of their names."""
    whole = effect(found.id).parameters
    return {whole[place].name: whole[place].in_file_unit(value)[0] for place, value in found.fixed}


def size_of(effect_id: str) -> Parameter:
    """Return the parameter that states the size of an effect."""
    return effect(effect_id).parameters[0]


def _what_to_film(effect: Effect, experiment: Experiment | None) -> str:
    if experiment is None or not experiment.separated:
        return effect.separating_experiment
    file = "" if experiment.command is None else f" ({NEXT_COMMAND})"
    return (
        f"{effect.separating_experiment}; fastest on this rig: {experiment.description}, "
        f"{experiment.duration:g} s{file}"
    )


def _held_out_error(candidate: Candidate, verdict: Verdict) -> float:
    """Return a candidate's RMS error on held-out data, rad, also if the loop did not cross-validate it."""
    if candidate.held_out is not None:
        return candidate.held_out.rmse
    if verdict.searched_held_out:
        return predict_output_error(candidate.fit, verdict.searched_held_out).rmse
    fit = candidate.fit
    if len(fit.nuisance) != len(verdict.searched):  # it was fitted in windows, which later effects made needless
        fit = fit_output_error(fit.model, verdict.searched, [fit.parameters], phi=fit.phi)
    return predict_held_out(fit, verdict.searched, (), verdict.policy)[0].rmse


def fitted_parameters(verdict: Verdict) -> dict[str, dict[str, float]]:
    """Return each parameter of the final model by name: ``value`` and ``sigma``, in the unit that its name states."""
    return verdict.parameters
