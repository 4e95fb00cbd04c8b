"""What a film shows besides the angle, and how the camera sees the mechanism."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CameraEvidence:
    """What a film shows besides the angle: the evidence for effects of the camera and of the clock."""

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
    """How the camera sees the mechanism of a recording, where it is known."""

    neutral: float = 0.0
    """Line from pivot to mouth at the zero of the angle, upward from ahead, rad."""
    lever_px: float | None = None
    """Pivot to mouth; ``None`` for a series without marks."""
    pivot_px: tuple[float, float] | None = None
    """From the middle of the picture, to the right and down."""
    mirrored: bool = False
    """Whether the face looks to the left."""
    only_pivot_differs: bool | None = None
    """Whether all that the picture shows otherwise than the mechanism moves comes from where the mark is, if known."""


UNKNOWN_VIEW = View()
"""Of a series from elsewhere: the face looks ahead at its zero, and more is not known."""


UNKNOWN_VIEW = View()
"""For a series without a film: the line to the mark is horizontal at zero angle, and nothing more is known."""
