"""The camera's geometry: where a point of the rig appears in the picture.

A pinhole camera looks at the shaft from `distance_m`. Its principal point is where the shaft appears in the picture, so
in a square view everything on the shaft turns about that pixel by the same angle, at every depth. The lens distorts
about the middle of the picture instead, as with a shift lens. With the effect `perspective` the principal point is the
middle of the picture and the camera stands beside the shaft, as an ordinary camera does. World axes: x to the right, y
up, z towards the camera. Pixel (0, 0) is the centre of the top left pixel, x to the right, y down.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from synth.effects.camera_tilt import CameraTilt
from synth.effects.lens_distortion import LensDistortion
from synth.effects.perspective import Perspective
from synth.spec import Spec

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pinhole:
    """Camera and lens; a rig that faces left is filmed facing right and the picture mirrored."""

    size: tuple[int, int]
    """Width and height, px."""
    focal_px: float
    principal_px: tuple[float, float]
    """Where the optical axis meets the picture before it is mirrored; the shaft's place unless `aside_m` is given."""
    distance_m: float
    """From the camera to the shaft's point in the plane of motion."""
    rotation: Floats
    """(3, 3), from the world's axes to the camera's (right, up, backwards)."""
    k1: float = 0.0
    """r becomes r·(1 + k1·r²), r from `lens_px` in units of the focal length."""
    aside_m: tuple[float, float] = (0.0, 0.0)
    """The shaft to the right of the optical axis and above it, m, in the camera's axes."""
    mirrored: bool = False
    """Whether the picture is mirrored left to right at the end."""

    @property
    def lens_px(self) -> tuple[float, float]:
        """Return the centre of the distortion: the middle of the picture."""
        return ((self.size[0] - 1) / 2, (self.size[1] - 1) / 2)

    def project(self, points: ArrayLike) -> Floats:
        """Return the pixels (…, 2) of points (…, 3), m, in the picture as it is written."""
        pixels = self.draw(points)[0]
        if self.mirrored:
            pixels[..., 0] = self.size[0] - 1 - pixels[..., 0]
        return pixels

    def draw(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Return the pixels (…, 2) before mirroring and the depth (…) along the line of sight, m, of points (…, 3)."""
        seen = np.asarray(points, dtype=float) @ self.rotation.T + [*self.aside_m, 0.0]
        depth = self.distance_m - seen[..., 2]
        ideal = np.asarray(self.principal_px) + self.focal_px * seen[..., :2] * [1.0, -1.0] / depth[..., None]
        off = ideal - self.lens_px
        stretch = self.k1 * (off**2).sum(axis=-1, keepdims=True) / self.focal_px**2
        return ideal + off * stretch, depth

    def place(self, pixel: tuple[float, float], z: float) -> Floats:
        """Return the point (3,) at height z over the plane of motion that an undistorted square view shows there."""
        x = self.size[0] - 1 - pixel[0] if self.mirrored else pixel[0]
        scale = (self.distance_m - z) / self.focal_px
        right, up = (x - self.principal_px[0]) * scale, (self.principal_px[1] - pixel[1]) * scale
        return np.array([right - self.aside_m[0], up - self.aside_m[1], z])

    def posed(self, placed: Floats) -> Floats:
        """Return the poses (n, 3, 4) of bodies in the camera's axes, with the shaft's distance left out."""
        seen = self.rotation @ placed
        seen[:, :2, 3] += self.aside_m
        return np.asarray(seen)

    @property
    def eye(self) -> Floats:
        """Return the position of the camera in the world, (3,), m."""
        return np.asarray(self.rotation.T @ [-self.aside_m[0], -self.aside_m[1], self.distance_m])

    def shaken(self, dx: float, dy: float, roll: float) -> Pinhole:
        """Return the camera moved so that the picture shifts by (dx, dy) px and turns by `roll` rad about the shaft."""
        if dx == dy == roll == 0.0:
            return self
        sign = -1.0 if self.mirrored else 1.0
        return dataclasses.replace(
            self,
            principal_px=(self.principal_px[0] + sign * dx, self.principal_px[1] + dy),
            rotation=Rotation.from_euler("z", roll).as_matrix() @ self.rotation,
        )


def aim(spec: Spec, lever: float) -> Pinhole:
    """Point the camera at the rig so that a lever in the plane of motion appears with the spec's length, `lever_px`.

    Parameters
    ----------
    spec : Spec
        Its camera, its rig and its optical effects are used.
    lever : float
        Length of the lever, m.

    Returns
    -------
    Pinhole
        The camera at rest.
    """
    camera, rig = spec.camera, spec.rig
    view = Rotation.from_euler("YX", [-camera.azimuth_deg, camera.elevation_deg], degrees=True)
    if tilt := spec.effects.get(CameraTilt):
        about = math.radians(tilt.axis_deg)
        axis = np.array([math.cos(about), math.sin(about), 0.0])
        view = Rotation.from_rotvec(math.radians(tilt.tilt_deg) * axis) * view
    lens = spec.effects.get(LensDistortion)
    mirrored = rig.facing == "left"
    x, y = rig.pivot_px
    shaft = (camera.size[0] - 1 - x if mirrored else x, y)
    principal, aside = shaft, (0.0, 0.0)
    if near := spec.effects.get(Perspective):
        about = math.radians(near.axis_deg)
        axis = np.array([math.cos(about), math.sin(about), 0.0])
        view = Rotation.from_rotvec(math.radians(near.yaw_deg) * axis) * view
        principal = ((camera.size[0] - 1) / 2, (camera.size[1] - 1) / 2)
        metres = lever / rig.lever_px
        aside = ((shaft[0] - principal[0]) * metres, (principal[1] - shaft[1]) * metres)
    return Pinhole(
        size=camera.size,
        focal_px=rig.lever_px * camera.distance_m / lever,
        principal_px=principal,
        distance_m=camera.distance_m,
        rotation=view.as_matrix(),
        k1=lens.k1 if lens else 0.0,
        aside_m=aside,
        mirrored=mirrored,
    )
