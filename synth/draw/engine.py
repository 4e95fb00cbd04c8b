"""What any renderer does for us, so that the film does not care which one draws it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from synth.camera import Pinhole
from synth.mechanism import Part
from synth.spec import Render


class Engine(Protocol):
    """A scene of parts, ready to be drawn again and again."""

    def draw(self, camera: Pinhole, poses: Mapping[str, NDArray[np.float64]], rows: slice) -> NDArray[np.float32]:
        """Light of the wanted rows at one instant: (rows, width, 3), 0 to 1, before mirroring."""
        ...

    def close(self) -> None:
        """Give back what the machine lent."""
        ...


def make_engine(render: Render, parts: Sequence[Part], camera: Pinhole, gamma: float) -> Engine:
    """Set a scene up; each engine's libraries are loaded only where it is used.

    Parameters
    ----------
    render : Render
        Engine and quality.
    parts : sequence of Part
        All that can be seen.
    camera : Pinhole
        The camera at rest.
    gamma : float
        Light is (grey level / 255) to this power.

    Returns
    -------
    Engine
        To be closed in the end.
    """
    if render.engine == "pyrender":
        from synth.draw.gl import Gl

        return Gl(parts, camera, render.quality, gamma)
    from synth.draw.raster import Raster

    return Raster(parts, camera, render.quality, gamma)
