"""The engine without a graphics library: every edge of the picture covers its exact area in each pixel.

A depth buffer finds the nearest triangle at the centre of each pixel. Pixels with a discontinuity are cut up, and every
visible triangle counts with its area. In all other pixels the light at the centre is the pixel's mean, as far as light
is affine. A band of rows equals the same rows of the whole picture bit for bit, and every run gives the same result.
While the camera rests, what does not move is drawn once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from synth.camera import Pinhole
from synth.draw.area import cover
from synth.draw.depth import NOTHING, face_camera, find_nearest, lay_planes, light_centres, project
from synth.draw.edges import mark_edges, mark_passages
from synth.draw.light import light_vertices
from synth.draw.lists import gather, number
from synth.draw.still import BODY, Still, reach, restore
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
        self._shapes, self._shades = np.empty((m, 11)), np.empty((m, 3, 3))
        bodies = np.array(self._surface.bodies)
        self._unmoved = (bodies == BODY)[self._surface.body[self._surface.faces[:, 0]]]
        self._all = np.ones(m, dtype=bool)
        self._seen_from: tuple[object, ...] = ()
        self._still: Still | None = None
        self._nearest = np.empty(self._size[::-1], dtype=np.int32)
        self._depths, self._spans = np.empty(self._size[::-1]), np.empty((self._size[1], 2), dtype=np.int32)

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
        width, height = self._size
        first, last, _ = rows.indices(height)
        if first >= last:
            return np.empty((0, width, 3), dtype=np.float32)
        placed = np.array([poses[body][:3] for body in self._surface.bodies], dtype=float)
        seen_from = _key(camera, placed[np.array(self._surface.bodies) == BODY])
        if seen_from != self._seen_from:
            self._seen_from, self._still = seen_from, None
        elif self._still is None:  # worth its time only where the camera rests
            light = self._draw(camera, placed, 0, height, self._unmoved)
            self._spans[:] = 0
            self._still = Still(self._nearest.copy(), self._depths.copy(), light)
        return self._draw(camera, placed, first, last, self._all)

    def close(self) -> None:
        """Do nothing: the engine holds no resources."""

    def _draw(
        self, camera: Pinhole, placed: Floats, first: int, last: int, wanted: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """Draw the wanted triangles; if there is a layer of those that do not move, the others only."""
        surface, still = self._surface, self._still
        top, bottom = max(first - _MARGIN, 0), min(last + _MARGIN, self._size[1])
        seen = self._set_up(camera, placed, top, bottom, wanted)
        spans, nearest, depths = self._spans[top:bottom], self._nearest[top:bottom], self._depths[top:bottom]
        if still is None:
            spans[:], nearest[:], depths[:] = (0, self._size[0]), NOTHING, 0.0
            fresh, light = seen, np.empty((last - first, self._size[0], 3), dtype=np.float32)
        else:
            restore(self._spans, still.nearest, still.depths, self._nearest, self._depths)
            fresh, light = seen[~self._unmoved[seen]], still.light[first:last].copy()
            self._spans[:] = self._size[0], 0
            reach(fresh, self._shapes, top, spans)
            np.clip(spans, 0, self._size[0], out=spans)
        find_nearest(fresh, self._shapes, top, nearest, depths)
        margin, inner = first - top, slice(first - top, last - top)
        light_centres(nearest[inner], self._shapes, self._shades, first, spans[inner], light)
        if self._exact:
            marked = np.zeros((last - first, self._size[0]), dtype=bool)
            mark_edges(
                surface.edges, surface.sides, surface.sharp, self._front, surface.part, self._pixels,
                self._inverse_depth, self._every, nearest, depths, margin, first, spans[inner], marked,
            )  # fmt: skip
            mark_passages(nearest, surface.part, self._shapes, margin, first, spans, marked)
            self._cover(marked, seen, first, light)
        return light

    def _set_up(
        self, camera: Pinhole, placed: Floats, top: int, bottom: int, wanted: NDArray[np.bool_]
    ) -> NDArray[np.int32]:
        """Project and light the wanted triangles that reach into rows `top` to `bottom`; return them."""
        surface = self._surface
        project(
            surface.vertices, surface.body, camera.posed(placed), camera.distance_m, camera.focal_px,
            np.asarray(camera.principal_px, dtype=float), np.asarray(camera.lens_px), camera.k1,
            self._pixels, self._inverse_depth,
        )  # fmt: skip
        faces_seen, vertices_used = face_camera(
            surface.faces, wanted, self._pixels, self._inverse_depth, self._size[0], top - 0.5, bottom - 0.5,
            self._front, self._seen, self._used, self._touched,
        )  # fmt: skip
        seen = self._seen[:faces_seen]
        light_vertices(
            self._used[:vertices_used], surface.normals, surface.albedo, surface.body,
            np.ascontiguousarray(placed[:, :, :3]), self._gamma, self._light,
        )  # fmt: skip
        lay_planes(seen, surface.faces, self._pixels, self._inverse_depth, self._light, self._shapes, self._shades)
        return seen

    def _cover(
        self, marked: NDArray[np.bool_], seen: NDArray[np.int32], first: int, light: NDArray[np.float32]
    ) -> None:
        """Replace the light of marked pixels by its exact mean."""
        places, before = number(marked)
        starts, listed, depths = gather(seen, self._shapes, places, before, first)
        cover(places, starts, listed, depths, self._shapes, self._shades, first, light)


def _key(camera: Pinhole, placed: Floats) -> tuple[object, ...]:
    """Return all that the picture of bodies at these poses depends on."""
    return (
        placed.tobytes(), camera.rotation.tobytes(), tuple(camera.principal_px), camera.distance_m, camera.focal_px,
        camera.k1, camera.aside_m,
    )  # fmt: skip
