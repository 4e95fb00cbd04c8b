"""A recording as an estimator uses it: the measured frames, and a measure of noise that no motion causes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.camera_evidence import UNKNOWN_VIEW, View
from anglecam.data.command import Command
from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats
from anglecam.errors import InputError

RELEASE_SHARE = 0.02
"""Share of the swing's range within which the angle counts as not yet released."""
SWINGING_SHARE = 0.25
"""Share of the swing's range beyond which it counts as released, whatever its noise and the hand's tremor."""
REST_RANGE_STEPS = 10.0
"""Range of the angle in median steps from frame to frame, below which it is noise about a rest or a fast swing; white
noise has 5 to 8."""
CHANCE_OF_LINE = 1e-4
"""Probability below which the strongest line in the spectrum of white noise is a swing."""
LONGEST_INTERVAL = 1.0
"""Longest median frame interval, s. A series with longer intervals shows no mechanism of this kind; its times are more
likely in milliseconds."""
MIN_FRAMES = 20
"""Fewest measured frames; fewer do not determine three parameters and three nuisance parameters."""


PLACED_PX = 1e-4
"""Scatter of a mark's distance from the pivot, px, up to which it was placed there by a rotation that another body
showed: the rounding of files. No camera shows a mark so well."""


@dataclass(frozen=True)
class Record:
    """The measured frames of one recording; arrays of length n."""

    name: str
    time: Floats
    """s, strictly increasing."""
    angle: Floats
    """rad from neutral."""
    command: Command | None
    """``None`` where nothing was commanded or the command never changes: a free swing."""
    zero_known: bool
    """Whether the zero of the angle is declared; otherwise it is a nuisance parameter of the recording."""
    sigma: Floats
    """Stated standard uncertainty, rad; NaN where none is stated."""
    lever_scatter: Floats | None = None
    """Scatter of the mark's distance from the pivot, divided by that distance, rad: the camera's noise in the direction
    in which nothing can move; ``None`` for a series without marks, or whose marks were placed at one distance."""
    view: View = UNKNOWN_VIEW
    """How the camera views the mechanism."""
    clock_sigma: float = 0.0
    """Standard uncertainty of the command's clock against the clip's, s."""
    mass_from_upright: float | None = None
    """Angle of the centre of mass from upright at neutral, rad, where it is declared."""

    @property
    def interval(self) -> float:
        """Median frame interval, s."""
        return float(np.median(np.diff(self.time)))

    def between(self, start: float, stop: float) -> Record:
        """Return the part with ``start ≤ time < stop`` (s); the command keeps its whole history."""
        return self.only((self.time >= start) & (self.time < stop))

    def only(self, frames: NDArray[np.bool_]) -> Record:
        """Return the recording with the selected of its (n,) frames; the command keeps its whole history."""
        lever_scatter = None if self.lever_scatter is None else self.lever_scatter[frames]
        return replace(
            self,
            time=self.time[frames],
            angle=self.angle[frames],
            sigma=self.sigma[frames],
            lever_scatter=lever_scatter,
        )


def record_from_series(
    series: AngleSeries, command: Command | None, *, zero_known: bool, mass_from_upright: float | None = None
) -> Record:
    """Return the part of a series that an estimator can use.

    Parameters
    ----------
    series : AngleSeries
        Measured, or read from a file.
    command : Command or None
        The command, on the same clock.
    zero_known : bool
        Whether the rig declares ``neutral`` as a number.
    mass_from_upright : float, optional
        Angle of the centre of mass from upright at neutral, rad, where the rig declares it.

    Returns
    -------
    Record
        The frames whose status is ``ok``; without a command, those from the release on.

    Raises
    ------
    InputError
        If fewer than `MIN_FRAMES` frames are measured, their interval exceeds `LONGEST_INTERVAL`, all of them lie
        before the command's first change, or nothing moves without a command.
    """
    ok = series.ok
    if ok.sum() < MIN_FRAMES:
        raise InputError(f"{series.name}: {ok.sum()} measured frames are too few to fit a model (need {MIN_FRAMES})")
    interval = float(np.median(np.diff(series.time[ok])))
    if interval > LONGEST_INTERVAL:
        raise InputError(f"{series.name}: its frames are {interval:.3g} s apart; are times in seconds?")
    change = None if command is None else command.first_change()
    last = float(series.time[ok][-1])
    if change is not None and change > last:
        raise InputError(
            f"{series.name}: its command first changes at {change:.4g} s, after the last measured frame at {last:.4g} s"
            "; are its times seconds on the clip's clock?"
        )
    acts = command is not None and (change is not None or (zero_known and command.angle[0] != 0.0))
    record = Record(
        series.name,
        series.time[ok],
        series.angle[ok],
        command if acts else None,
        zero_known,
        series.sigma[ok],
        _lever_scatter(series, ok),
        _view(series, ok),
        mass_from_upright=mass_from_upright,
    )
    return record if acts else _from_release(record)


def _lever_scatter(series: AngleSeries, ok: NDArray[np.bool_]) -> Floats | None:
    if series.mark_px is None or series.pivot_px is None:
        return None
    lever = np.hypot(*(series.mark_px - series.pivot_px)[ok].T)
    if not np.all(np.isfinite(lever)) or np.std(lever) <= PLACED_PX:
        return None
    return np.asarray(lever / np.mean(lever) - 1.0)


def _view(series: AngleSeries, ok: NDArray[np.bool_]) -> View:
    if series.line is None or series.mark_px is None or series.pivot_px is None:
        return UNKNOWN_VIEW
    arm = (series.mark_px - series.pivot_px)[ok]
    if not np.any(np.isfinite(arm)):
        return UNKNOWN_VIEW
    neutral, lever = float(np.nanmedian((series.line - series.angle)[ok])), float(np.nanmedian(np.hypot(*arm.T)))
    mirrored = bool(np.median(arm[:, 0] * np.cos(series.line[ok])) < 0.0)
    evidence = series.evidence
    only = evidence.only_pivot_differs
    if evidence.picture_px is None:
        return View(neutral, lever, None, mirrored, only)
    x, y = np.nanmedian(series.pivot_px[ok], axis=0) - (np.array(evidence.picture_px) - 1.0) / 2.0
    return View(neutral, lever, (float(x), float(y)), mirrored, only)


def _from_release(record: Record) -> Record:
    """Leave out the frames before the release of a free swing: the model does not include the hand that holds it.

    The release is the last frame near the start before the angle leaves it for good. Noise or a tremor of more than
    `RELEASE_SHARE` leaves it, too, but comes back.
    """
    if _rests(record.angle):
        raise InputError(f"{record.name}: no command, and nothing moves; there is no swing to fit")
    away = np.abs(record.angle - np.median(record.angle[:5])) / np.ptp(record.angle)
    swinging = int(np.argmax(away > SWINGING_SHARE))
    near = np.flatnonzero(away[:swinging] <= RELEASE_SHARE)
    first = int(near[-1]) + 1 if len(near) else 0
    if len(record.time) - first < MIN_FRAMES:
        raise InputError(f"{record.name}: no command, and the angle moves in too few frames to fit a free swing")
    return record.between(record.time[first], np.inf)


def _rests(angle: Floats) -> bool:
    """Return whether angles (n,) are noise about a rest.

    Noise changes from frame to frame by nearly as much as altogether. So does a swing with a dozen frames a period, but
    it has one frequency: the largest share of the power that one of m frequencies has in white noise exceeds g with
    probability m(1 − g)^(m − 1) at most (Fisher, Proc. R. Soc. A 125, 1929).
    """
    if np.ptp(angle) > REST_RANGE_STEPS * float(np.median(np.abs(np.diff(angle)))):
        return False
    power = np.abs(np.fft.rfft(angle - angle.mean())[1:]) ** 2
    if not power.any():
        return True
    share = float(power.max() / power.sum())
    return len(power) * (1.0 - share) ** (len(power) - 1) > CHANCE_OF_LINE
