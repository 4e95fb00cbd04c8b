"""Trouble of the batch: why a job was not done, for a reason that lies not in its clip.

A store that does not answer, a rig file that cannot be read, a worker without the output folder and a full disk say
nothing about a clip. Its results and its record stay as they are, and each trouble is reported once, however many clips
it concerns.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from dataclasses import dataclass

from anglecam.errors import AnglecamError, InputError, RigError

_WHOLE_FOLDER = frozenset(
    (
        errno.ENOSPC,
        errno.EDQUOT,
        errno.EFBIG,
        errno.EROFS,
        errno.EIO,
        errno.ESTALE,
        errno.ENOTCONN,
        errno.ENODEV,
    )
)
"""Errors in writing that every other clip would meet as well."""


@dataclass(frozen=True)
class Trouble:
    """Why a job was not done."""

    where: str
    """Address of the clip or session, or of the file or folder that is the cause."""
    cause: str
    call_is_wrong: bool = False
    """Whether the cause lies in the call or in a file that the call names: exit status 2."""
    stops: bool = False
    """Whether no other job can be done either."""


class TroubleError(AnglecamError):
    """Carries trouble out of a job."""

    def __init__(self, trouble: Trouble) -> None:
        super().__init__(f"{trouble.where}: {trouble.cause}")
        self.trouble = trouble


def not_written(problem: OSError, address: str, out: str) -> Trouble:
    """Return the trouble that the results of a clip or session cannot be written to the output folder."""
    stops = problem.errno in _WHOLE_FOLDER
    cause = f"the results cannot be written ({problem.strerror or problem})"
    if not stops:
        return Trouble(address, cause)
    return Trouble(f"--out {out}", f"{cause}; the same call goes on from here", stops=True)


def as_problems(troubles: Iterable[Trouble]) -> list[AnglecamError]:
    """Return one problem for all troubles of the same cause, in the order of their places.

    Parameters
    ----------
    troubles : iterable of Trouble
        One for every job that was not done.

    Returns
    -------
    list of AnglecamError
        `RigError` if the call is wrong, otherwise `InputError`.
    """
    places: dict[tuple[str, bool], list[str]] = {}
    for trouble in troubles:
        places.setdefault((trouble.cause, trouble.call_is_wrong), []).append(trouble.where)
    found: list[AnglecamError] = []
    for (cause, call_is_wrong), where in sorted(places.items(), key=lambda item: sorted(item[1])):
        line = f"{where[0]}: {cause}"
        if len(set(where)) > 1:
            line = f"{_common_folder(where)}: {cause}; {len(where)} clips and sessions stay as they were"
        found.append((RigError if call_is_wrong else InputError)(line))
    return found


def _common_folder(addresses: list[str]) -> str:
    return os.path.commonprefix(addresses).rpartition("/")[0] or "/"  # noqa: RUF071  (up to the last common slash)
