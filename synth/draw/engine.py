"""The interface of a renderer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from synth.camera import Pinhole
from synth.mechanism import Part
from synth.spec import Render


class Engine(Protocol):
    """A scene of parts that can be drawn repeatedly."""

    def draw(self, camera: Pinhole, poses: Mapping[str, NDArray[np.float64]], rows: slice) -> NDArray[np.float32]:
        """Return the light of some rows at one instant: (rows, width, 3), 0 to 1, before mirroring."""
        ...

    def close(self) -> None:
        """Release the engine's resources."""
        ...


def make_engine(render: Render, parts: Sequence[Part], camera: Pinhole, gamma: float) -> Engine:
    """Set up a scene; an engine's libraries are loaded only if it is used.

    Parameters
    ----------
    render : Render
        Engine and quality.
    parts : sequence of Part
        Everything visible.
    camera : Pinhole
        The camera at rest.
    gamma : float
        Light is (grey level / 255) to this power.

    Returns
    -------
    Engine
        The caller closes it.
    """
    if render.engine == "pyrender":
        from synth.draw.gl import Gl

        return Gl(parts, camera, render.quality, gamma)
    from synth.draw.raster import Raster

    return Raster(parts, camera, render.quality, gamma)
