"""The rows of the tables of ``report.html``: values as text, with their units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from anglecam.data.rounding import with_uncertainty
from anglecam.data.series import AngleSeries
from anglecam.effects import effect
from anglecam.effects.unit_names import split_unit, unit_on_screen
from anglecam.errors import printable
from anglecam.identification.identified import Identified
from anglecam.loop.refit import plant_of
from anglecam.loop.residual_test import StructureTest
from anglecam.loop.stepwise import applicable
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import size_of
from anglecam.report.wording import plain, summary_of

ESTIMATORS = {"ekf": "extended Kalman filter", "oe2": "output error"}
STATION_NOTES = {
    "command": "It acts on the command, before anything moves.",
    "actuator": "It acts between the command and the body, in servo and linkage.",
    "load": "It acts on the body.",
    "camera": "It is an effect of the camera, not of the mechanism: the body moves as the model predicts, but the film "
    "shows another angle or time.",
}
OPTIONAL_COLUMNS = {
    "sigma": "median σ, °",
    "bound": "worst case if the mark is off by 6 px, °",
    "lever": "lever arm, px",
}
"""Columns of the table of recordings that are shown only if they are not empty."""
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
TESTS = {
    "residual against angle": "residual as a function of the angle",
    "residual against velocity": "residual as a function of the velocity",
    "residual against command": "residual as a function of recent commands",
    "residual against time": "slow drift of the residual over time",
    "torque against angle": "torque as a function of the angle",
    "torque against velocity": "torque as a function of the velocity",
    "autocorrelation": "autocorrelation of the residual",
}
"""Names of the tests that need no effect, in words."""


def series_row(series: AngleSeries) -> dict[str, Any]:
    """List what was measured in a recording."""
    ok = series.ok
    degrees = np.degrees(series.angle[ok])
    lever = None
    if series.mark_px is not None and series.pivot_px is not None:
        lever = float(np.median(np.hypot(*(series.mark_px - series.pivot_px)[ok].T)))
    bound = series.bounds.get(6.0)
    return {
        "name": printable(series.name),
        "seconds": f"{series.time[-1] - series.time[0]:.1f}",
        "frames": len(ok),
        "measured": int(ok.sum()),
        "range": f"{degrees.min():.2f} … {degrees.max():.2f}".replace("-", "−"),
        "sigma": _text(
            np.degrees(np.nanmedian(series.sigma[ok])) if np.isfinite(series.sigma[ok]).any() else None, ".4f"
        ),
        "bound": _text(None if bound is None else np.degrees(np.nanmedian(bound[ok])), ".2f"),
        "lever": _text(lever, ".1f"),
    }


def model_row(model: Identified) -> dict[str, Any]:
    """List parameters and errors of a model."""
    known = np.isfinite(model.sigmas[:3])
    cells = [
        with_uncertainty(v, s) if k else f"{v:.4g}"
        for v, s, k in zip(model.values[:3], model.sigmas[:3], known, strict=True)
    ]
    cells += [""] * (3 - len(cells))
    held_out = None if model.held_out is None else np.degrees(model.held_out.rmse)
    return {
        "name": ESTIMATORS[model.estimator],
        "no_uncertainty": model.no_uncertainty,
        "cells": [*cells, f"{np.degrees(model.fit.rmse):.4f}", _text(held_out, ".4f")],
    }


def test_rows(tests: Sequence[StructureTest]) -> dict[str, list[dict[str, Any]]]:
    """Divide the tests into those that need no effect and those for one effect, smallest p-value first."""
    rows: dict[str, list[dict[str, Any]]] = {"any": [], "effect": []}
    for test in sorted(tests, key=lambda t: t.p_value):
        of_effect = test.name.startswith("effect ")
        name = plain(test.name.removeprefix("effect ")) if of_effect else TESTS[test.name]
        rows["effect" if of_effect else "any"].append({"name": name, "p_value": test.p_value})
    return rows


def candidate_rows(verdict: Verdict, result: dict[str, Any]) -> list[dict[str, Any]]:
    """List the candidates, strongest evidence first."""
    found = [a.effect.id for a in verdict.accepted]
    return [
        {
            "name": plain(c.effect.id),
            "found": c.effect.id in found,
            "station": c.effect.station,
            "gain": c.log_likelihood_gain,
            "predictive_gain": None if c.cross_validated is None else c.predictive_gain,
            "held_out": stated["held_out_rmse_deg"],
            "relaxes": c.effect.relaxes,
        }
        for c, stated in zip(verdict.candidates, result["candidates"], strict=True)
    ]


def interval_in_words(ends: Sequence[float], unit: str) -> str:
    """Return an interval as text; an end that the recordings do not set is left open.

    Examples
    --------
    >>> interval_in_words([0.02, 0.0415], " s")
    '0.02 to 0.0415 s'
    >>> interval_in_words([3.0, float("inf")], " °/s²")
    'above 3 °/s²'
    """
    low, high = ends
    if not np.isfinite(high):
        return f"above {low:.4g}{unit}" if np.isfinite(low) else "without ends"
    return f"{low:.4g} to {high:.4g}{unit}" if np.isfinite(low) else f"below {high:.4g}{unit}"


def effect_rows(verdict: Verdict, result: dict[str, Any]) -> list[dict[str, Any]]:
    """List the attributed effects with their parameters and rivals."""
    return [
        {
            "id": a.effect.id,
            "name": plain(a.effect.id),
            "summary": summary_of(a.effect, verdict.after),
            "equation": a.effect.equation,
            "fitted": [
                {
                    "symbol": parameter.symbol,
                    "name": split_unit(parameter.name)[0],
                    "value": with_uncertainty(stated["value"], stated["sigma"], unit_on_screen(parameter.name)),
                }
                for parameter, stated in zip(a.effect.parameters, shown["parameters"].values(), strict=True)
            ],
            "interval": interval_in_words(shown["size"]["interval_95"], unit_on_screen(shown["size"]["parameter"])),
            "left_out": [p.symbol for p in effect(a.effect.id).parameters[len(a.effect.parameters) :]],
            "relaxes": a.effect.relaxes,
            "station_note": STATION_NOTES[a.effect.station],
            "rivals": [
                {"name": plain(name), "summary": summary_of(effect(name), rival), "station": effect(name).station}
                for name, rival in a.rivals.items()
            ],
            "aliases": [plain(name) for name in a.effect.aliases],
            "experiment": a.effect.separating_experiment,
        }
        for a, shown in zip(verdict.accepted, result["effects"], strict=True)
    ]


def final_rows(verdict: Verdict, result: dict[str, Any]) -> list[dict[str, str]]:
    """List a, b and c of the final model."""
    count = plant_of(verdict.after).base_count
    return [
        {"name": split_unit(name)[0], "value": with_uncertainty(stated["value"], stated["sigma"], unit_on_screen(name))}
        for name, stated in list(result["model"].items())[:count]
    ]


def detectable_rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    """List the smallest size of each effect that would have been detected."""
    return [
        {
            "name": plain(d["id"]),
            "what": split_unit(size_of(d["id"]).name)[0],
            "least": "at most" if size_of(d["id"]).inverse else "at least",
            "size": _number(d["smallest"]),
            "unit": unit_on_screen(size_of(d["id"]).name),
        }
        for d in sorted(result["detectable"], key=lambda d: d["id"])
    ]


def undetectable(verdict: Verdict) -> list[str]:
    """Name the effects that the residual test would not have detected at any size that was tried."""
    detected = {*verdict.last_test.detectable, *(name for a in verdict.accepted for name in a.alias_set)}
    return [plain(e.id) for e in applicable([*verdict.fitted, *verdict.held_out]) if e.id not in detected]


def _number(value: float) -> str:
    """Return a number with three digits, and with a power of ten if it is very large or small."""
    mantissa, _, power = f"{float(f'{value:.3g}'):g}".partition("e")
    return mantissa + (f"·10{str(int(power)).translate(SUPERSCRIPT)}" if power else "")


def _text(value: float | None, form: str) -> str:
    return "" if value is None or np.isnan(value) else format(value, form)
