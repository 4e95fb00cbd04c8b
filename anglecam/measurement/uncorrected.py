"""The angle as the picture shows it: from the mark on the shaft to the mouth, with nothing put right.

The measurement turns about the centre of the motion, follows the whole head and undoes a slanted view, and so is free
of much that a camera does to an angle. Where that mattered, the loop has to see what it did: it begins with the
paper's own line from O to the mouth, and names what stands between the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats

FINEST = math.radians(1e-3)
"""No difference smaller than this is looked into."""
TOLD_APART = 4.0
"""Two ways of measuring differ where they do so by this many times what no course explains …"""
COURSE = 0.9
"""… and this share of the difference follows angle and rate, as what a camera does to an angle must."""
OWN_TURN = 0.1
"""Share by which a mouth turns otherwise than the line to it where more than the pivot is wrong: 0.12 to 0.8 at slants
of 11° to 20°, 0.08 to 0.25 through a strong lens, while square views stay within 0.06 whatever the codec."""
DOUBT = 0.5
"""Share of `TOLD_APART` and `COURSE` from which on they may differ."""


def uncorrected(series: Sequence[AngleSeries]) -> tuple[list[AngleSeries], bool]:
    """Return a session's angles from mark to mouth, if in any recording they are not those that were measured.

    Parameters
    ----------
    series : sequence of AngleSeries
        All recordings of a session.

    Returns
    -------
    series : list of AngleSeries
        As they were, or all of those that have a mark with its lines, their sigma the scatter of the mouth's place.
    differs : bool
        Which of the two.
    """
    plain = [_from_mark(one) for one in series]
    marked = [(one, other) for one, other in zip(series, plain, strict=True) if other is not None]
    if not any(_apart(one, other, one.angle) for one, other in marked):
        return list(series), False
    # a line to the mouth about another point is one from another pivot by its making, whatever the camera does
    beside = [(one, other, _about_mark(one)) for one, other in marked if not one.evidence.from_mark]
    only_pivot = not any(_apart(*three) for three in beside) if beside else None
    if any(_slanted(one) for one, _ in marked):
        only_pivot = False
    if only_pivot and any(_apart(*three, clearly=DOUBT) for three in beside):
        only_pivot = None
    return [
        one if other is None else _with_evidence(other, only_pivot) for one, other in zip(series, plain, strict=True)
    ], True


def _with_evidence(series: AngleSeries, only_pivot: bool | None) -> AngleSeries:
    return replace(series, evidence=replace(series.evidence, only_pivot_differs=only_pivot))


def _from_mark(series: AngleSeries) -> AngleSeries | None:
    marker_px = series.evidence.marker_px
    if marker_px is None or series.mark_px is None or series.pivot_px is None or series.line is None:
        return None
    ok = series.ok
    arm = series.mark_px[ok] - np.asarray(marker_px)
    line = np.full(len(ok), np.nan)
    line[ok] = np.unwrap(np.arctan2(-arm[:, 1], _side(series) * arm[:, 0]))
    line -= 2.0 * np.pi * np.round(np.nanmedian(line - series.line) / (2.0 * np.pi))
    zero = np.nanmedian(series.line - series.angle)
    off = line - series.line
    # the median frame is near neutral: there the two lines part by what has no meaning for the angle
    angle = line - zero - np.nanmedian(off)
    # where there is no second witness, the mouth is as sure as its angle is where the pivot has no part in it
    scatter = np.nanmin(series.sigma) if series.evidence.from_mark else np.std(off[ok] - _course(off[ok], series))
    sigma = np.where(ok, scatter, np.nan)
    pivot = np.where(ok[:, None], np.asarray(marker_px), np.nan)
    return replace(series, angle=angle, line=line, sigma=sigma, pivot_px=pivot)


def _about_mark(series: AngleSeries) -> Floats:
    """Return the angle that the line from the mark would have if the mark stood beside the pivot and no more."""
    assert series.line is not None
    assert series.pivot_px is not None
    assert series.mark_px is not None
    centre = np.nanmedian(series.pivot_px, axis=0)
    beside = np.asarray(series.evidence.marker_px) - centre
    lever = np.nanmedian(np.hypot(*(series.mark_px - centre).T))
    ahead, up = _side(series) * beside[0] / lever, -beside[1] / lever
    return np.arctan2(np.sin(series.line) - up, np.cos(series.line) - ahead)


def _side(series: AngleSeries) -> float:
    """Return -1 where the face looks to the left: lines are counted upward from ahead."""
    assert series.line is not None
    assert series.pivot_px is not None
    assert series.mark_px is not None
    return -1.0 if np.nanmedian((series.mark_px - series.pivot_px)[:, 0] * np.cos(series.line)) < 0.0 else 1.0


def _apart(measured: AngleSeries, plain: AngleSeries, angle: Floats, clearly: float = 1.0) -> bool:
    """Tell whether the plain line parts from ``angle``, which is what was measured or comes of it, on a course."""
    ok = measured.ok
    off = np.unwrap((plain.angle - angle)[ok])
    found = np.unwrap((plain.angle - measured.angle)[ok])
    rough = float(np.std(found - _course(found, measured)))
    on_course = np.std(off - _course(off, measured)) ** 2 <= (1.0 - clearly * COURSE) * np.var(off)
    return bool(on_course and np.std(off) > max(FINEST, clearly * TOLD_APART * rough))


def _slanted(series: AngleSeries) -> bool:
    """Tell whether the mouth turns clearly otherwise than the line to it, as beside a wrong pivot alone it does not."""
    if series.evidence.outline_turn is None:
        return False
    share, sigma = series.evidence.outline_turn
    return abs(share) > max(OWN_TURN, TOLD_APART * sigma)


def _course(off: Floats, series: AngleSeries) -> Floats:
    """Return the part of a difference between two lines that follows the angle, or with a slow shutter its rate."""
    angle, time = series.angle[series.ok], series.time[series.ok]
    rate = np.gradient(angle, time)
    shapes = np.column_stack([np.ones(len(angle)), angle, angle**2, angle**3, rate, rate * angle])
    shapes /= np.maximum(np.linalg.norm(shapes, axis=0), 1e-300)
    return np.asarray(shapes @ np.linalg.lstsq(shapes, off, rcond=None)[0])
