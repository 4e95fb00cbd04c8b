"""Canonical sessions whose loop is closed once in a run of the tests, for tests that only look at the verdict.

    def test_something(closed):
        verdict = closed("late")

`closed` is a fixture of `tests/conftest.py`. The first that asks for a verdict closes the loop and writes the verdict
into pytest's base folder, where the other test processes find it. A file is named by a hash of the recordings, of the
options and of the sources of `anglecam`, so that a verdict of other code is never read. Verdicts are shared and must
not be changed.
"""

from __future__ import annotations

import hashlib
import io
import pickle
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

from filelock import FileLock

import anglecam
from anglecam.data.record import Record
from anglecam.effects import LEDGER, Effect, effect
from anglecam.loop.close import close_records
from anglecam.loop.verdict import Verdict
from benchmarks.blind.sessions import session as drawn_session
from support.motion import Plant
from support.outside import outside_session
from support.series import session

_IDS = {entry.id for entry in LEDGER}


@dataclass(frozen=True)
class Canonical:
    """A session and how its loop is closed."""

    records: Callable[[], list[Record]]
    options: dict[str, Any] = field(default_factory=lambda: {"held_out": ["random"]})


def _three(plant: Plant, seed: int) -> Callable[[], list[Record]]:
    """Return what makes the records of steps, a triangle and random steps."""
    return lambda: session(plant, seed)[::2]


CANONICAL = {
    "late": Canonical(_three(Plant(dead_time_s=0.040), 11)),
    "rubbing": Canonical(_three(Plant(coulomb=2.0), 11)),
    "dragging": Canonical(_three(Plant(quadratic_drag=1.0), 11)),
    "dragging, none held out": Canonical(_three(Plant(quadratic_drag=2.0), 21), {}),
    "one recording": Canonical(lambda: session(Plant(dead_time_s=0.05), 14)[-1:], {}),
    # two causes that the ledger lacks: the search adds effects that take away a part of them and do not stand
    "magnet": Canonical(lambda: outside_session("magnet", 0)[::4]),
    "gusts": Canonical(
        lambda: drawn_session({"wind_gusts": {"rms": 1.0, "number": 3}}, seed=10, names=("stairs", "chirp", "random")),
        {"held_out": ["random"], "seed": 10},
    ),
    **{  # nothing is hidden, and every other one's noise is coloured
        f"clean {seed}": Canonical(
            lambda seed=seed: session(Plant(), seed, phi=0.6 * (seed % 2), duration_s=5.0),
            {"held_out": ["random"], "seed": seed},
        )
        for seed in range(4)
    },
}
"""By name."""


@dataclass(frozen=True)
class ClosedSessions:
    """Verdicts on the canonical sessions, kept in a folder that test processes share."""

    folder: Path
    _here: dict[str, Verdict] = field(default_factory=dict)

    def __call__(self, name: str) -> Verdict:
        """Return the verdict on a session; the first call in a run closes its loop."""
        if name not in self._here:
            self._here[name] = self._from_folder(CANONICAL[name])
        return self._here[name]

    def _from_folder(self, one: Canonical) -> Verdict:
        records = one.records()
        key = hashlib.sha256(_pickled((records, one.options)) + _code()).hexdigest()[:32]
        file = self.folder / f"{key}.verdict"
        self.folder.mkdir(exist_ok=True)
        with FileLock(file.with_suffix(".lock")):
            if not file.exists():
                made = file.with_suffix(".unfinished")
                made.write_bytes(_pickled(close_records(records, **one.options)))
                made.replace(file)
            verdict: Verdict = pickle.loads(file.read_bytes())
        return verdict


@cache
def _code() -> bytes:
    """Return a hash of the sources of anglecam."""
    whole = hashlib.sha256()
    for file in sorted(Path(anglecam.__file__).parent.rglob("*.py")):
        whole.update(file.read_bytes())
    return whole.digest()


def _pickled(content: object) -> bytes:
    stream = io.BytesIO()
    _Pickler(stream, protocol=pickle.HIGHEST_PROTOCOL).dump(content)
    return stream.getvalue()


class _Pickler(pickle.Pickler):
    """Writes an effect as its id and what differs from the ledger's, because compiled functions cannot be written."""

    def reducer_override(self, obj: object) -> Any:
        if not isinstance(obj, Effect) or obj.id not in _IDS:
            return NotImplemented
        entry = effect(obj.id)
        other = {f.name for f in fields(Effect) if getattr(obj, f.name) is not getattr(entry, f.name)}
        return _effect, (obj.id, {name: getattr(obj, name) for name in sorted(other)})


def _effect(identifier: str, changed: dict[str, Any]) -> Effect:
    return replace(effect(identifier), **changed) if changed else effect(identifier)
