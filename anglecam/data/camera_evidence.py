"""Evidence of a film besides the angle, and how the camera views the mechanism."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CameraEvidence:
    """Evidence of a film besides the angle, for effects of the camera and of the clock."""

    picture_px: tuple[int, int] | None = None
    """Width and height of the picture; ``None`` where it is not known."""
    marker_px: tuple[float, float] | None = None
    """The mark on the shaft in the picture as it was filmed; ``None`` where there is none, or where the film was
    already corrected by a calibration or stabilised."""
    from_mark: bool = False
    """Whether the angle was measured from the mark itself; otherwise the mark's position is independent evidence."""
    outline_turn: tuple[float, float] | None = None
    """Relative excess of the rotation of the mark's outline over the rotation of the line to it, and its standard
    uncertainty; only where the angle was measured from the mark."""
    lamp_s: tuple[float, float] | None = None
    """Interval, s on the clip's clock, in which the lamp lit that shows the first change of the command."""
    only_pivot_differs: bool | None = None
    """For an angle of the line from `marker_px`: whether it differs from the measured angle only by its pivot."""


NO_EVIDENCE = CameraEvidence()
"""For a series that does not come from a film."""


@dataclass(frozen=True)
class View:
    """How the camera views the mechanism of a recording, as far as it is known."""

    neutral: float = 0.0
    """Direction of the line from pivot to mark at zero angle, upward from straight ahead, rad."""
    lever_px: float | None = None
    """Distance from pivot to mark, px; ``None`` for a series without marks."""
    pivot_px: tuple[float, float] | None = None
    """Pivot from the middle of the picture, to the right and down, px."""
    mirrored: bool = False
    """Whether the mechanism faces to the left."""
    only_pivot_differs: bool | None = None
    """Whether the measured angle differs from the true angle only by the pivot's position; ``None`` if not known."""


UNKNOWN_VIEW = View()
"""For a series without a film: the line to the mark is horizontal at zero angle, and nothing more is known."""
