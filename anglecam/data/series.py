"""The angle of one recording over time.

Angles are radians, and a frame that could not be measured is NaN. `anglecam.io.series_csv` writes the files.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anglecam.data.camera_evidence import NO_EVIDENCE, CameraEvidence
from anglecam.data.typing import Floats

OK = "ok"
STATUSES = (OK, "no_mouth", "occluded", "ambiguous", "no_pivot", "duplicate", "undecodable")
"""``ok``, or the reason why a frame has no angle."""
CONTRACT_RADII_PX = (6.0, 10.0)
"""Radii of the paper's worst-case mark errors, px; every series file has a column for each."""


@dataclass(frozen=True)
class AngleSeries:
    """One recording's angle, frame by frame; arrays of length n, NaN where ``status`` is not ``ok``.

    Examples
    --------
    >>> import numpy as np
    >>> series = AngleSeries(
    ...     "swing",
    ...     time=np.array([0.0, 0.1, 0.2]),
    ...     angle=np.array([0.0, np.nan, 0.2]),
    ...     sigma=np.array([1e-3, np.nan, 1e-3]),
    ...     status=("ok", "occluded", "ok"),
    ... )
    >>> series.ok
    array([ True, False,  True])
    >>> series.angle[series.ok]
    array([0. , 0.2])
    """

    name: str
    """The recording's name: the clip's file name without its ending."""
    time: Floats
    """Seconds on the clip's clock, strictly increasing."""
    angle: Floats
    """Angle from neutral, rad, upward positive."""
    sigma: Floats
    """Standard uncertainty of ``angle``, rad; NaN throughout where the source states none."""
    status: tuple[str, ...]
    """One of `STATUSES` for each frame."""
    line: Floats | None = None
    """Absolute direction of the line pivot→mark from the image's horizontal, rad."""
    mark_px: Floats | None = None
    """(n, 2) position of the mark, x to the right and y down, px."""
    pivot_px: Floats | None = None
    """(n, 2) position of the pivot, px."""
    bounds: dict[float, Floats] = field(default_factory=dict)
    """Worst-case angle error, rad, for a mark anywhere within the radius (the key), px."""
    first_frame: int = 0
    """Number in the film of the first row's frame; the others follow without a gap."""
    evidence: CameraEvidence = NO_EVIDENCE
    """Evidence of the film besides the angle; empty for a series without a film."""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(n,) whether the angle of each frame is measured."""
        return np.array([s == OK for s in self.status])
