"""Lighting of the rig: ambient light and two lamps, computed at the vertices.

The lamps are fixed in the room, so the head's shading changes as it turns, but little, because most light is ambient.
Both engines use these numbers, so that they draw the same picture.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

AMBIENT = 0.66
LAMPS = (((0.24, 0.52, 0.82), 0.36), ((0.86, 0.17, 0.48), 0.12))
"""For each lamp the direction from the rig, of approximately unit length, and its strength."""

TONE = 2.2
"""Gamma of the display: a surface of a colour reflects the share (grey/255)^2.2 of the light."""

_LAMPS = np.array([[*np.divide(towards, np.linalg.norm(towards)), strength] for towards, strength in LAMPS])


def albedo(colours: Floats, gamma: float) -> Floats:
    """Convert display colours to the light that a sensor of another gamma measures in full illumination.

    Parameters
    ----------
    colours : ndarray
        (n, 3), sRGB, 0-255.
    gamma : float
        Gamma of the sensor: its light is (grey/255)^gamma, and 1 takes the display's grey levels as light.

    Returns
    -------
    ndarray
        (n, 3), 0..1.
    """
    return np.asarray((np.asarray(colours, dtype=float) / 255.0) ** gamma)


def light_vertices(
    used: NDArray[np.int32],
    normals: Floats,
    albedo: Floats,
    body: NDArray[np.int32],
    turns: Floats,
    gamma: float,
    light: Floats,
) -> None:
    """Shade the used vertices, as the shader of `synth.draw.gl` does.

    The shader's grey level is clamp(((colour/255)^2.2 · E)^(1/2.2)) with E the light on the vertex; to the power
    `gamma` this is min(albedo · E^(gamma/2.2), 1).

    Parameters
    ----------
    used : ndarray
        (k,), vertices to shade.
    normals, albedo : ndarray
        (n, 3) each.
    body : ndarray
        (n,), each vertex's row of `turns`.
    turns : ndarray
        (b, 3, 3), linear part of each body's pose.
    gamma : float
        As in `albedo`.
    light : ndarray
        (n, 3), written at `used`.
    """
    _light_vertices(used, normals, albedo, body, turns, gamma / TONE, AMBIENT, _LAMPS, light)


@njit(
    "(int32[::1], float64[:, ::1], float64[:, ::1], int32[::1], float64[:, :, ::1], float64, float64, "
    "float64[:, ::1], float64[:, ::1])",
    cache=True,
    error_model="numpy",
)
def _light_vertices(
    used: NDArray[np.int32],
    normals: Floats,
    albedo: Floats,
    body: NDArray[np.int32],
    turns: Floats,
    exponent: float,
    ambient: float,
    lamps: Floats,
    light: Floats,
) -> None:
    for v in used:
        turn = turns[body[v]]
        a, b, c = normals[v, 0], normals[v, 1], normals[v, 2]
        x = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c
        y = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c
        z = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c
        length = np.sqrt(x * x + y * y + z * z)
        falling = ambient
        for lamp in lamps:
            falling += lamp[3] * max((lamp[0] * x + lamp[1] * y + lamp[2] * z) / length, 0.0)
        factor = falling if exponent == 1.0 else falling**exponent
        for channel in range(3):
            light[v, channel] = min(albedo[v, channel] * factor, 1.0)
