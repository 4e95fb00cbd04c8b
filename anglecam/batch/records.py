"""Job records: the outcome of each clip and session, as the database keeps it between batches.

A job record describes results that are in place. `anglecam.batch.publish` keeps it so: it deletes a record before it
replaces the results, and saves the new record after the new results are in place.

A failed attempt does not replace results. Its record keeps the record of the results that are in place; the index then
calls these results stale.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from anglecam.batch.identity import Stamp
from anglecam.batch.row import FAILED, OK, STALE, Row


@dataclass(frozen=True)
class ClipRecord:
    """The outcome of one clip."""

    address: str
    row: Row
    output_path: str
    """Path of the clip's results relative to the output folder, without an ending."""
    stamp: Stamp | None = None
    """The version of the clip that was read; see `anglecam.batch.identity.stamp`."""
    stamp_is_reliable: bool = False
    """Whether every later change of the clip changes its stamp; see `anglecam.batch.identity.is_reliable`."""
    files: dict[str, int] = field(default_factory=dict)
    """Paths of the results relative to the output folder, and their sizes in bytes."""
    call_is_wrong: bool = False
    """Whether the cause of the failure is a rig file, not the clip."""
    transient: bool = False
    """Whether the failure may disappear without any change of the inputs: a clip still being written."""
    removed: bool = False
    """Whether the clip was missing when its folder was last searched."""
    inputs: dict[str, str | None] = field(default_factory=dict)
    """Hashes of rig file, calibration and command."""
    kept: ClipRecord | None = None
    """After a failure: the record of the earlier results, which are still in place."""

    @property
    def has_failed(self) -> bool:
        """Whether the last attempt gave no results."""
        return self.row.status == FAILED

    @property
    def in_place(self) -> ClipRecord | None:
        """The record of the results that are in place."""
        return self.kept if self.has_failed else self

    @property
    def shown(self) -> Row:
        """The row of the index: that of the results in place, where there are any."""
        if not self.removed and not self.has_failed:
            return self.row
        if self.in_place is None:
            return self.row
        reason = "no such clip any more; its results stay" if self.removed else stale_because(self, self.in_place)
        return replace(self.in_place.row, status=STALE, cause=reason)

    def failed(self, cause: str, *, call_is_wrong: bool = False, transient: bool = False) -> ClipRecord:
        """Return the record of the same clip with a failure in place of results."""
        row = replace(self.row, status=FAILED, cause=cause, series=None)
        return replace(self, row=row, files={}, call_is_wrong=call_is_wrong, transient=transient)

    def is_worse_than(self, earlier: ClipRecord) -> bool:
        """Return whether this outcome must not replace the results of an earlier one."""
        return self.has_failed or (self.row.status != OK and earlier.row.status == OK)


@dataclass(frozen=True)
class SessionRecord:
    """The outcome of one session."""

    address: str
    """The session's folder."""
    configuration: str
    """Hash of everything that the results depend on."""
    output_path: str
    """Folder of the results relative to the output folder."""
    model: str | None = None
    """``model.json``, relative to the output folder."""
    verdict: str | None = None
    effects: str | None = None
    """Ids of the effects that the loop added, separated by `` + ``."""
    cause: str | None = None
    """Why there is no model."""
    problems: tuple[str, ...] = ()
    """Recordings that could not be used, one line each."""
    files: dict[str, int] = field(default_factory=dict)
    """Paths of the results relative to the output folder, and their sizes in bytes."""
    call_is_wrong: bool = False
    """Whether the cause of the failure is a rig file, not a recording."""
    wall_time_s: float | None = None
    version: str | None = None
    """Version of anglecam that fitted the session."""
    inputs: dict[str, str | None] = field(default_factory=dict)
    """Hashes of everything that the results depend on, part by part."""
    kept: SessionRecord | None = None
    """After a failure: the record of the earlier results, which are still in place."""

    @property
    def has_failed(self) -> bool:
        """Whether the last attempt gave no model."""
        return self.cause is not None

    @property
    def in_place(self) -> SessionRecord | None:
        """The record of the results that are in place."""
        return self.kept if self.has_failed else self

    @property
    def shown_cause(self) -> str | None:
        """Why there is no model, or why the model in place is stale."""
        if self.cause is None or self.kept is None:
            return self.cause
        return stale_because(self, self.kept)

    def failed(self, cause: str, *, call_is_wrong: bool = False) -> SessionRecord:
        """Return the record of the same session with a failure in place of results."""
        return replace(self, model=None, verdict=None, effects=None, cause=cause, files={}, call_is_wrong=call_is_wrong)


Record = ClipRecord | SessionRecord
AnyRecord = TypeVar("AnyRecord", bound=Record)


def keeping(record: Record, before: Record | None) -> Record:
    """Return the record of an attempt; if it must not replace the earlier results, as a failure that keeps them."""
    earlier = None if before is None else before.in_place
    if isinstance(record, ClipRecord) and isinstance(earlier, ClipRecord) and record.is_worse_than(earlier):
        failure = record if record.has_failed else record.failed(record.row.cause or record.row.status)
        return replace(failure, kept=earlier)
    if isinstance(record, SessionRecord) and isinstance(earlier, SessionRecord) and record.has_failed:
        return replace(record, kept=earlier)
    return record


def stale_because(attempt: Record, earlier: Record) -> str:
    """Return why results are stale: why the new attempt failed, and which input or version has changed since.

    Examples
    --------
    >>> earlier = ClipRecord("a.avi", Row("a.avi", sha256="1", version="0.1.0", status="ok"), "a")
    >>> attempt = ClipRecord("a.avi", Row("a.avi", sha256="2", version="0.2.0", cause="empty file"), "a")
    >>> stale_because(attempt, earlier)
    'empty file; the earlier results stay, but these have changed: clip, anglecam (0.1.0, now 0.2.0)'
    """
    changed = []
    if isinstance(attempt, ClipRecord) and isinstance(earlier, ClipRecord):
        cause, new, old = attempt.row.cause, attempt.row.version, earlier.row.version
        changed += ["clip"] if attempt.row.sha256 not in (None, earlier.row.sha256) else []
    else:
        assert isinstance(attempt, SessionRecord)
        assert isinstance(earlier, SessionRecord)
        cause, new, old = attempt.cause, attempt.version, earlier.version
    if attempt.inputs:  # otherwise the attempt failed before it read them
        names = attempt.inputs.keys() | earlier.inputs.keys()
        changed += sorted(name for name in names if attempt.inputs.get(name) != earlier.inputs.get(name))
    changed += [f"anglecam ({old}, now {new})"] if new != old else []
    changed += ["the output path"] if attempt.output_path != earlier.output_path else []
    since = f", but these have changed: {', '.join(changed)}" if changed else ""
    return f"{cause}; the earlier results stay{since}"


def key(address: str) -> str:
    """Return a file name for a clip or session that every file system accepts."""
    return hashlib.sha256(address.encode("utf-8", "surrogateescape")).hexdigest()[:32]


def record_from_dict(kind: type[AnyRecord], found: dict[str, Any]) -> AnyRecord:
    """Return the record that `dataclasses.asdict` turned into a dictionary.

    Raises
    ------
    TypeError, KeyError
        If the dictionary comes from another version of anglecam.
    """
    kept = None if found["kept"] is None else record_from_dict(kind, found["kept"])
    if kind is ClipRecord:
        return kind(**found | {"row": Row(**found["row"]), "kept": kept})
    return kind(**found | {"problems": tuple(found["problems"]), "kept": kept})
