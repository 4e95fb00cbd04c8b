"""Read a damaged file and judge the outcome, in this process or in a separate one that may die.

Allowed outcomes are a result, and an `InputError` or `RigError` of one line that names the file. Everything else is a
finding: another exception, a warning, a line without a cause, too much time or memory. A death by signal is counted
separately.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import resource
import shutil
import signal
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from anglecam.errors import AnglecamError, InputError, RigError, printable

Reader = Callable[[Path], object]

RESULT, REFUSED, FINDING, DIED = "result", "refused", "finding", "died"


@dataclass(frozen=True)
class Case:
    """One damaged file."""

    damage: str
    """Name of the damage."""
    name: str
    """Name of the file."""
    content: bytes
    reader: str = "clip"
    """Key of the reader."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of a case."""

    kind: str
    """`RESULT`, `REFUSED`, `FINDING` or `DIED`."""
    said: str = ""
    """The refusal's line, or the description of the finding."""


def judge(read: Reader, path: Path, most_bytes: int | None = None) -> Outcome:
    """Read a file in this process and judge the outcome.

    Parameters
    ----------
    read : callable
        Called with the file's path.
    path : Path
        The damaged file.
    most_bytes : int, optional
        Largest allowed growth of the resident memory, bytes.

    Returns
    -------
    Outcome
        Never `DIED`, which only another process can observe.
    """
    before = forget_peak()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            read(path)
        outcome = Outcome(RESULT)
    except (InputError, RigError) as refusal:
        outcome = _judge_line(refusal, path)
    except Exception:  # noqa: BLE001 - any other exception is a finding
        outcome = Outcome(FINDING, traceback.format_exc())
    grown = peak() - before
    if most_bytes is not None and grown > most_bytes:
        return Outcome(FINDING, f"{grown / 2**20:.0f} MiB of memory; then {outcome.kind} {outcome.said}")
    return outcome


def _judge_line(refusal: AnglecamError, path: Path) -> Outcome:
    line = str(refusal)
    named = printable(path.name.removesuffix(".angles.csv"))  # a series may be named by its recording
    faults = line.splitlines() if isinstance(refusal, RigError) else [line]  # a file of declarations has several
    if len(faults) != len(line.splitlines()) or not all(named in one for one in faults) or "internal error" in line:
        return Outcome(FINDING, f"{type(refusal).__name__} says {line!r}")
    cause = line.split(named, 1)[1].strip(": ")
    return Outcome(REFUSED, line) if len(cause) > 5 else Outcome(FINDING, f"no cause in {line!r}")


def forget_peak() -> int:
    """Reset the peak of the resident memory, and return the present peak, bytes."""
    with contextlib.suppress(OSError):  # not Linux, or not allowed: the peak then covers the whole life of the process
        Path("/proc/self/clear_refs").write_text("5")
    return peak()


def peak() -> int:
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return 1024 * int(line.split()[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


class Trial:
    """A process that reads damaged files one after another and is restarted when it dies or hangs."""

    def __init__(self, readers: Callable[[], dict[str, Reader]], *, seconds: float, most_bytes: int) -> None:
        self._readers, self._seconds, self._most_bytes = readers, seconds, most_bytes
        self._context = multiprocessing.get_context("spawn")
        self._process: multiprocessing.process.BaseProcess | None = None

    def run(self, reader: str, path: Path) -> Outcome:
        """Let the process read one file."""
        if self._process is None:
            self._pipe, theirs = self._context.Pipe()
            self._process = self._context.Process(target=_serve, args=(theirs, self._readers, self._most_bytes))
            self._process.start()
            theirs.close()
            self._pipe.recv()  # imported and ready
        self._pipe.send((reader, path))
        try:
            if self._pipe.poll(self._seconds):
                return Outcome(*self._pipe.recv())
            self._process.kill()
            outcome = Outcome(FINDING, f"took longer than {self._seconds:g} s")
        except (EOFError, ConnectionResetError):
            self._process.join()
            code = self._process.exitcode or 0
            outcome = Outcome(DIED, signal.Signals(-code).name if code < 0 else f"exit status {code}")
        self._process.join()
        self._process = None
        return outcome

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()


def _serve(pipe, readers: Callable[[], dict[str, Reader]], most_bytes: int) -> None:
    known = readers()
    pipe.send("ready")
    while True:
        reader, path = pipe.recv()
        outcome = judge(known[reader], path, most_bytes)
        pipe.send((outcome.kind, outcome.said))


def arguments(text: str | None, commands: Sequence[str] = (), keep: Path = Path("build/fuzz")) -> argparse.Namespace:
    """Parse the command line of a program; ``--command`` chooses one of ``commands``, if there are any."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=int, nargs="?", default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--keep", type=Path, default=keep, help="folder for files that are findings")
    if commands:
        parser.add_argument("--command", choices=commands, default=commands[0])
    return parser.parse_args()


def run_all(cases: Iterable[tuple[int, Case]], trial: Trial, keep: Path) -> int:
    """Run cases, keep the files of findings, print a table, and return the number of findings."""
    counts: dict[str, Counter[str]] = {}
    longest, began = 0.0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        for number, case in cases:
            path = Path(folder) / f"{number:04d}-{case.name}"
            path.write_bytes(case.content)
            start = time.monotonic()
            outcome = trial.run(case.reader, path)
            longest = max(longest, time.monotonic() - start)
            counts.setdefault(case.damage, Counter())[outcome.kind] += 1
            if outcome.kind in (FINDING, DIED):
                keep.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, keep / path.name)
                (keep / f"{path.name}.why.txt").write_text(f"{case.damage}, {case.reader}\n{outcome.said}\n")
                last = outcome.said.strip().splitlines()[-1]
                print(f"{path.name}: {case.damage}, {case.reader}: {outcome.kind}: {last[:200]}", flush=True)
            path.unlink()
    trial.close()
    kinds = (RESULT, REFUSED, FINDING, DIED)
    print(f"\n{date.today():%d %B %Y}, {time.monotonic() - began:.0f} s, the longest case {longest:.1f} s\n")
    print("| damage | cases | read | refused in one line | findings | death of the decoder |")
    print("| --- | --- | --- | --- | --- | --- |")
    for damage, count in sorted(counts.items()) + [("all", sum(counts.values(), Counter()))]:
        print(f"| {damage} | {count.total()} | " + " | ".join(str(count[kind]) for kind in kinds) + " |")
    return sum(count[FINDING] for count in counts.values())
