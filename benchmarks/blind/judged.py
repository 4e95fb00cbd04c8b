"""Compares verdicts with the truth and summarises many of them.

A judgement is one line of JSON, so that a long run can be stopped, resumed and summarised from a file.
"""

from __future__ import annotations

import json
import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from anglecam.identification.systematic import full_sigma
from anglecam.loop.verdict import Verdict
from benchmarks.blind.drawn import LEDGER, Keys
from benchmarks.blind.sessions import look
from synth.spec import Spec

Line = dict[str, Any]


def true_values(spec: Spec, effects: Mapping[str, Keys]) -> dict[str, float]:
    """Return the true first parameter of each effect of the ledger, in the unit of the loop's files."""
    seen = look(spec)
    lever = math.hypot(*seen.mouth)
    return {
        name: LEDGER[name].reported(dict(keys), seen.pinhole, lever) for name, keys in effects.items() if name in LEDGER
    }


def judge(verdict: Verdict, true: Collection[str], values: Mapping[str, float], sigma_deg: float) -> Line:
    """Compare a verdict with the truth.

    Parameters
    ----------
    verdict : Verdict
        The loop's verdict.
    true : collection of str
        Ids of the effects that act.
    values : mapping
        From `true_values`.
    sigma_deg : float
        Standard deviation of the noise.

    Returns
    -------
    dict
        The judgement, ready for JSON.
    """
    found = [accepted.effect.id for accepted in verdict.accepted]
    alias = set(found).union(*(accepted.alias_set for accepted in verdict.accepted))
    estimates = {}
    sigmas = full_sigma(verdict.after, verdict.fitted, verdict.noise)
    for accepted in verdict.accepted:
        name = accepted.effect.id
        if name not in values:
            continue
        first = accepted.effect.parameters[0]
        at = list(verdict.after.model.names).index(first.name)
        value, sigma = float(verdict.after.parameters[at]), float(sigmas[at])
        # in the fit's internal unit: the interval of a limit is that of its reciprocal
        truth = first.to_file / values[name] if first.inverse else values[name] / first.to_file
        estimates[name] = {
            "name": first.name,
            "true": values[name],
            "value": first.in_file_unit(value)[0],
            "off_sigmas": (value - truth) / sigma if sigma > 0.0 else None,
            "inside": accepted.interval_95[0] <= truth <= accepted.interval_95[1],
        }
    return {
        "true": sorted(true),
        "verdict": verdict.verdict,
        "p_value": verdict.first_test.p_value,
        "found": found,
        "strongest": verdict.candidates[0].effect.id if verdict.candidates else None,
        "alias_set": sorted(alias),
        "held_out_over_sigma": math.degrees(verdict.after_held_out.rmse) / sigma_deg,
        "estimates": estimates,
    }


def read_lines(path: Path) -> list[Line]:
    """Read judgements; an incomplete last line is skipped."""
    lines = []
    for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            lines.append(json.loads(text))
        except json.JSONDecodeError:
            continue
    return lines


def show(lines: Sequence[Line], group: Callable[[Line], str], console: Console) -> None:
    """Print the confusion matrix and the table of figures, by group in order of appearance."""
    failed = [line for line in lines if "error" in line]
    lines = [line for line in lines if "error" not in line]
    groups, cases = _gather(lines, group), _gather(lines, lambda line: line["case"])
    for title, members in groups.items():
        console.print(_confusion(title, members))
    console.print(_figures("Figures", groups))
    console.print(_figures("Case by case", cases))
    for line in failed:
        console.print(f"{line['case']}, seed {line['seed']}: {line['error']}", soft_wrap=True, markup=False)


def _gather(lines: Sequence[Line], group: Callable[[Line], str]) -> dict[str, list[Line]]:
    gathered: dict[str, list[Line]] = defaultdict(list)
    for line in lines:
        gathered[group(line)].append(line)
    return gathered


def _confusion(title: str, lines: Sequence[Line]) -> Table:
    """Count the named effects by the acting effect: ids by number, 0 for nothing missing, ? for unexplained."""
    ids = list(LEDGER)
    table = Table(
        "what acts", *map(str, range(1, len(ids) + 1)), "0", "?", title=title, title_justify="left", padding=0
    )
    rows: dict[str, Counter[str]] = defaultdict(Counter)
    for line in lines:
        row = " + ".join(line["true"]) or "nothing"
        rows[row].update(line["found"] or [line["verdict"]])
    for row in sorted(rows, key=lambda row: ids.index(row) if row in ids else len(ids)):
        label = f"{ids.index(row) + 1} {row}" if row in ids else row
        columns = [*ids, "nothing_missing", "unexplained"]
        table.add_row(label, *(f"{rows[row][column] or '·'} " for column in columns))
    return table


def _figures(title: str, groups: Mapping[str, Sequence[Line]]) -> Table:
    table = Table(
        "", "sessions", "right first", "exactly right", "in alias set", "its size", "wrong name", "nothing missing",
        "unexplained", "held-out RMS/σ", "within 95 %", "s each", title=title, title_justify="left",
    )  # fmt: skip
    for name, lines in groups.items():
        table.add_row(name, *_figures_of(lines))
    return table


def _figures_of(lines: Sequence[Line]) -> list[str]:
    named = [line for line in lines if line["found"]]
    something = [line for line in lines if line["true"]]
    inside = [estimate["inside"] for line in lines for estimate in line["estimates"].values()]
    return [
        str(len(lines)),
        _share([bool(line["found"]) and line["found"][0] in line["true"] for line in something]),
        _share([exactly(line) for line in lines]),
        _share([set(line["true"]) <= set(line["alias_set"]) for line in named if line["true"]]),
        f"{statistics.mean(len(line['alias_set']) for line in named):.1f}" if named else "–",
        _share([bool(set(line["found"]) - set(line["true"])) for line in lines]),
        _share([line["verdict"] == "nothing_missing" for line in lines]),
        _share([line["verdict"] == "unexplained" for line in lines]),
        f"{statistics.median(line['held_out_over_sigma'] for line in lines):.2f}",
        _share(inside),
        f"{statistics.median(line['seconds'] for line in lines):.0f}",
    ]


def exactly(line: Line) -> bool:
    """Return whether the verdict is exactly right: the right names, or none if none is right."""
    if not line["true"]:
        return line["verdict"] == "nothing_missing"
    if not set(line["true"]) <= set(LEDGER):
        return line["verdict"] == "unexplained"
    return line["verdict"] == "attributed" and set(line["found"]) == set(line["true"])


def _share(hits: Sequence[bool]) -> str:
    return f"{sum(hits)}/{len(hits)}" if hits else "–"
