"""What every job on a worker needs: the settings of the batch, time limits, remote files, and messages without paths.

A worker is a thread of the batch's own process or a Dask worker on any machine. Decoding and measuring may crash or
hang, so they run in a separate measuring process; a worker itself only handles whole files.
"""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path

from anglecam import __version__
from anglecam.batch.address import fetch, join, name, names_in, parent
from anglecam.batch.identity import calibration_named
from anglecam.batch.lock import is_current
from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.trouble import Trouble, TroubleError
from anglecam.errors import AnglecamError, printable

_MIN_TIME_LIMIT_S = 600.0
_TIME_LIMIT_S_PER_BYTE = 1e-5
"""Ten seconds per megabyte: a hundred times what a clip of ordinary compression takes."""


@dataclass(frozen=True)
class Settings:
    """What holds for every job of one batch."""

    out: str
    """The output folder, absolute."""
    run: str
    """Name of the run that holds the lock."""
    rig: str | None = None
    """The rig file for all clips."""
    retry_failed: bool = False
    time_limit: float | None = None
    """Time limit for one clip, in s; ``None``: by the clip's size."""
    version: str = __version__
    """Version of anglecam that started the batch."""

    @property
    def folder(self) -> OutputFolder:
        """The output folder."""
        return OutputFolder(Path(self.out))


def refusal(settings: Settings) -> str | None:
    """Return why this worker may not do the jobs of a batch; ``None`` if it may.

    It needs the version of anglecam that started the batch, and must see the output folder.
    """
    if settings.version != __version__:
        return f"anglecam {__version__}, but the batch was started by {settings.version}"
    if not is_current(settings.folder, settings.run):
        return f"does not see the folder that the batch sees at {settings.out}"
    return None


def require_same_batch(settings: Settings) -> None:
    """Require that this worker may still do the jobs of a batch.

    Raises
    ------
    TroubleError
        If it may not; see `refusal`.
    """
    reason = refusal(settings)
    if reason is not None:
        raise TroubleError(Trouble(f"worker on {socket.gethostname()}", reason))


def clip_time_limit(size_bytes: int, settings: Settings) -> float:
    """Return the time limit for a clip, in s: the one that the call states, or else more than any sound clip needs."""
    return settings.time_limit or _MIN_TIME_LIMIT_S + _TIME_LIMIT_S_PER_BYTE * size_bytes


def message_of(problem: Exception | str, address: str, workspace: Path) -> str:
    """Return a problem's message without the address, which the reader knows, and without temporary folders."""
    text = (problem.one_line if isinstance(problem, AnglecamError) else str(problem)).replace(
        str(_fetched_folder(workspace, address)), parent(address).rstrip("/")
    )
    return printable(text.removeprefix(f"{address}: "))


def fetch_beside(address: str, workspace: Path, wanted: frozenset[str]) -> Path:
    """Fetch files of a remote folder, and the calibration that its rig file names, to a local folder of that name.

    Parameters
    ----------
    address : str
        A file in the remote folder.
    workspace : Path
        Where the local folder is made.
    wanted : frozenset of str
        Names of files; missing files are left out.

    Returns
    -------
    Path
        The local folder.

    Raises
    ------
    TransientError
        If a file cannot be read.
    """
    here = _fetched_folder(workspace, address)
    here.mkdir(parents=True, exist_ok=True)
    there = parent(address)
    for file in sorted(wanted & names_in(there)):
        fetch(join(there, file), here / file)
    rig = here / "rig.yaml"
    calibration = calibration_named(rig.read_bytes()) if rig.exists() else None
    if calibration is not None and (here / calibration).resolve().is_relative_to(here.resolve()):
        fetch(join(there, calibration), here / calibration)
    return here


def _fetched_folder(workspace: Path, address: str) -> Path:
    """Return the local folder that stands for a remote file's folder."""
    return workspace / "in" / (name(parent(address)) or "root")
