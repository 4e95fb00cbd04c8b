"""Draws a scene off-screen with pyrender through EGL; the only module that imports pyrender.

pyrender imports its on-screen viewer, and with it pyglet and X11, so the viewer is replaced by a stand-in. Only the
parts of pyrender that work with numpy 2 are used: no bounds, no scale, no shadows. pyrender's physically based shader
works per pixel and takes five times as long on a machine without a GPU as the shader here, which works per vertex.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from synth.camera import Pinhole
from synth.draw.light import AMBIENT, LAMPS, TONE
from synth.mechanism import Part

os.environ["PYOPENGL_PLATFORM"] = "egl"
# Mesa's software rasteriser would start a thread per core in each worker process.
os.environ.setdefault("LP_NUM_THREADS", "1")
_viewer = ModuleType("pyrender.viewer")
_viewer.Viewer = None  # type: ignore[attr-defined]
sys.modules.setdefault("pyrender.viewer", _viewer)

import pyrender  # noqa: E402
from pyrender.shader_program import ShaderProgramCache  # noqa: E402

Floats = NDArray[np.float64]

SAMPLES = {"draft": (1, 1), "standard": (2, 1), "metrology": (2, 4)}
"""Oversampling: the factor by which pictures are drawn larger and then reduced, with OpenGL's four samples per pixel;
and the number of drawings in each direction, shifted by fractions of a pixel."""

_VERTEX = """#version 330 core
layout(location = 0) in vec3 position;
layout(location = NORMAL_LOC) in vec3 normal;
layout(location = COLOR_0_LOC) in vec4 color_0;
layout(location = INST_M_LOC) in mat4 inst_m;
uniform mat4 M;
uniform mat4 V;
uniform mat4 P;
out vec3 shade;
void main()
{{
    mat4 pose = M * inst_m;
    vec4 at = P * V * pose * vec4(position, 1.0);
    vec2 off = at.xy / at.w * vec2({half_width}, {half_height});
    gl_Position = vec4(at.xy * (1.0 + {k1} * dot(off, off)), at.zw);
    vec3 n = normalize(mat3(pose) * normal);
    float light = {ambient} + {lamps};
    shade = clamp(pow(color_0.rgb * light, vec3({encode})), 0.0, 1.0);
}}
"""
"""Light is summed at the vertices; the lens distorts about the middle of the picture, which is OpenGL's origin."""

_FRAGMENT = """#version 330 core
in vec3 shade;
out vec4 frag_color;
void main()
{
    frag_color = vec4(shade, 1.0);
}
"""


class Gl:
    """A scene and its OpenGL renderer; a process holds one at a time and closes it before it ends."""

    def __init__(self, parts: Sequence[Part], camera: Pinhole, quality: str, gamma: float) -> None:
        self._size = camera.size
        self._times, self._passes = SAMPLES[quality]
        self._light = ((np.arange(256) / 255.0) ** gamma).astype(np.float32)
        self._scene = pyrender.Scene()
        # One primitive per body: every draw call costs as much as a thousand triangles.
        bodies = sorted({part.body for part in parts})
        self._nodes = {
            body: self._scene.add(pyrender.Mesh([_primitive([part for part in parts if part.body == body])]))
            for body in bodies
        }
        width, height = (self._times * side for side in self._size)
        near, far = max(0.05, camera.distance_m - 0.5), camera.distance_m + 5.0
        focal = self._times * camera.focal_px
        self._lens = pyrender.IntrinsicsCamera(focal, focal, 0.0, 0.0, znear=near, zfar=far)
        self._eye = self._scene.add(self._lens)
        self._renderer = pyrender.OffscreenRenderer(width, height)
        self._shaders = tempfile.TemporaryDirectory()
        _write_shaders(Path(self._shaders.name), camera)
        # pyrender offers no other way to set a custom shader.
        self._renderer._renderer._program_cache = ShaderProgramCache(self._shaders.name)

    def draw(self, camera: Pinhole, poses: Mapping[str, Floats], rows: slice) -> NDArray[np.float32]:
        """Draw the picture of one instant.

        Parameters
        ----------
        camera : Pinhole
            The camera at that instant; size, lens and focal length must be those of the constructor.
        poses : mapping of str to ndarray
            (4, 4) pose of every body.
        rows : slice
            Rows to return; the whole picture is drawn anyway.

        Returns
        -------
        ndarray
            Light, (rows, width, 3), 0 to 1, before mirroring.
        """
        for body, node in self._nodes.items():
            self._scene.set_pose(node, poses[body])
        eye = np.eye(4)
        eye[:3, :3] = camera.rotation.T
        eye[:3, 3] = camera.eye
        self._scene.set_pose(self._eye, eye)
        shifts = (np.arange(self._passes) + 0.5) / self._passes - 0.5
        total = sum(self._once(camera, dx / self._times, dy / self._times) for dx in shifts for dy in shifts)
        return np.asarray(total / self._passes**2, dtype=np.float32)[rows]

    def close(self) -> None:
        """Release the graphics memory."""
        self._renderer.delete()
        self._shaders.cleanup()

    def _once(self, camera: Pinhole, dx: float, dy: float) -> NDArray[np.float32]:
        # OpenGL's origin is the corner of the corner pixel, ours its centre.
        self._lens.cx, self._lens.cy = (
            self._times * (at + shift + 0.5) for at, shift in zip(camera.principal_px, (dx, dy), strict=True)
        )
        picture, _ = self._renderer.render(self._scene, pyrender.RenderFlags.FLAT)
        light = self._light[picture]
        if self._times == 1:
            return light
        width, height = self._size
        return np.asarray(light.reshape(height, self._times, width, self._times, 3).mean(axis=(1, 3)))


def _primitive(parts: Sequence[Part]) -> pyrender.Primitive:
    """Merge parts that move together into one primitive."""
    sizes = [len(part.mesh.vertices) for part in parts]
    firsts = np.cumsum([0, *sizes[:-1]])
    linear = (np.vstack([part.colours for part in parts]) / 255.0) ** TONE
    return pyrender.Primitive(
        positions=np.vstack([part.mesh.vertices for part in parts]),
        normals=np.vstack([part.mesh.vertex_normals for part in parts]),
        indices=np.vstack([part.mesh.faces + first for part, first in zip(parts, firsts, strict=True)]),
        color_0=np.column_stack([linear, np.ones(len(linear))]).astype(np.float32),
        material=pyrender.MetallicRoughnessMaterial(),
    )


def _write_shaders(folder: Path, camera: Pinhole) -> None:
    """Write the two shaders under the file names of pyrender's flat shaders."""
    lamps = " + ".join(
        f"{strength} * max(dot(n, normalize(vec3({x}, {y}, {z}))), 0.0)" for (x, y, z), strength in LAMPS
    )
    width, height = camera.size
    vertex = _VERTEX.format(
        half_width=width / 2,
        half_height=height / 2,
        k1=f"{camera.k1 / camera.focal_px**2:.9e}",
        ambient=AMBIENT,
        lamps=lamps,
        encode=1 / TONE,
    )
    (folder / "flat.vert").write_text(vertex, encoding="utf-8")
    (folder / "flat.frag").write_text(_FRAGMENT, encoding="utf-8")
