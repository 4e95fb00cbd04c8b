"""A session of series of a rig that acts 40 ms late and a tiny clip, each with a command."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.io.series_csv import write_series

from .motion import Plant
from .series import session
from .tiny import tiny_clip

KINDS = ("steps", "stairs", "triangle", "chirp", "random")


def tiny_session(folder: Path, seed: int = 0, kinds: Collection[str] = KINDS) -> Path:
    """Write the session with series of these kinds, of which ``random`` is held out; every seed gives another clip."""
    tiny_clip(folder / "nod.avi", seed)
    (folder / "nod.command.csv").write_text("time_s,command_deg\n0,0\n0.1,5\n")
    for record in session(Plant(dead_time_s=0.04), 4):
        if record.name not in kinds:
            continue
        n = len(record.time)
        series = AngleSeries(record.name, record.time, record.angle, np.full(n, np.radians(0.05)), ("ok",) * n)
        write_series(series, folder / f"{record.name}.angles.csv")
        assert record.command is not None
        rows = np.column_stack([record.command.time, np.degrees(record.command.angle)])
        text = "\n".join(f"{t:.6f},{u:.6f}" for t, u in rows)
        (folder / f"{record.name}.command.csv").write_text(f"time_s,command_deg\n{text}\n")
    (folder / "rig.yaml").write_text("held_out: [random]\n")
    return folder
