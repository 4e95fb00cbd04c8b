"""How often the loop is right: verdicts over many sessions of series with a known hidden effect.

Truth is integrated by the tests' own event-based plant. The size of each effect is set so that what the base model
leaves over without noise is as large as the noise (ratio 1), or a quarter of it.

    PYTHONPATH=tests .venv/bin/python benchmarks/verdicts.py [sessions a case]
"""

from __future__ import annotations

import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from multiprocessing import get_context

import numpy as np
from scipy.optimize import brentq

from anglecam.estimate.output_error import fit_output_error
from anglecam.estimate.start import start_parameters
from anglecam.loop.close import close_records
from anglecam.simulate.plant import Plant
from support.motion import Plant as TruePlant
from support.series import session

SIGMA_DEG = 0.05
SIZES = {"dead_time_s": (1e-5, 0.05), "coulomb": (1e-3, 20.0), "quadratic_drag": (1e-3, 20.0)}
CASES = [
    ("nothing, white noise", None, 0.0, 0.0),
    ("nothing, AR(1) 0.6", None, 0.0, 0.6),
    *((f"{name}, residual/noise {ratio:g}", name, ratio, 0.0) for name in SIZES for ratio in (1.0, 0.25)),
    ("periodic disturbance (not in the ledger)", "periodic", 1.0, 0.0),
]


@cache
def size_for(name: str, ratio: float) -> float:
    """Return the effect's size at which the base model's noise-free residual is ``ratio`` times the noise."""

    def excess(size: float) -> float:
        records = session(TruePlant(**{name: size}), 0, sigma_deg=0.0)
        fit = fit_output_error(Plant(), records, start_parameters(records))
        return float(np.degrees(fit.rmse)) - ratio * SIGMA_DEG

    return brentq(excess, *SIZES[name], xtol=1e-6)


def verdict(case: tuple[str, str | None, float, float], seed: int) -> str:
    """Close the loop on one session and say what it named."""
    _, name, ratio, phi = case
    if name in SIZES:
        records = session(TruePlant(**{name: size_for(name, ratio)}), seed, sigma_deg=SIGMA_DEG)
    else:
        records = session(TruePlant(), seed, sigma_deg=SIGMA_DEG, phi=phi)
    if name == "periodic":
        amplitude = np.sqrt(2.0) * ratio * np.radians(SIGMA_DEG)
        records = [replace(r, angle=r.angle + amplitude * np.sin(2 * np.pi * 1.7 * r.time)) for r in records]
    found = close_records(records, held_out=["random"], seed=seed)
    return "+".join(a.effect.id for a in found.accepted) or found.verdict


def main() -> None:
    sessions = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    print("| case | sessions | verdicts |\n| --- | --- | --- |")
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for case in CASES:
            counts = Counter(pool.map(verdict, [case] * sessions, range(sessions)))
            print(f"| {case[0]} | {sessions} | {', '.join(f'{k} {v}' for k, v in counts.most_common())} |", flush=True)


if __name__ == "__main__":
    main()
