"""The one place where pyrender is imported: pictures of a scene without a screen, through EGL.

pyrender pulls in its on-screen viewer at import, and with it pyglet and X11. A stand-in takes the viewer's place. Of
pyrender only what works with numpy 2 is used: no bounds, no scale, no shadows.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from synth.camera import DISTANCE, Pinhole
from synth.mesh import Part
from synth.shade import GAMMA, write_shaders

os.environ["PYOPENGL_PLATFORM"] = "egl"
# Mesa's software rasteriser would start a thread for every core in each of our workers.
os.environ.setdefault("LP_NUM_THREADS", "1")
_viewer = ModuleType("pyrender.viewer")
_viewer.Viewer = None  # type: ignore[attr-defined]
sys.modules.setdefault("pyrender.viewer", _viewer)

import pyrender  # noqa: E402
from pyrender.shader_program import ShaderProgramCache  # noqa: E402


class Stage:
    """A lit scene and the renderer that films it; one at a time in a process."""

    def __init__(self, camera: Pinhole, parts: list[Part]) -> None:
        self._camera = camera
        self._scene = pyrender.Scene()
        # One primitive a body: every draw call costs as much as a thousand triangles.
        bodies = sorted({part.body for part in parts})
        self._nodes = {
            body: self._scene.add(pyrender.Mesh([_primitive([part for part in parts if part.body == body])]))
            for body in bodies
        }
        x, y = camera.drawn_pivot_px
        eye = np.eye(4)
        eye[2, 3] = DISTANCE
        # OpenGL counts from the corner of the corner pixel, we from its centre.
        lens = pyrender.IntrinsicsCamera(camera.focal_px, camera.focal_px, x + 0.5, y + 0.5, znear=0.5, zfar=3.0)
        self._scene.add(lens, pose=eye)
        self._renderer = pyrender.OffscreenRenderer(camera.size[0], camera.size[1])
        self._shaders = tempfile.TemporaryDirectory()
        write_shaders(Path(self._shaders.name))
        # pyrender offers no other door to a shader of one's own.
        self._renderer._renderer._program_cache = ShaderProgramCache(self._shaders.name)

    def picture(self, poses: dict[str, NDArray[np.float64]]) -> NDArray[np.uint8]:
        """Film the rig with its bodies at the given poses: (height, width, 3), RGB, 0-255."""
        for body, node in self._nodes.items():
            self._scene.set_pose(node, poses[body])
        picture, _ = self._renderer.render(self._scene, pyrender.RenderFlags.FLAT)
        return picture[:, ::-1] if self._camera.mirrored else picture

    def close(self) -> None:
        """Give the graphics memory back."""
        self._renderer.delete()
        self._shaders.cleanup()


def _primitive(parts: list[Part]) -> pyrender.Primitive:
    """Put parts that move together into one piece."""
    sizes = [len(part.mesh.vertices) for part in parts]
    firsts = np.cumsum([0, *sizes[:-1]])
    linear = (np.vstack([part.colours for part in parts]) / 255.0) ** GAMMA
    return pyrender.Primitive(
        positions=np.vstack([part.mesh.vertices for part in parts]),
        normals=np.vstack([part.mesh.vertex_normals for part in parts]),
        indices=np.vstack([part.mesh.faces + first for part, first in zip(parts, firsts, strict=True)]),
        color_0=np.column_stack([linear, np.ones(len(linear))]).astype(np.float32),
        material=pyrender.MetallicRoughnessMaterial(),
    )
