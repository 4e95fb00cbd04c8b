"""What the index says about one clip."""

from __future__ import annotations

from dataclasses import dataclass

OK, TRUNCATED, FAILED = "ok", "truncated", "failed"


@dataclass(frozen=True)
class Row:
    """One clip's row in ``index.csv`` and ``index.parquet``; ``None`` is an empty cell."""

    path: str
    """Absolute, or an address with its protocol."""
    size_bytes: int | None = None
    sha256: str | None = None
    """Of the clip's content."""
    duration_s: float | None = None
    """Frames over rate."""
    frames: int | None = None
    rate_hz: float | None = None
    """Mean, from the frames' own time stamps."""
    width_px: int | None = None
    height_px: int | None = None
    codec: str | None = None
    share_measured: float | None = None
    """Frames with an angle, of all frames."""
    median_sigma_deg: float | None = None
    model: str | None = None
    """``model.json`` of the clip's session, relative to the output folder."""
    verdict: str | None = None
    """Of the clip's session, where the loop was closed."""
    effects: str | None = None
    """What the loop added to the model, `` + `` between."""
    wall_time_s: float | None = None
    version: str | None = None
    configuration: str | None = None
    """SHA-256 of rig file, calibration and command."""
    status: str = FAILED
    """``ok``, ``truncated`` or ``failed``."""
    cause: str | None = None
    series: str | None = None
    """``NAME.angles.csv``, relative to the output folder."""
    notes: str | None = None
    """What `anglecam measure` says beside the angles, ``; `` between: that only the mouth could be followed, say."""


def cannot_write(problem: OSError) -> str:
    """Say why results could not be written."""
    return f"the results cannot be written ({problem.strerror or problem})"
