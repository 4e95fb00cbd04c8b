"""The engine without a graphics library: every edge of the picture covers its exact area in each pixel.

A depth buffer finds the nearest triangle at the centre of each pixel. Pixels with a discontinuity are cut up, and every
visible triangle counts with its area. In all other pixels the light at the centre is the pixel's mean, as far as light
is affine. A band of rows equals the same rows of the whole picture bit for bit, and every run gives the same result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from synth.camera import Pinhole
from synth.draw.area import cover, gather, number
from synth.draw.depth import face_camera, find_nearest, lay_planes, light_centres, project
from synth.draw.edges import mark_edges, mark_passages
from synth.draw.light import light_vertices
from synth.draw.surface import join
from synth.mechanism import Part

Floats = NDArray[np.float64]

_MARGIN = 1
"""Extra rows on each side of a band, whose depths `mark_edges` compares with the band's."""


class Raster:
    """A scene drawn on one processor core.

    Parameters
    ----------
    parts : sequence of Part
        Everything visible: closed bodies wound outwards, or sheets that face the camera. The lens moves vertices, not
        edges, so with a distorting lens long edges must be made of short ones.
    camera : Pinhole
        The camera at rest; only the size of the picture is used.
    quality : str
        ``draft``: the light at each pixel's centre, with jagged edges. ``standard``: exact areas at every
        discontinuity: silhouettes, sharp edges, borders of colour, bodies passing through each other. ``metrology``:
        exact areas in every pixel that the edge of any triangle crosses.
    gamma : float
        Light is (grey level / 255) to this power.
    """

    def __init__(self, parts: Sequence[Part], camera: Pinhole, quality: str, gamma: float) -> None:
        self._size = camera.size
        self._exact, self._every = quality != "draft", quality == "metrology"
        self._gamma = gamma
        self._surface = join(parts, gamma)
        n, m = len(self._surface.vertices), len(self._surface.faces)
        self._pixels, self._inverse_depth, self._light = np.empty((n, 2)), np.empty(n), np.empty((n, 3))
        self._front, self._touched = np.empty(m, dtype=bool), np.empty(n, dtype=bool)
        self._seen, self._used = np.empty(m, dtype=np.int32), np.empty(n, dtype=np.int32)
        self._planes = np.empty((m, 4, 3))
        self._buffers = tuple(np.empty(self._size[::-1], dtype=kind) for kind in (np.int32, np.int32, np.float64))

    def draw(self, camera: Pinhole, poses: Mapping[str, Floats], rows: slice) -> NDArray[np.float32]:
        """Draw the picture of one instant.

        Parameters
        ----------
        camera : Pinhole
            The camera at that instant; its size must be that of the constructor.
        poses : mapping of str to ndarray
            (4, 4) pose of every body; it may include stretching.
        rows : slice
            Rows to draw.

        Returns
        -------
        ndarray
            Light, the mean over each pixel, (rows, width, 3), 0 to 1, before mirroring; dark where there is nothing.

        Raises
        ------
        KeyError
            If a body has no pose.
        """
        surface = self._surface
        width, height = self._size
        first, last, _ = rows.indices(height)
        light = np.empty((max(last - first, 0), width, 3), dtype=np.float32)
        if light.size == 0:
            return light
        top, bottom = max(first - _MARGIN, 0), min(last + _MARGIN, height)
        seen, planes = self._set_up(camera, poses, top, bottom)

        nearest, owner, depths = (buffer[: bottom - top] for buffer in self._buffers)
        find_nearest(seen, surface.faces, surface.part, self._pixels, planes, top, nearest, owner, depths)
        marked = np.zeros(light.shape[:2], dtype=bool)
        if self._exact:
            margin = first - top
            mark_edges(
                surface.edges, surface.sides, surface.sharp, self._front, surface.part, self._pixels,
                self._inverse_depth, self._every, owner, depths, margin, first, marked,
            )  # fmt: skip
            mark_passages(nearest, owner, planes, margin, first, marked)
        light_centres(nearest[first - top : last - top], planes, first, light)
        if marked.any():
            self._cover(marked, seen, planes, first, light)
        return light

    def close(self) -> None:
        """Do nothing: the engine holds no resources."""

    def _set_up(
        self, camera: Pinhole, poses: Mapping[str, Floats], top: int, bottom: int
    ) -> tuple[NDArray[np.int32], Floats]:
        """Project and light the triangles that reach into rows `top` to `bottom`; return them and their planes."""
        surface = self._surface
        placed = np.array([poses[body][:3] for body in surface.bodies], dtype=float)
        project(
            surface.vertices, surface.body, camera.rotation @ placed, camera.distance_m, camera.focal_px,
            np.asarray(camera.principal_px, dtype=float), np.asarray(camera.lens_px), camera.k1,
            self._pixels, self._inverse_depth,
        )  # fmt: skip
        faces_seen, vertices_used = face_camera(
            surface.faces, self._pixels, self._inverse_depth, self._size[0], top - 0.5, bottom - 0.5,
            self._front, self._seen, self._used, self._touched,
        )  # fmt: skip
        seen = self._seen[:faces_seen]
        light_vertices(
            self._used[:vertices_used], surface.normals, surface.albedo, surface.body,
            np.ascontiguousarray(placed[:, :, :3]), self._gamma, self._light,
        )  # fmt: skip
        lay_planes(seen, surface.faces, self._pixels, self._inverse_depth, self._light, self._planes)
        return seen, self._planes[:faces_seen]

    def _cover(
        self, marked: NDArray[np.bool_], seen: NDArray[np.int32], planes: Floats, first: int, light: NDArray[np.float32]
    ) -> None:
        """Replace the light of marked pixels by its exact mean."""
        faces = self._surface.faces
        places, before = number(marked)
        heads = np.empty(len(places), dtype=np.int32)
        triangles, following = gather(seen, faces, self._pixels, places, before, first, heads)
        cover(places, heads, triangles, following, seen, faces, self._pixels, self._inverse_depth, planes, first, light)
