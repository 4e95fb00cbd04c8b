"""The plan of a batch: which jobs it has, where their results go, and what earlier batches have left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from anglecam.batch.address import join, stem
from anglecam.batch.clip_job import ClipJob
from anglecam.batch.output_paths import assign_clip_paths, assign_session_folders
from anglecam.batch.records import ClipRecord, SessionRecord
from anglecam.batch.session_job import SessionJob, find_sessions
from anglecam.batch.sources import Search, Source
from anglecam.errors import InputError
from anglecam.io.session import CORRECTED


@dataclass(frozen=True)
class Plan:
    """The jobs of a batch, and what earlier batches have left."""

    clips: tuple[ClipJob, ...]
    sessions: tuple[SessionJob, ...]
    earlier: tuple[ClipRecord, ...]
    """Records by earlier batches that the index shows, of the clips of this batch and of clips elsewhere."""
    earlier_sessions: tuple[SessionRecord, ...]
    removed: tuple[ClipRecord, ...]
    """Records of clips that were in a folder of this batch and are no longer there."""


def plan_jobs(
    sources: Sequence[Source],
    search: Search,
    records: Sequence[ClipRecord],
    session_records: Sequence[SessionRecord],
    *,
    close: bool,
) -> Plan:
    """Plan the jobs of a batch, in the order of their addresses.

    Parameters
    ----------
    sources : sequence of Source
        The clips of the call.
    search : Search
        Which folders were searched.
    records, session_records : sequence of ClipRecord, sequence of SessionRecord
        By earlier batches.
    close : bool
        Whether to close the loop for each session.

    Returns
    -------
    Plan
        The jobs, with the output paths of their results.
    """
    here = {source.address for source in sources}
    before = {record.address: record for record in records}
    elsewhere = [r for r in records if r.address not in here]
    elsewhere = [replace(r, removed=r.removed or search.has_reached(r.address)) for r in elsewhere]
    # a clip that is no longer there has a row as long as its results are in place
    shown = [r for r in elsewhere if not r.removed or r.in_place is not None]
    sessions = _plan_sessions(sources, session_records, close=close)
    in_session = {clip for job in sessions for clip in job.clips}
    holders = {r.in_place.output_path: r.address for r in records if r.in_place is not None}
    for job in sessions:  # the loop writes series there from which it has removed the camera's effects
        for clip in job.clips:
            corrected = "/".join(filter(None, (job.output_path, CORRECTED, stem(clip))))
            holders.setdefault(corrected, join(join(job.address, CORRECTED), stem(clip)))
    paths = assign_clip_paths(sources, holders)
    clips = tuple(ClipJob(s.address, paths[s.address], s.address in in_session, before.get(s.address)) for s in sources)
    earlier = (*(r for r in records if r.address in here), *shown)
    removed = tuple(r for r in elsewhere if r != before[r.address])
    return Plan(clips, sessions, earlier, tuple(session_records), removed)


def _plan_sessions(
    sources: Sequence[Source], records: Sequence[SessionRecord], *, close: bool
) -> tuple[SessionJob, ...]:
    before = {record.address: record for record in records}
    earlier = {record.address: record.in_place for record in records if record.in_place is not None}
    found = find_sessions(sources)
    holders = {record.output_path: address for address, record in earlier.items()}
    folders = assign_session_folders([(folder, root) for folder, root, _ in found], holders)
    # a verdict is not replaced by a model without one
    closed = {address for address, record in earlier.items() if record.verdict is not None}
    return tuple(
        SessionJob(folder, folders[folder], clips, close or folder in closed, before=before.get(folder))
        for folder, _, clips in found
    )


def out_of_reach(search: Search, records: Sequence[ClipRecord]) -> list[InputError]:
    """Return a problem for every empty folder from which clips were measured."""
    found = []
    for folder in search.empty:
        lost = sum(r.address.startswith(join(folder, "")) and r.in_place is not None for r in records)
        if lost:
            what = f"is empty, although clips were measured from it ({lost}); is it mounted?"
            found.append(InputError(f"{folder}: {what} Their results stay as they were"))
    return found
