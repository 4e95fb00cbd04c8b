"""Results as the JSON documents of ``--json`` hold them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anglecam.data.series import CONTRACT_RADII_PX

if TYPE_CHECKING:
    from anglecam.camera.calibrate import BoardCalibration
    from anglecam.measurement.clip import Measurement
    from anglecam.measurement.tracks import MeasuredTracks
    from anglecam.workflow.live import LiveResult


def clip_as_dict(source: Path, measurement: Measurement | MeasuredTracks) -> dict[str, Any]:
    """Return what was measured of a clip; angles in degrees, ``null`` where no frame was measured."""
    series = measurement.series
    ok = series.ok
    angle = np.degrees(series.angle[ok])
    return {
        "name": series.name,
        "source": str(source),
        "frames": len(ok),
        "measured": int(ok.sum()),
        "status": dict(Counter(series.status)),
        "angle_deg": {
            "smallest": float(angle.min()) if len(angle) else None,
            "largest": float(angle.max()) if len(angle) else None,
        },
        "median_sigma_deg": _median_deg(series.sigma[ok]),
        "bounds_deg": {f"{r:g}px": _median_deg(series.bounds[r][ok]) for r in CONTRACT_RADII_PX if r in series.bounds},
        "pivot": measurement.pivot,
        "by": measurement.by,
        "notes": list(measurement.notes),
        "doubt": measurement.doubt,
    }


def live_as_dict(result: LiveResult) -> dict[str, Any]:
    """Return what was recorded and measured while filming."""
    latencies = 1e3 * result.latencies
    return {
        "film": str(result.film),
        "frames": len(result.rows),
        "measured_at_once": len(latencies),
        "learning": result.count("learning"),
        "late": result.count("late"),
        "latency_ms": {
            "median": float(np.median(latencies)) if len(latencies) else None,
            "quantile_95": float(np.quantile(latencies, 0.95)) if len(latencies) else None,
            "longest": float(latencies.max()) if len(latencies) else None,
        },
        "disagreement_sigmas": result.disagreement,
        "cause": result.cause,
    }


def calibration_as_dict(path: Path, found: BoardCalibration) -> dict[str, Any]:
    """Return a camera calibration; lengths in px."""
    calibration = found.calibration
    return {
        "file": str(path),
        "camera_matrix_px": calibration.camera_matrix,
        "distortion": calibration.distortion,
        "terms": list(found.terms),
        "rms_px": calibration.rms_px,
        "held_out_px": found.held_out_px,
        "views": len(found.views),
        "rejected": found.rejected,
        "notes": list(found.notes),
    }


def _median_deg(values: Any) -> float | None:
    return float(np.degrees(np.median(values))) if len(values) else None
