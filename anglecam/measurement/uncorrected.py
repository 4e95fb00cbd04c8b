"""The uncorrected angle: of the line from the marker on the shaft to the mark, as the picture shows it.

The measurement uses the centre of rotation, follows the whole body and corrects a declared slanted view. It is thereby
free of many effects of the camera. Where such a correction changed the angle, the loop must see the effect: it starts
from the paper's line from O to the mark, and attributes the difference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats
from anglecam.measurement.derivatives import with_derivatives

SMALLEST = math.radians(1e-3)
"""Smallest difference between the two angles that is considered, rad."""
SIGNIFICANT = 4.0
"""The two angles differ if the difference is this many times the part that is not a function of angle and rate …"""
SYSTEMATIC = 0.9
"""… and this share of its variance is such a function, as an effect of the camera must be."""
OUTLINE_TURN = 0.1
"""Relative excess of the outline's rotation over the line's above which more than the pivot is wrong: 0.12 to 0.8 at
slants of 11° to 20°, 0.08 to 0.25 through a strong lens; views square to the plane stay within 0.06 for any codec."""
POSSIBLE = 0.5
"""Share of `SIGNIFICANT` and `SYSTEMATIC` from which on a difference is possible but not established."""


def uncorrected(series: Sequence[AngleSeries]) -> tuple[list[AngleSeries], bool]:
    """Return the angles of the lines from marker to mark, if they differ from the measured ones in any recording.

    Parameters
    ----------
    series : sequence of AngleSeries
        All recordings of a session.

    Returns
    -------
    series : list of AngleSeries
        As they were; or, of all recordings with a marker, the angles of these lines, with the scatter of the mark's
        position as their sigma.
    differs : bool
        Which of the two it is.
    """
    plain = [_from_marker(one) for one in series]
    marked = [(one, other) for one, other in zip(series, plain, strict=True) if other is not None]
    if not any(_differs(one, other, one.angle) for one, other in marked):
        return list(series), False
    # an angle measured from the mark differs from the line about the marker only by its pivot, by definition
    independent = [(one, other, _about_marker(one)) for one, other in marked if not one.evidence.from_mark]
    only_pivot = not any(_differs(*three) for three in independent) if independent else None
    if any(_slanted(one) for one, _ in marked):
        only_pivot = False
    if only_pivot and any(_differs(*three, clearly=POSSIBLE) for three in independent):
        only_pivot = None
    return [
        one if other is None else _with_evidence(other, only_pivot) for one, other in zip(series, plain, strict=True)
    ], True


def _with_evidence(series: AngleSeries, only_pivot: bool | None) -> AngleSeries:
    return replace(series, evidence=replace(series.evidence, only_pivot_differs=only_pivot))


def _from_marker(series: AngleSeries) -> AngleSeries | None:
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
    # the median frame is near neutral, where the offset between the two lines has no meaning for the angle
    angle = line - zero - np.nanmedian(off)
    # without independent evidence, the mark's scatter is its sigma in the frame in which the pivot has least effect
    scatter = (
        np.nanmin(series.sigma) if series.evidence.from_mark else np.std(off[ok] - _systematic_part(off[ok], series))
    )
    sigma = np.where(ok, scatter, np.nan)
    pivot = np.where(ok[:, None], np.asarray(marker_px), np.nan)
    plain = replace(series, angle=angle, line=line, sigma=sigma, sigma_random=sigma, pivot_px=pivot)
    return with_derivatives(plain)


def _about_marker(series: AngleSeries) -> Floats:
    """Return the angle of the line from the marker if the only error were the marker's distance from the pivot."""
    assert series.line is not None
    assert series.pivot_px is not None
    assert series.mark_px is not None
    centre = np.nanmedian(series.pivot_px, axis=0)
    offset = np.asarray(series.evidence.marker_px) - centre
    lever = np.nanmedian(np.hypot(*(series.mark_px - centre).T))
    ahead, up = _side(series) * offset[0] / lever, -offset[1] / lever
    return np.arctan2(np.sin(series.line) - up, np.cos(series.line) - ahead)


def _side(series: AngleSeries) -> float:
    """Return -1 where the rig faces left, else 1: lines are counted upward from the direction it faces."""
    assert series.line is not None
    assert series.pivot_px is not None
    assert series.mark_px is not None
    return -1.0 if np.nanmedian((series.mark_px - series.pivot_px)[:, 0] * np.cos(series.line)) < 0.0 else 1.0


def _differs(measured: AngleSeries, plain: AngleSeries, angle: Floats, clearly: float = 1.0) -> bool:
    """Return whether the uncorrected angle differs from ``angle`` systematically, as a function of angle and rate."""
    ok = measured.ok
    off = np.unwrap((plain.angle - angle)[ok])
    found = np.unwrap((plain.angle - measured.angle)[ok])
    rough = float(np.std(found - _systematic_part(found, measured)))
    systematic = np.std(off - _systematic_part(off, measured)) ** 2 <= (1.0 - clearly * SYSTEMATIC) * np.var(off)
    return bool(systematic and np.std(off) > max(SMALLEST, clearly * SIGNIFICANT * rough))


def _slanted(series: AngleSeries) -> bool:
    """Return whether the mark's outline rotates significantly more or less than the line; no wrong pivot does that."""
    if series.evidence.outline_turn is None:
        return False
    share, sigma = series.evidence.outline_turn
    return abs(share) > max(OUTLINE_TURN, SIGNIFICANT * sigma)


def _systematic_part(off: Floats, series: AngleSeries) -> Floats:
    """Return the part of a difference that is a function of the angle or, with a slow shutter, of its rate."""
    angle, time = series.angle[series.ok], series.time[series.ok]
    rate = np.gradient(angle, time)
    shapes = np.column_stack([np.ones(len(angle)), angle, angle**2, angle**3, rate, rate * angle])
    shapes /= np.maximum(np.linalg.norm(shapes, axis=0), 1e-300)
    return np.asarray(shapes @ np.linalg.lstsq(shapes, off, rcond=None)[0])
