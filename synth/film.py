"""Makes one frame from its plan: draws its instants, sums them as light, and applies the sensor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synth.draw.engine import make_engine
from synth.exposure import expose
from synth.mechanism import build, poses, prop_poses, props, suspension
from synth.sensor import develop
from synth.spec import Spec
from synth.take import NOISE, Exposure, View, seed_of


class Stage:
    """The scene of a session and the engine that draws it; one at a time in a process."""

    def __init__(self, spec: Spec, seen: View) -> None:
        self._spec = spec
        self._camera = seen.pinhole
        parts = [*build(spec, seen.mark_offset), *props(spec, seen.pinhole)]
        self._hung = suspension(spec)
        self._engine = make_engine(spec.render, parts, seen.pinhole, spec.camera.gamma)

    def light(self, exposure: Exposure) -> NDArray[np.float32]:
        """Return the light of a frame before the sensor: (height, width, 3), 0 to 1, as the picture is written."""
        width, height = self._camera.size
        total = np.zeros((height, width, 3), dtype=np.float32)
        for k, weights in enumerate(exposure.weights):
            open_rows = np.flatnonzero(weights)
            rows = slice(0, height) if len(weights) == 1 else slice(int(open_rows[0]), int(open_rows[-1]) + 1)
            share = weights if len(weights) == 1 else weights[rows]
            dx, dy = exposure.shifts[k].tolist()
            camera = self._camera.shaken(dx, dy, float(exposure.rolls[k]))
            placed = {
                **poses(self._spec.rig, float(exposure.angles[k]), float(exposure.appendage[k]), self._hung),
                **prop_poses(self._spec, self._camera, float(exposure.times[k]), bool(exposure.lamp[k])),
            }
            expose(share.astype(np.float32), self._engine.draw(camera, placed, rows), total[rows])
        return total[:, ::-1] if self._camera.mirrored else total

    def picture(self, recording: int, exposure: Exposure) -> NDArray[np.uint8]:
        """Return a finished frame of a recording: (height, width, 3), RGB, 0-255."""
        rng = np.random.default_rng(seed_of(self._spec, recording, NOISE, exposure.frame))
        return develop(self.light(exposure), self._spec.camera, exposure.gain, rng)

    def close(self) -> None:
        """Release the engine's resources."""
        self._engine.close()
