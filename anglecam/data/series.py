"""The angle of one recording over time, as it passes between rooms.

Angles are radians and a frame that could not be measured is NaN. Files are written in `anglecam.io.series_csv`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anglecam.data.camera_evidence import NO_EVIDENCE, CameraEvidence
from anglecam.data.typing import Floats

OK = "ok"
STATUSES = (OK, "no_mouth", "occluded", "ambiguous", "no_pivot", "duplicate", "undecodable")
"""``ok`` or why a frame has no angle."""
CONTRACT_RADII_PX = (6.0, 10.0)
"""Radii of the paper's worst cases, px; every series file has a column for each."""


@dataclass(frozen=True)
class AngleSeries:
    """One recording's angle, frame by frame; arrays of length n, NaN where ``status`` is not ``ok``."""

    name: str
    """The recording's name: the clip's file name without its ending."""
    time: Floats
    """Seconds on the clip's own clock, strictly increasing."""
    angle: Floats
    """Nodding angle from neutral, rad, an upward nod positive."""
    sigma: Floats
    """Standard uncertainty of ``angle``, rad; NaN throughout where the source states none."""
    status: tuple[str, ...]
    """One of `STATUSES` for each frame."""
    line: Floats | None = None
    """Absolute direction of the line pivot→mouth from the image's horizontal, rad."""
    mark_px: Floats | None = None
    """(n, 2) mouth point, x to the right and y down, px."""
    pivot_px: Floats | None = None
    """(n, 2) pivot, px."""
    bounds: dict[float, Floats] = field(default_factory=dict)
    """Worst-case angle error, rad, for a mouth point anywhere within the key's radius in px."""
    evidence: CameraEvidence = NO_EVIDENCE
    """What the film shows besides the angle; nothing for a series without a film."""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Frames whose angle is measured."""
        return np.array([s == OK for s in self.status])
