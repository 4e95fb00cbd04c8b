"""The fixed parts: servo, its bracket, the upright that carries the shaft, the base."""

from __future__ import annotations

from anglecam.neck import FourBar
from synth.mechanism.curves import MM
from synth.mechanism.part import LABEL, PAINT, PLASTIC, STEEL, Part, machined
from synth.mechanism.solids import block, joined, rod


def stand(linkage: FourBar, anchor: float) -> list[Part]:
    """Build the fixed parts.

    Parameters
    ----------
    linkage : FourBar
        Its ground link determines the position of the servo's axis.
    anchor : float
        Distance from the shaft back to the rod at which the springs are attached, m.

    Returns
    -------
    list of Part
        Parts of body ``ground``.
    """
    A = -linkage.ground
    servo = [
        block((A - 10 * MM, -30 * MM, 20 * MM), (A + 10 * MM, 10 * MM, 58 * MM)),
        block((A - 10 * MM, -37 * MM, 45 * MM), (A + 10 * MM, 17 * MM, 48 * MM)),
        rod((A, 0), 8 * MM, 57 * MM, 61.5 * MM),
    ]
    screws = [rod((A + x * MM, y * MM), 2.3 * MM, 47 * MM, 49.5 * MM, 20) for x in (-5, 5) for y in (-33.5, 13.5)]
    ground = {
        "servo": (joined(servo), PLASTIC),
        "label": (block((A - 8 * MM, -27 * MM, 57 * MM), (A + 8 * MM, -12 * MM, 58.3 * MM)), LABEL),
        "screws": (joined(screws), STEEL),
        "output shaft": (rod((A, 0), 3 * MM, 60 * MM, 78 * MM, 24), STEEL),
        "spring hook": (rod((-anchor, 0), 1.8 * MM, -74 * MM, 74 * MM, 16), STEEL),
        "bracket": (
            joined(
                [
                    block((A - 14 * MM, -94 * MM, 24 * MM), (A + 14 * MM, -35 * MM, 44 * MM)),
                    block((A - 14 * MM, -99 * MM, 22 * MM), (A + 14 * MM, -91 * MM, 62 * MM)),
                ]
            ),
            PAINT,
        ),
        "far bracket": (block((-anchor - 7 * MM, -94 * MM, -73 * MM), (-anchor + 7 * MM, 6 * MM, -70 * MM)), PAINT),
        "upright": (block((-9 * MM, -94 * MM, 68.5 * MM), (9 * MM, 0, 77 * MM)), STEEL),
        "far upright": (block((-9 * MM, -94 * MM, -77 * MM), (9 * MM, 0, -68.5 * MM)), STEEL),
        "bearing": (
            joined([rod((0, 0), 19 * MM, 66 * MM, 79 * MM), rod((0, 0), 19 * MM, -79 * MM, -66 * MM)]),
            STEEL,
        ),
        "foot": (block((-16 * MM, -99 * MM, 65 * MM), (16 * MM, -90 * MM, 81 * MM)), STEEL),
        "base": (block((-96 * MM, -130 * MM, -84 * MM), (44 * MM, -97 * MM, 88 * MM)), PAINT),
    }
    return [machined(name, "ground", mesh, rgb) for name, (mesh, rgb) in ground.items()]
