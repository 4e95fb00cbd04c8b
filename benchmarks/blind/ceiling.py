"""Upper limit of any method's success rate: the distance from the acting effect to the nearest other effect.

    .venv/bin/python -m benchmarks.blind.ceiling [--seeds 5] [--cases NAME,NAME…]

A session of `benchmarks.blind.attribution` is made without noise, and every other effect of the ledger is fitted to it.
The residual of the best fit is the distance d between the two effects, in standard deviations of the noise over all
fitted frames. Given these two effects to choose from, the optimal decision, by the larger likelihood, is right with
probability Φ(d/2) (Neyman, Pearson, Phil. Trans. R. Soc. A 231, 1933). A choice among all effects is right less often,
so a loop near this limit is practically optimal.
"""

from __future__ import annotations

import statistics
from collections import defaultdict
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import norm

from anglecam.identification.output_error import fit_output_error
from anglecam.loop.candidates import promising
from anglecam.loop.cross_validation import split_records
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.loop.stepwise import applicable
from anglecam.models.plant import Plant
from benchmarks.blind.attribution import CASES, SIGMA_DEG
from benchmarks.blind.drawn import draw
from benchmarks.blind.sessions import HELD_OUT, scaled, session, spec_of


def nearest(name: str, seed: int) -> tuple[str, float]:
    """Return the effect nearest to the acting effect of a case, and d."""
    case = CASES[name]
    (acting,) = case.effects
    effects = scaled(draw(acting, seed), seed, case.ratio, sigma_deg=SIGMA_DEG)
    records = session(effects, seed=seed, sigma_deg=0.0)
    fitted, _ = split_records(records, HELD_OUT)
    plant = spec_of(effects, seed=seed).plant
    base = fit_output_error(Plant(), fitted, [np.array([plant.a, plant.b, plant.c])])
    others = [e for e in applicable(records) if e.id != acting]
    tried = promising(forecasts(base, directions(base, fitted, changes(base, fitted, others))))
    fits = {one.effect.id: fit_with(base, fitted, one) for one in tried}
    rival = min(fits, key=lambda effect_id: fits[effect_id].cost)
    return rival, float(np.sqrt(fits[rival].cost) / np.radians(SIGMA_DEG))


def main(
    seeds: Annotated[int, typer.Option(help="Sessions per case, from seed 0 on.")] = 5,
    cases: Annotated[str, typer.Option(help="Comma-separated names of cases with one effect; all by default.")] = "",
) -> None:
    """Measure the distances and print the resulting limits."""
    names = cases.split(",") if cases else [name for name, case in CASES.items() if case.group.startswith("one effect")]
    found: dict[str, list[tuple[str, float]]] = defaultdict(list)
    console = Console(width=None if Console().is_terminal else 120)
    for seed in track(range(seeds), console=console):
        for name in names:
            try:
                one = nearest(name, seed)
            except ValueError as error:  # no size of the effect gives the residual
                console.print(f"{name}, seed {seed}: {error}")
            else:
                found[name].append(one)
    table = Table("case", "nearest", "d, median", "d, least", "right first at best", title="What noise allows")
    for name, pairs in found.items():
        d = [one for _, one in pairs]
        table.add_row(
            name,
            ", ".join(dict.fromkeys(rival for rival, _ in pairs)),
            f"{statistics.median(d):.1f}",
            f"{min(d):.1f}",
            f"{100 * statistics.mean(norm.cdf(one / 2) for one in d):.0f} %",
        )
    console.print(table)
    whole: dict[str, list[float]] = defaultdict(list)
    for name, pairs in found.items():
        whole[CASES[name].group] += [float(norm.cdf(one / 2)) for _, one in pairs]
    for group, shares in whole.items():
        console.print(f"{group}: {100 * statistics.mean(shares):.0f} % of {len(shares)} sessions")


if __name__ == "__main__":
    typer.run(main)
