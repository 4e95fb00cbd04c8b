"""The colours of a head: a colour per region, soft shades, and a texture fine enough for image registration.

The texture moves with the head. It is a field over the drawing, a sum of waves and freckles, with practically no
structure finer than 4 mm: the vertices of the skin, about 2 mm apart, sample it fully, and so do pixels of 0.5 mm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synth.mechanism.curves import MM
from synth.mechanism.inflate import Body
from synth.mechanism.profile import Stroke
from synth.spec import Rgb

Floats = NDArray[np.float64]

SHORTEST, LONGEST = 9 * MM, 50 * MM
"""Wavelengths of the texture's waves, m."""
_WAVES, _BLOTCHES = 48, 2.7
"""Number of waves, and the standard deviation of their sum, grey levels."""
_FRECKLES, _FRECKLE, _DARKER = 170, 2.3 * MM, 5.5
"""Number of freckles, standard deviation of a freckle's profile, m, and its depth, grey levels."""
_SLANT = 0.15
"""Weight of the height above the plane as a third coordinate: enough to avoid stripes in an oblique view."""
PALE = 180.0
"""Mean level of a skin with the texture's full contrast; on dark skin the contrast is two thirds of it."""
_STRANDS = 0.10
"""Standard deviation of the strands of hair, as a share of the hair's colour."""

_HAIR: tuple[tuple[float, Rgb, Rgb], ...] = (
    (165, (88, 62, 46), (84, 114, 132)),
    (125, (58, 43, 35), (98, 84, 58)),
    (80, (42, 34, 31), (62, 44, 32)),
    (0, (31, 27, 27), (46, 33, 27)),
)
"""Colours of hair and iris by the mean level of the skin from which on they apply."""


def palette(skin: Rgb, lips: Rgb) -> dict[str, Floats]:
    """Return a colour for every region of a head, sRGB 0-255."""
    base = np.asarray(skin, dtype=float)
    hair, iris = next((hair, iris) for level, hair, iris in _HAIR if base.mean() >= level)
    return {
        "skin": base,
        "ear": base * [1.0, 0.94, 0.93],
        "lips": np.asarray(lips, dtype=float),
        "hair": np.asarray(hair, dtype=float),
        "brow": 0.7 * np.asarray(hair) + 0.3 * base * 0.6,
        "lash": 0.45 * np.asarray(hair, dtype=float),
        "eye": np.array([222.0, 216.0, 208.0]),
        "iris": np.asarray(iris, dtype=float),
        "pupil": np.array([22.0, 20.0, 22.0]),
        "nostril": 0.42 * base,
    }


def paint(body: Body, colours: dict[str, Floats], shades: tuple[Stroke, ...], rng: np.random.Generator) -> Floats:
    """Colour every vertex of every region.

    Parameters
    ----------
    body : Body
        The surface to paint.
    colours : dict
        Region to colour.
    shades : tuple of Stroke
        Relative changes of the colour.
    rng : numpy.random.Generator
        Source of the texture.

    Returns
    -------
    ndarray
        (regions, n, 3): the colours of all vertices for each region, in the order of `colours`, sRGB 0-255.
    """
    factor = np.ones((len(body.vertices), 3))
    for stroke in shades:
        factor *= 1 + stroke.gain * stroke.share(body.vertices[:, :2])[:, None]
    levels, strands = texture(body.vertices, rng), _strands(body.vertices, rng)
    painted = []
    for name, colour in colours.items():
        if name in ("skin", "ear"):
            colour = colour + levels[:, None] * colour / (0.75 * colour.mean() + 0.25 * PALE)
        elif name in ("hair", "brow"):
            colour = colour * (1 + strands[:, None])
        painted.append(np.clip(colour * factor, 0, 255))
    return np.stack(painted)


def texture(points: Floats, rng: np.random.Generator) -> Floats:
    """Evaluate the skin's texture.

    Parameters
    ----------
    points : ndarray
        (n, 3), m.
    rng : numpy.random.Generator
        Source of the waves and freckles.

    Returns
    -------
    ndarray
        (n,), grey levels to add.
    """
    waves = _waves(points * [1.0, 1.0, _SLANT], SHORTEST, LONGEST, rng)
    freckles = rng.uniform([-40 * MM, -60 * MM], [140 * MM, 160 * MM], (_FRECKLES, 2))
    # a round freckle is the product of a profile along x and a profile along y
    across, up = (np.exp(-((points[:, k, None] - freckles[:, k]) ** 2) / (2 * _FRECKLE**2)) for k in (0, 1))
    blots = np.einsum("pf,pf->p", across, up)
    return np.asarray(_BLOTCHES * waves - _DARKER * np.tanh(blots))


def _strands(points: Floats, rng: np.random.Generator) -> Floats:
    """Return strands that converge at the back of the head, where they fade before they become too fine."""
    x, y = points[:, 0] + 92 * MM, points[:, 1] - 112 * MM
    away = np.hypot(x, y)
    unrolled = np.stack([0.25 * away, 90 * MM * np.arctan2(y, x), 0.25 * points[:, 2]], axis=1)
    return np.asarray(_STRANDS * _waves(unrolled, SHORTEST, 30 * MM, rng) * np.clip(away / (90 * MM), 0.15, 1))


def _waves(points: Floats, shortest: float, longest: float, rng: np.random.Generator) -> Floats:
    """Return a sum of plane waves with log-uniform wavelengths and unit standard deviation."""
    number = 2 * np.pi / np.exp(rng.uniform(np.log(shortest), np.log(longest), _WAVES))
    heading = rng.standard_normal((_WAVES, 3))
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    phase = rng.uniform(0, 2 * np.pi, _WAVES)
    return np.asarray(np.cos(points @ (number[:, None] * heading).T + phase).sum(axis=1) * np.sqrt(2 / _WAVES))
