"""Finds the term that θ̈ = c·u − a·θ̇ − b·θ lacks with PySINDy, from the same angle series as anglecam's loop.

    python3 -m venv build/pysindy
    build/pysindy/bin/pip install -e . -r benchmarks/pysindy-requirements.txt
    build/pysindy/bin/python -m benchmarks.pysindy_peer [--seeds 5] [--only pysindy|anglecam] [case ...]

A session is five recordings of 7 to 8 s at 30 frames a second (`benchmarks.blind.sessions`): random steps, which are
held out, and stairs, a triangle, a chirp and a release, which are fitted. Each session has one effect or none. With
"faint" effects the base model's residual is approximately 0.05°, with "plain" effects several times that.

PySINDy sees θ, ω and the command, in three ways:

    differences   `FiniteDifference` of fourth order, twice, at the frames; STLSQ
    weak          `WeakPDELibrary`, θ and ω of the interpolating spline on a grid eight times finer; STLSQ
    ensemble      the same rows drawn with replacement, STLSQ on each draw, median of all draws

The command enters as its exact mean around each point of the grid, so that no method loses the time of a change. The
library has a term for every effect: 1, θ², θ³, ω², ω|ω|, tanh(ω/ε) for dry friction, and copies of the command with
delays and with play, including the true values of the plain cases. sin θ is left out: over ±20° it differs from a sum
of θ and θ³ by less than 10⁻⁴. All copies together are nearly collinear and spoil the regression, so there is one
library per copy, with all the other terms. Every library is thresholded at several `SHARES`. Of the resulting models
the one is chosen whose free run of the fitted recordings has the lowest BIC. On other seeds this criterion named as
many effects as the lowest error on the held-out recording, with fewer additional terms.

A method's answer is the extra term whose removal increases the regression error most; "alone" counts the sessions
without a wrong additional term. For a tilted camera no term of a differential equation is right; θ² and ω², its traces
in the measured angle, are accepted. For a periodic disturbance no library has a term, and naming none is right. "Held
out" is the RMS error of free runs of the random steps, of the same method's linear model → of the chosen model.
anglecam's answer is the loop's verdict.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.loop.close import close_records
from benchmarks.blind.sessions import HELD_OUT, session

Floats = NDArray[np.float64]

NOISES_DEG = (0.05, 0.005)
CASES = {
    "coulomb_friction": ({"torque": 4.0}, {"torque": 0.6}),
    "quadratic_drag": ({"q": 1.0}, {"q": 0.3}),
    "stiffening_spring": ({"k3": 400.0}, {"k3": 60.0}),
    "gravity_geometry": ({"strength": 240.0, "gravity_deg": 45.0}, {"strength": 40.0, "gravity_deg": 45.0}),
    "dead_time": ({"tau_s": 0.03}, {"tau_s": 0.002}),
    "backlash": ({"half_width_deg": 0.5}, {"half_width_deg": 0.07}),
    "camera_tilt": ({"tilt_deg": 20.0, "axis_deg": 45.0}, {"tilt_deg": 8.0, "axis_deg": 45.0}),
    "periodic_disturbance": ({"amplitude": 6.0, "frequency_hz": 1.7}, {"amplitude": 0.6, "frequency_hz": 1.7}),
    "nothing": (None,),
}
"""Plain and faint."""
DELAYS_S = (0.005, 0.01, 0.03, 0.06)
PLAYS_DEG = (0.1, 0.2, 0.5, 1.0)
COPIES = [f"u(t−{1e3 * d:.0f} ms)" for d in DELAYS_S] + [f"play(u, {h:g}°)" for h in PLAYS_DEG]
TERMS = ["θ", "ω", "u", "1", "θ²", "θ³", "ω²", "ω|ω|", "sgn ω", *COPIES]
LINEAR = [0, 1, 2]
EXTRA = list(range(3, 9))
RIGHT = {
    "coulomb_friction": {"sgn ω"},
    "quadratic_drag": {"ω|ω|"},
    "stiffening_spring": {"θ³"},
    "gravity_geometry": {"θ²", "θ³"},
    "dead_time": set(COPIES[:4]),
    "backlash": set(COPIES[4:]),
    "camera_tilt": {"θ²", "ω²"},
    "periodic_disturbance": {"nothing"},
    "nothing": {"nothing"},
}
FINER = 8
STILL = 0.01
"""ε of the smoothed sign, rad/s; a head that should stick creeps more slowly than this."""
HALF_WIDTH_S, DOMAINS = 0.2, 60
"""Half width of the weak form's test functions, s, and their number per recording; all widths from 0.1 s to 0.4 s give
equal results."""
SHARES = np.geomspace(0.003, 0.2, 7)
"""Thresholds as shares of the acceleration's RMS: a term that contributes less is dropped."""


@dataclass(frozen=True)
class Gridded:
    """A recording on an even grid of n points."""

    time: Floats
    angle: Floats
    state: Floats
    """(n, 2) θ and ω as measured, rad and rad/s."""
    about: Floats
    """(n, inputs) mean of command and copies over the interval around each point."""
    after: Floats
    """(n − 1, inputs) mean until the next point."""
    start: Floats
    """θ and ω at the first point."""
    every: int
    """Grid points per frame."""


def mean(command: Command, start: Floats, stop: Floats) -> Floats:
    """Return the exact mean of a staircase."""
    knots = np.array([command.time[0] - 10.0, *command.time, command.time[-1] + 100.0])
    levels = np.array([command.angle[0], *command.angle])
    area = np.array([0.0, *np.cumsum(levels * np.diff(knots))])
    return (np.interp(stop, knots, area) - np.interp(start, knots, area)) / (stop - start)


def behind_play(command: Command, half_width: float) -> Command:
    followed, at = [], 0.0
    for level in command.angle:
        at = min(max(at, level - half_width), level + half_width)
        followed.append(at)
    return replace(command, angle=np.array(followed))


def on_grid(record: Record, *, finer: int) -> Gridded:
    command, step = record.command, record.interval / finer
    assert command is not None
    inputs = [command]
    inputs += [replace(command, time=command.time + delay) for delay in DELAYS_S]
    inputs += [behind_play(command, np.radians(width)) for width in PLAYS_DEG]
    at = record.time[0] + step * np.arange(finer * (len(record.time) - 1) + 1)
    spline = CubicSpline(record.time, record.angle)
    rest = record.angle[record.time < command.first_change()].mean()
    return Gridded(
        at - at[0],
        record.angle,
        np.column_stack([spline(at), spline(at, 1)]),
        np.column_stack([mean(u, at - step / 2, at + step / 2) for u in inputs]),
        np.column_stack([mean(u, at[:-1], at[1:]) for u in inputs]),
        np.array([rest, 0.0]),
        finer,
    )


def of_state(theta: Floats, omega: Floats) -> list[Floats]:
    """Return the library's terms that are functions of the state, beyond the linear ones."""
    return [np.ones_like(theta), theta**2, theta**3, omega**2, omega * np.abs(omega), np.tanh(omega / STILL)]


def columns(state: Floats, inputs: Floats) -> Floats:
    return np.column_stack([*state.T, inputs[:, 0], *of_state(*state.T), inputs[:, 1:]])


def by_differences(records: Sequence[Record]) -> tuple[Floats, Floats]:
    """Return terms and acceleration at the frames."""
    import pysindy

    differ = pysindy.FiniteDifference(order=4)
    terms, accelerations = [], []
    for grid in (on_grid(record, finer=1) for record in records):
        omega = np.asarray(differ(grid.angle[:, None], grid.time))
        accelerations.append(np.asarray(differ(omega, grid.time))[:, 0])
        terms.append(columns(np.column_stack([grid.angle, omega]), grid.about))
    return np.vstack(terms), np.hstack(accelerations)


def by_weak_form(records: Sequence[Record]) -> tuple[Floats, Floats]:
    """Return terms and acceleration, each integrated against the test functions."""
    import pysindy

    terms, accelerations = [], []
    for grid in (on_grid(record, finer=FINER) for record in records):
        library = pysindy.WeakPDELibrary(
            function_library=pysindy.IdentityLibrary(),
            spatiotemporal_grid=grid.time,
            K=DOMAINS,
            H_xt=HALF_WIDTH_S,
            is_uniform=True,
        )
        data = pysindy.AxesArray(columns(grid.state, grid.about), {"ax_time": 0, "ax_coord": 1})
        terms.append(np.asarray(library.fit_transform([data])[0]))
        accelerations.append(np.asarray(library.convert_u_dot_integral(data[:, 1:2]))[:, 0])
    return np.vstack(terms), np.hstack(accelerations)


def thresholded(threshold: float):
    import pysindy

    return pysindy.STLSQ(threshold=threshold, alpha=0.0, normalize_columns=True)


def ensembled(threshold: float):
    import pysindy

    return pysindy.EnsembleOptimizer(thresholded(threshold), bagging=True, n_models=10)


WAYS = {
    "differences": (by_differences, thresholded),
    "weak": (by_weak_form, thresholded),
    "ensemble": (by_weak_form, ensembled),
}


def models(terms: Floats, acceleration: Floats, optimiser: Callable) -> Floats:
    """Return the models of every library at every threshold, (models, terms); the first is the linear model."""
    found = []
    size = float(np.linalg.norm(acceleration))
    libraries = [LINEAR, LINEAR + EXTRA, *([*LINEAR, *EXTRA, copy] for copy in range(9, len(TERMS)))]
    for library in libraries:
        for share in SHARES if library != LINEAR else [0.0]:
            fitted = optimiser(share * size).fit(terms[:, library], acceleration[:, None])
            model = np.zeros(len(TERMS))
            model[library] = fitted.coef_[0]
            found.append(model)
    return np.array(list({model.tobytes(): model for model in found}.values()))


def free_runs(models: Floats, grids: Sequence[Gridded]) -> Iterator[Floats]:
    """Run every model through every recording by Runge–Kutta; yield errors (models, frames), rad."""
    gains, inputs = models[:, :9], models[:, [2, *range(9, len(TERMS))]]
    for grid in grids:
        step = grid.time[1]

        def acceleration(theta: Floats, omega: Floats, forced: Floats) -> Floats:
            parts = np.stack([theta, omega, *of_state(theta, omega)], axis=1)
            return forced + np.sum(gains[:, [0, 1, *EXTRA]] * parts, axis=1)

        theta, omega = (np.full(len(models), start) for start in grid.start)
        run = [theta]
        for forced in grid.after @ inputs.T:
            k1 = acceleration(theta, omega, forced)
            k2 = acceleration(theta + step / 2 * omega, omega + step / 2 * k1, forced)
            k3 = acceleration(theta + step / 2 * omega + step**2 / 4 * k1, omega + step / 2 * k2, forced)
            k4 = acceleration(theta + step * omega + step**2 / 2 * k2, omega + step * k3, forced)
            theta = np.clip(theta + step * omega + step**2 / 6 * (k1 + k2 + k3), -3.0, 3.0)
            omega = np.clip(omega + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4), -100.0, 100.0)
            run.append(theta)
        yield np.array(run[:: grid.every]).T - grid.angle


def ranked(model: Floats, terms: Floats, acceleration: Floats) -> list[int]:
    """Order a model's extra terms by the regression's error without each."""
    there = np.flatnonzero(model)

    def missed(extra: int) -> float:
        rest = terms[:, there[there != extra]]
        return float(np.linalg.norm(acceleration - rest @ np.linalg.lstsq(rest, acceleration)[0]))

    return sorted((int(i) for i in there if i not in LINEAR), key=missed, reverse=True)


@dataclass(frozen=True)
class Answer:
    named: tuple[str, ...]
    """Terms or effects, the most important first."""
    before: float
    """RMS error on the held-out recording, °."""
    after: float
    seconds: float


def with_pysindy(way: str, records: Sequence[Record]) -> Answer:
    rows, optimiser = WAYS[way]
    began = time.perf_counter()
    fitted = [r for r in records if r.name not in HELD_OUT]
    held_out = [r for r in records if r.name in HELD_OUT]
    np.random.seed(0)  # noqa: NPY002  # the generator of WeakPDELibrary and EnsembleOptimizer
    terms, acceleration = rows(fitted)
    found = models(terms, acceleration, optimiser)
    errors = np.hstack(list(free_runs(found, [on_grid(r, finer=FINER) for r in fitted])))
    frames = errors.shape[1]
    bic = frames * np.log(np.mean(errors**2, axis=1)) + np.log(frames) * np.count_nonzero(found, axis=1)
    taken = int(np.argmin(bic))
    extras = ranked(found[taken], terms, acceleration)
    seconds = time.perf_counter() - began
    ran = np.hstack(list(free_runs(found[[0, taken]], [on_grid(r, finer=FINER) for r in held_out])))
    before, after = np.degrees(np.sqrt(np.mean(ran**2, axis=1)))
    return Answer(tuple(TERMS[i] for i in extras) or ("nothing",), before, after, seconds)


def with_anglecam(records: Sequence[Record]) -> Answer:
    began = time.perf_counter()
    verdict = close_records(records, held_out=HELD_OUT)
    seconds = time.perf_counter() - began
    named = tuple(a.effect.id for a in verdict.accepted)
    named = named or ("nothing" if verdict.verdict == "nothing_missing" else "unexplained",)
    before, after = np.degrees([verdict.before_held_out.rmse, verdict.after_held_out.rmse])
    return Answer(named, before, after, seconds)


def line(answers: Sequence[Answer], right: set[str]) -> str:
    named = ", ".join(f"{name} {n}" for name, n in Counter(a.named[0] for a in answers).most_common())
    good = sum(a.named[0] in right for a in answers)
    alone = sum(right.issuperset(a.named) for a in answers)
    before, after, seconds = (np.median([getattr(a, key) for a in answers]) for key in ("before", "after", "seconds"))
    return f"{good}/{len(answers)} | {alone} | {named} | {before:.3g} → {after:.3g} | {seconds:.2g}"


def main() -> None:
    parser = argparse.ArgumentParser()
    # argparse checks an empty list against the choices too
    parser.add_argument("cases", nargs="*", choices=[*CASES, []], default=[], metavar="case")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--only", choices=("pysindy", "anglecam"))
    chosen = parser.parse_args()
    methods: dict[str, Callable[[Sequence[Record]], Answer]] = {}
    if chosen.only != "anglecam":
        methods |= {f"PySINDy, {way}": partial(with_pysindy, way) for way in WAYS}
    if chosen.only != "pysindy":
        methods["anglecam"] = with_anglecam
    peer = f"; PySINDy {version('pysindy')}" if chosen.only != "anglecam" else ""
    print(f"{date.today():%d %B %Y}; anglecam {version('anglecam')}{peer}; {chosen.seeds} sessions a line\n")
    print("| effect | noise, ° | method | right | alone | named | held out, ° | s |")
    print("| --- " * 8 + "|", flush=True)
    warnings.filterwarnings("ignore")
    for case in chosen.cases or CASES:
        for size, keys in zip(("plain", "faint"), CASES[case], strict=False):
            for noise in NOISES_DEG:
                effects = {} if keys is None else {case: keys}
                sessions = [session(effects, seed=seed, sigma_deg=noise) for seed in range(chosen.seeds)]
                for name, method in methods.items():
                    right = RIGHT[case] if name != "anglecam" else {case}
                    label = case if keys is None else f"{case}, {size}"
                    print(f"| {label} | {noise} | {name} | {line([method(s) for s in sessions], right)} |", flush=True)


if __name__ == "__main__":
    main()
