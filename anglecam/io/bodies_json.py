"""``NAME.bodies.json``: what moves in a film."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anglecam.data.series import Body
from anglecam.io.files import write_json


def write_bodies(bodies: Sequence[Body], path: Path) -> None:
    """Write what is known of each body; the angles are files of their own.

    Parameters
    ----------
    bodies : sequence of Body
        In the order of their numbers.
    path : Path
        The file.
    """
    write_json(path, [body_as_dict(body) for body in bodies])


def body_as_dict(body: Body) -> dict[str, Any]:
    """Return a body as the file holds it: pixels, degrees."""
    return {
        "body": body.number,
        "pivot_px": None if body.pivot_px is None else list(body.pivot_px),
        "joint_to": body.joint_to,
        "extent_px": body.extent_px,
        "amplitude_deg": float(np.degrees(body.amplitude)),
        "posterior": body.posterior,
        "moves": body.moves,
    }
