"""Job records: the outcome of each clip and session, as the database keeps it between batches.

A job record describes results that are in place. `anglecam.batch.publish` keeps it so: it deletes a record before it
replaces the results, and saves the new record after the new results are in place.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from anglecam.batch.identity import Stamp
from anglecam.batch.row import FAILED, Row


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
    """Whether the failure may disappear without any change of the inputs: a full disk, a clip still being written."""
    removed: bool = False
    """Whether the clip was missing when its folder was last searched. The index then leaves it out."""

    @property
    def has_failed(self) -> bool:
        """Whether there are no results."""
        return self.row.status == FAILED

    def failed(self, cause: str, *, call_is_wrong: bool = False, transient: bool = False) -> ClipRecord:
        """Return the record of the same clip with a failure in place of results."""
        row = replace(self.row, status=FAILED, cause=cause, series=None)
        return replace(self, row=row, files={}, call_is_wrong=call_is_wrong, transient=transient)


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

    @property
    def has_failed(self) -> bool:
        """Whether there is no model."""
        return self.cause is not None

    def failed(self, cause: str, *, call_is_wrong: bool = False, transient: bool = False) -> SessionRecord:
        """Return the record of the same session with a failure in place of results.

        ``transient`` has no effect: a session that failed is fitted again by every batch with ``--retry-failed``.
        """
        return replace(self, model=None, verdict=None, effects=None, cause=cause, files={}, call_is_wrong=call_is_wrong)


Record = ClipRecord | SessionRecord
AnyRecord = TypeVar("AnyRecord", bound=Record)


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
    if kind is ClipRecord:
        return kind(**found | {"row": Row(**found["row"])})
    return kind(**found | {"problems": tuple(found["problems"])})
