"""The offset between the command's clock and the clip's, from a lamp that lights at the first command change.

The change lies between the last dark frame and the first lit one on the clip's clock; the command file states it on the
command's clock. Where one offset agrees with all clips of a session, it is used for all of them: five clips determine
it several times better than one. Where an offset of zero agrees, nothing is corrected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from anglecam.camera.shutter import measurement_time
from anglecam.data.command import Command
from anglecam.errors import RigError
from anglecam.io.rig import Rig
from anglecam.progress import Progress, unseen, watched
from anglecam.video.film import Film
from anglecam.vision.image.lamp import lit_between, patch_levels

Interval = tuple[float, float]


@dataclass(frozen=True)
class Offset:
    """How far a clip's clock is ahead of its command's."""

    value: float
    """s; 0 where the lamp agrees with it."""
    sigma: float
    """Standard uncertainty, s."""


AGREED = Offset(0.0, 0.0)
DARK = "the lamp is not seen to light; command and clip are assumed to share one clock"


def see_lamp(film: Film, rig: Rig, progress: Progress = unseen) -> Interval | None:
    """Find when the lamp that the rig declares first lights.

    Parameters
    ----------
    film : Film
        The clip.
    rig : Rig
        Its ``sync.lamp`` is the position of the lamp in the picture.
    progress : Progress
        Called after each frame.

    Returns
    -------
    (float, float) or None
        The last instant at which it was certainly dark and the first at which it was fully lit, s on the clip's clock;
        ``None`` where no lamp is declared or it does not light.

    Raises
    ------
    RigError
        Where the lamp lies outside the picture.
    InputError
        As `Film.frames`.
    """
    place = rig.sync.lamp
    if place is None:
        return None
    if not (0.0 <= place[0] <= film.width - 1 and 0.0 <= place[1] <= film.height - 1):
        where, size = f"[{place[0]:g}, {place[1]:g}]", f"{film.width} × {film.height}"
        raise RigError(f"{film.path}: sync: {{lamp: {where}}} lies outside its picture of {size} pixels")
    shown = watched(film.frames(), progress, "looking for the lamp", film.rows.declared)
    frames = [(f.time, None if f.image is None else patch_levels(f.image, place)) for f in shown]
    time = np.array([t for t, _ in frames])
    levels = np.array([np.full(3, np.nan) if level is None else level for _, level in frames])
    rows = np.full(len(time), place[1])
    return lit_between(measurement_time(time, rows, film.height, rig.camera.row_time_s), levels)


def offsets(commands: Mapping[str, Command | None], lit: Mapping[str, Interval | None]) -> dict[str, Offset]:
    """Return how far each clip's clock is ahead of its command's.

    Parameters
    ----------
    commands : mapping
        From a recording's name to its command.
    lit : mapping
        From a recording's name to the result of `see_lamp`.

    Returns
    -------
    dict
        For each name in ``commands``. Without a lamp, as for a series from elsewhere, the clocks are taken to agree.
    """
    ahead = {}
    for name, command in commands.items():
        change, between = None if command is None else command.first_change(), lit.get(name)
        if change is not None and between is not None:
            ahead[name] = (between[0] - change, between[1] - change)
    common = (
        max((low for low, _ in ahead.values()), default=0.0),
        min((high for _, high in ahead.values()), default=0.0),
    )
    agrees = common[0] <= common[1]
    return {name: _offset(common if agrees else ahead[name]) if name in ahead else AGREED for name in commands}


def offset_of(command: Command | None, lit: Interval | None) -> Offset:
    """Return the offset of one clip, as `offsets` does for several."""
    return offsets({"": command}, {"": lit})[""]


def note_on(offset: Offset) -> str | None:
    """Return a message where the clocks disagree, else ``None``."""
    if offset == AGREED:
        return None
    side = "ahead of" if offset.value > 0.0 else "behind"
    return (
        f"the lamp shows the clip's clock {abs(offset.value):.4f} s {side} the command's, ±{offset.sigma:.4f} s; "
        "the command's times are corrected by it"
    )


def on_clip_clock(command: Command | None, offset: Offset) -> Command | None:
    """Return a command with its times on the clip's clock."""
    return None if command is None else replace(command, time=command.time + offset.value)


def _offset(ahead: Interval) -> Offset:
    low, high = ahead
    return AGREED if low <= 0.0 <= high else Offset(0.5 * (low + high), (high - low) / math.sqrt(12.0))
