"""The motion of a rigid body about a centre, in all frames of a clip."""

from __future__ import annotations

from dataclasses import dataclass

from anglecam.data.typing import Floats


@dataclass(frozen=True)
class RigidMotion:
    """A body that turns, in the n frames of a clip."""

    turn: Floats
    """(n,) counter-clockwise as seen, from the median pose, rad; NaN where the body is not seen."""
    sigma: Floats
    """(n,) standard uncertainty of ``turn`` about a known centre, rad."""
    pivot_sensitivity: Floats
    """(n, 2) change of ``turn`` with an error of the centre, rad/px."""
    pivot_px: Floats
    """(2,) centre of rotation, px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    centre_px: Floats
    """(2,) middle of the body in the median pose, px."""
    extent_px: float
    """Root mean square distance of its pixels from their middle, px."""
    status: tuple[str, ...]
    """``ok``, ``occluded`` (not seen), ``ambiguous`` or ``undecodable``."""
