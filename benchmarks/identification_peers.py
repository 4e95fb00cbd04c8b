"""Compares identification packages in accuracy and speed, on the same series with known truth.

    python3 -m venv build/identification-peers
    build/identification-peers/bin/pip install -e . -r benchmarks/identification-requirements.txt
    apt-get install --no-install-recommends octave octave-control
    PYTHONPATH=tests build/identification-peers/bin/python benchmarks/identification_peers.py [seeds]

The truth is the paper's SYS1, a = 26, b = 524, c = 508, and its SYS2, Eq. (36), each in one series of steps, 12 s at 30
frames a second, with white noise of 0.2° for SYS1 and 0.02° for SYS2. The first kind of series is "even", as the other
packages require: frames at even times, and the command changes on a frame. The second is "as filmed": the command
changes between frames, and one frame in ten is missing; the other packages get the angle interpolated to even times.
Every method gets the true order.

The other packages' discrete models are converted to continuous ones by the matrix logarithm, which is exact for a
command held from frame to frame. a and b come from the poles, c from b and the static gain. "Response" is the model's
free run from rest minus the true response, without noise. Errors are medians over the seeds. anglecam's output error
gets no start, its filter the paper's: 5, 531, 520. A method that is not installed is left out with a message.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import logm

import anglecam
from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.identification.ekf import fit_ekf, settings_for
from anglecam.identification.identify_records import identify_records
from anglecam.io.rig import Rig
from support.transfer import SYS2_DENOMINATOR, SYS2_NUMERATOR, respond

Floats = NDArray[np.float64]

SCRIPT = Path(__file__).with_name("octave_identification.m")
INTERVAL, DURATION = 1.0 / 30.0, 12.0
LEVELS_DEG = (12.0, 0.0, 6.0, -6.0, -12.0, 0.0, 10.0, 2.0)
MISSING = 0.1
BLOCKS = 12
"""Block rows of the subspace methods: 0.4 s, approximately two periods."""


@dataclass(frozen=True)
class Truth:
    name: str
    numerator: Floats
    denominator: Floats
    gain: float
    """Factor on the command, so that both systems move by approximately 12°."""
    sigma_deg: float

    @property
    def order(self) -> int:
        return len(self.denominator) - 1

    @property
    def poles(self) -> NDArray[np.complex128]:
        return in_order(np.roots(self.denominator))


TRUTHS = (
    Truth("SYS1", np.array([508.0]), np.array([1.0, 26.0, 524.0]), 1.0, 0.2),
    Truth("SYS2", SYS2_NUMERATOR, SYS2_DENOMINATOR, 1.0 / 23.58, 0.02),
)


@dataclass(frozen=True)
class Found:
    """A model identified by a method."""

    poles: NDArray[np.complex128]
    """1/s."""
    gain: float
    """Static gain."""
    response: Floats
    """Free run at even times."""
    seconds: float


def in_order(poles: NDArray) -> NDArray[np.complex128]:
    poles = np.asarray(poles, dtype=complex)
    return poles[np.lexsort((-poles.imag, poles.real))]


@dataclass(frozen=True)
class Data:
    """One true system in one kind of series, with noise for every seed."""

    truth: Truth
    even: Floats
    """(n,) even times, s."""
    command: Command
    exact: Floats
    """(n,) true response at them, rad."""
    records: Sequence[Record]
    """The existing frames, for anglecam."""

    @property
    def u(self) -> Floats:
        return self.command.at(self.even)

    def y(self, record: Record) -> Floats:
        """Return the angle at even times."""
        return np.interp(self.even, record.time, record.angle)


def draw(truth: Truth, seeds: int, *, filmed: bool) -> Data:
    even = np.arange(0.0, DURATION - 1e-9, INTERVAL)
    rng = np.random.default_rng(0)
    every = 45
    frames = 15 + every * np.arange(len(LEVELS_DEG))
    switches = np.array(
        [
            0.0,
            *(even[np.minimum(frames, len(even) - 1)] + (INTERVAL * rng.uniform(0, 1, len(frames)) if filmed else 0.0)),
        ]
    )
    command = Command(switches, truth.gain * np.radians([0.0, *LEVELS_DEG]))
    exact = respond(truth.numerator, truth.denominator, even, command.time, command.angle)
    records = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        kept = rng.uniform(size=len(even)) > MISSING if filmed else np.ones(len(even), bool)
        kept[[0, -1]] = True
        angle = exact + rng.normal(0.0, np.radians(truth.sigma_deg), len(even))
        records.append(Record("steps", even[kept], angle[kept], command, True, np.full(int(kept.sum()), np.nan)))
    return Data(truth, even, command, exact, records)


def found_from(data: Data, seconds: float, A: Floats, B: Floats, C: Floats, D: Floats) -> Found:
    """Convert a discrete model to poles, gain and response."""
    n = len(A)
    if not np.all(np.isfinite(A)):
        return Found(np.full(n, np.nan), np.nan, np.full(len(data.even), np.nan), seconds)
    joint = np.zeros((n + 1, n + 1))
    joint[:n, :n], joint[:n, n:], joint[n, n] = A, B.reshape(n, 1), 1.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        poles = np.linalg.eigvals(logm(joint)[:n, :n] / INTERVAL)
    gain = (C.reshape(1, n) @ np.linalg.solve(np.eye(n) - A, B.reshape(n, 1)) + D.reshape(1, 1)).item()
    state, response = np.zeros(n), np.empty(len(data.even))
    for i, u in enumerate(data.u):
        response[i] = C.reshape(n) @ state + D.item() * u
        state = A @ state + B.reshape(n) * u
    return Found(in_order(poles), gain, response, seconds)


def with_output_error(data: Data) -> list[Found]:
    found = []
    for record in data.records:
        began = time.perf_counter()
        fit = identify_records([record], Rig(), "oe2" if data.truth.order == 2 else "oe3").fit
        took = time.perf_counter() - began
        p = fit.parameters
        poles = np.roots([1.0, *p[: data.truth.order]])
        gain = p[2] / p[1] if data.truth.order == 2 else p[5] / p[2]
        response = fit.model.predict(p, data.even, data.command, np.zeros(fit.model.states))
        found.append(Found(in_order(poles), gain, response, took))
    return found


def with_filter(data: Data) -> list[Found]:
    if data.truth.order != 2:
        return []
    found, start, sigma = [], np.array([5.0, 531.0, 520.0]), np.radians(data.truth.sigma_deg)
    for record in data.records:
        began = time.perf_counter()
        p = fit_ekf([record], start, settings_for([record], start, sigma)).parameters
        took = time.perf_counter() - began
        response = respond(p[2:], np.array([1.0, *p[:2]]), data.even, data.command.time, data.command.angle)
        found.append(Found(in_order(np.roots([1.0, *p[:2]])), p[2] / p[1], response, took))
    return found


def by_frame(identify: Callable[[Floats, Floats, int], Sequence[Floats]]) -> Callable[[Data], list[Found]]:
    """Return a function that applies a method (y, u, order) → (A, B, C, D) to every seed."""

    def method(data: Data) -> list[Found]:
        found = []
        for record in data.records:
            y = data.y(record)
            began = time.perf_counter()
            A, B, C, D = (np.asarray(part, float) for part in identify(y, data.u, data.truth.order))
            found.append(found_from(data, time.perf_counter() - began, A, B, C, D))
        return found

    return method


def realised(y: Floats, u: Floats, order: int) -> Sequence[Floats]:
    """Identify with python-control: Markov parameters by least squares, then the eigensystem realisation."""
    response = control.TimeResponseData(np.arange(len(y)) * INTERVAL, y, np.zeros((0, len(y))), u)
    markov = np.asarray(control.markov(response, 6 * BLOCKS, dt=INTERVAL)).ravel()
    system, _ = control.eigensys_realization(markov[None, None, :], order, m=2 * BLOCKS, n=2 * BLOCKS, dt=INTERVAL)
    return system.A, system.B, system.C, system.D


def sippy(name: str, **options: object) -> Callable[[Floats, Floats, int], Sequence[Floats]]:
    def identify(y: Floats, u: Floats, order: int) -> Sequence[Floats]:
        from sippy_unipi import system_identification

        if name in {"N4SID", "MOESP", "CVA"}:
            chosen = {"SS_fixed_order": order, "SS_f": BLOCKS, "SS_p": BLOCKS, **options}
        else:
            chosen = {f"{name}_orders": [order, order, 0], **options}
        model = system_identification(y, u, name, tsample=INTERVAL, **chosen)
        if hasattr(model, "A"):
            return model.A, model.B, model.C, model.D
        system = control.tf2ss(model.G)
        return system.A, system.B, system.C, system.D

    return identify


def four_sid(y: Floats, u: Floats, order: int) -> Sequence[Floats]:
    import pandas
    from nfoursid.nfoursid import NFourSID

    frame = pandas.DataFrame({"y": y, "u": u})
    method = NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=BLOCKS)
    method.subspace_identification()
    system, _ = method.system_identification(rank=order)
    return system.a, system.b, system.c, system.d


def with_octave(method: str) -> Callable[[Data], list[Found]]:
    def identify(data: Data) -> list[Found]:
        n = data.truth.order
        with tempfile.TemporaryDirectory() as folder:
            np.savetxt(f"{folder}/u.csv", data.u, delimiter=",")
            np.savetxt(f"{folder}/y.csv", np.column_stack([data.y(r) for r in data.records]), delimiter=",")
            call = ["octave-cli", "--norc", str(SCRIPT), folder, method, str(n), str(INTERVAL)]
            subprocess.run(call, check=True, capture_output=True, text=True)
            rows = np.genfromtxt(f"{folder}/found.csv", delimiter=",", ndmin=2)
        found = []
        for row in rows:
            A, B, C, D = np.split(row[1:], np.cumsum([n * n, n, n]))
            found.append(found_from(data, row[0], A.reshape(n, n, order="F"), B, C, D))
        return found

    return identify


def octave_says(command: str) -> str | None:
    """Return Octave's output; ``None`` if it is not installed or fails."""
    if shutil.which("octave-cli") is None:
        return None
    done = subprocess.run(["octave-cli", "--norc", "--eval", command], check=False, capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else None


def methods() -> Iterator[tuple[str, Callable[[Data], list[Found]]]]:
    """Yield the installed methods; print which are missing."""
    yield "anglecam, output error", with_output_error
    yield "anglecam, iterated EKF", with_filter
    yield "python-control, Markov + ERA", by_frame(realised)
    if find_spec("sippy_unipi"):
        for name in ("ARX", "OE", "N4SID", "MOESP", "CVA"):
            yield f"SIPPY, {name}", by_frame(sippy(name))
    else:
        print("SIPPY: left out, it needs pip install sippy-unipi\n")
    if find_spec("nfoursid"):
        yield "nfoursid, N4SID", by_frame(four_sid)
    else:
        print("nfoursid: left out, it needs pip install nfoursid\n")
    if octave_says("pkg load control; disp(1)"):
        for name in ("arx", "moen4", "moesp", "n4sid"):
            yield f"Octave, {name}", with_octave(name)
    else:
        print("Octave: left out, it needs apt-get install octave octave-control\n")


def versions() -> str:
    named = [f"anglecam {anglecam.__version__}", f"python-control {version('control')}"]
    named += [
        f"{name} {version(name)}"
        for name, module in (("sippy-unipi", "sippy_unipi"), ("nfoursid", "nfoursid"))
        if find_spec(module)
    ]
    octave = octave_says(
        'pkg load control; printf("Octave %s, control %s", version, pkg("list", "control"){1}.version)'
    )
    return "; ".join(named + ([octave] if octave else []))


def relative(found: Sequence[Found], truth: Truth) -> str:
    """Return the RMS error of each real parameter, in per cent: a, b, c, or the distances from the true poles."""
    poles = np.array([f.poles for f in found])
    if truth.order == 2:
        b = np.prod(poles, axis=1).real
        values = np.column_stack([-np.sum(poles, axis=1).real, b, b * [f.gain for f in found]])
        true = np.array([*truth.denominator[1:], truth.numerator[0]])
        off = np.abs(values - true) / true
    else:
        off = (np.abs(poles - truth.poles) / np.abs(truth.poles))[:, :2]
    return ", ".join(f"{v:.2g}" for v in 100.0 * np.sqrt(np.nanmedian(off**2, axis=0)))


def main(seeds: int) -> None:
    print(f"{date.today():%d %B %Y}; {versions()}; {seeds} seeds\n")
    there = list(methods())
    for truth in TRUTHS:
        what = "a, b, c" if truth.order == 2 else "real pole, pair"
        columns = [f"{kind}: {each}" for kind in ("even", "as filmed") for each in (f"{what}, %", "response, °")]
        print(f"| {truth.name}, {truth.sigma_deg}° noise | {' | '.join(columns)} | failed | ms |")
        print("| --- " * 7 + "|")
        series = [draw(truth, seeds, filmed=filmed) for filmed in (False, True)]
        warm = draw(truth, 1, filmed=False)
        for name, method in there:
            cells, failed, seconds = [], 0, []
            try:
                if not method(warm):  # compiles and loads on first use
                    continue
                for data in series:
                    found = method(data)
                    missed = np.array([np.sqrt(np.mean((f.response - data.exact) ** 2)) for f in found])
                    good = np.isfinite(missed)
                    failed += int(np.sum(~good))
                    cells += [relative(found, truth), f"{np.degrees(np.median(missed[good])):.2g}"]
                    seconds += [f.seconds for f in found]
            except Exception as error:  # noqa: BLE001  # a peer may fail in any way; the table reports it
                print(f"| {name} | fails: {type(error).__name__}: {str(error)[:60]} | | | | | |")
                continue
            print(f"| {name} | {' | '.join(cells)} | {failed} | {1e3 * np.nanmedian(seconds):.2g} |", flush=True)
        print()


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
