"""One clip's row of the index."""

from __future__ import annotations

from dataclasses import dataclass

OK, TRUNCATED, DOUBTFUL, STALE, FAILED = "ok", "truncated", "doubtful", "stale", "failed"


@dataclass(frozen=True)
class Row:
    """One clip's row in ``index.csv`` and ``index.parquet``; ``None`` is an empty cell."""

    path: str
    """Absolute path, or address with its protocol."""
    size_bytes: int | None = None
    sha256: str | None = None
    """Hash of the clip's content."""
    duration_s: float | None = None
    """Number of frames divided by ``rate_hz``."""
    frames: int | None = None
    rate_hz: float | None = None
    """Mean frame rate, from the frames' own time stamps."""
    width_px: int | None = None
    height_px: int | None = None
    codec: str | None = None
    share_measured: float | None = None
    """Frames with an angle divided by all frames."""
    median_sigma_deg: float | None = None
    model: str | None = None
    """``model.json`` of the clip's session, relative to the output folder."""
    verdict: str | None = None
    """Verdict on the clip's session, if the loop was closed."""
    effects: str | None = None
    """Ids of the effects that the loop added to the model, separated by `` + ``."""
    wall_time_s: float | None = None
    version: str | None = None
    """Version of anglecam that measured the clip."""
    configuration: str | None = None
    """SHA-256 of rig file, calibration and command."""
    status: str = FAILED
    """``ok``, ``truncated``, ``doubtful``, ``stale`` or ``failed``."""
    cause: str | None = None
    series: str | None = None
    """``NAME.angles.csv``, relative to the output folder."""
    notes: str | None = None
    """Remarks that `anglecam measure` prints beside the angles, separated by ``; ``: for example, that only the mark
    could be followed.
    """
