"""A person's neck and shoulders, which are fixed while the head nods about the rig's axis.

The neck's upper end is a ball about that axis inside the head, so that no gap opens as the head turns.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from synth.mechanism.curves import MM, Points, closed, opened
from synth.mechanism.head import dress
from synth.mechanism.inflate import Body, Lattice, inflate
from synth.mechanism.paint import palette
from synth.mechanism.part import Part
from synth.mechanism.profile import Profile, Stroke
from synth.spec import Rig

HALF_WIDTH = 76 * MM
"""Half the width of the shoulders, m."""
_OUTLINE: Points = [
    (-34, 32), (-8, 42), (22, 36), (42, 20), (47, 0), (44, -24), (39, -44), (36, -66), (36, -88), (40, -108),
    (52, -132), (70, -170), (84, -220), (88, -280), (0, -300), (-120, -300), (-166, -260), (-160, -200),
    (-136, -150), (-104, -114), (-78, -86), (-66, -58), (-60, -26), (-52, 6),
]  # fmt: skip
_SHIRT: Points = [
    (60, -128), (28, -126), (-10, -116), (-52, -100), (-96, -84), (-180, -90), (-220, -320), (140, -330), (140, -140),
]  # fmt: skip
_CLOTH = np.array([92.0, 104.0, 118.0])


def person(rig: Rig, rng: np.random.Generator) -> list[Part]:
    """Build neck and shirt, both of body ``ground``."""
    profile, body = _shape()
    return dress(body, profile, "ground", {**palette(rig.skin_rgb, rig.lips_rgb), "shirt": _CLOTH}, rng)


@lru_cache(maxsize=1)
def _shape() -> tuple[Profile, Body]:
    collar = closed(_SHIRT, 1 * MM)
    under_the_jaw = opened([(-60, -4), (-22, -30), (18, -42), (46, -48)], 1 * MM)
    shades = (Stroke(collar, 3 * MM, np.array(-0.12)), Stroke(under_the_jaw, 16 * MM, np.array([-0.13, -0.17, -0.17])))
    profile = Profile(closed(_OUTLINE, 2 * MM), {"shirt": collar}, shades=shades)
    return profile, inflate(profile, HALF_WIDTH, [Lattice(4.5 * MM)], [Lattice(9 * MM)])
