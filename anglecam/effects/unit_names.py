"""Units at the end of a parameter's name."""

from __future__ import annotations

UNIT_WORDS = ("deg", "rad", "s", "s2", "hz", "px", "per")
"""Words that a unit is made of."""


def split_unit(name: str) -> tuple[str, str]:
    """Split a parameter's name into words and unit; the unit of a pure number is empty.

    Examples
    --------
    >>> split_unit("dry_friction_deg_per_s2")
    ('dry friction', 'deg/s2')
    >>> split_unit("b_per_s2")
    ('b', '1/s2')
    """
    words = name.split("_")
    end = next(i for i in range(1, len(words) + 1) if all(word in UNIT_WORDS for word in words[i:]))
    units = ["1", *words[end:]] if words[end:][:1] == ["per"] else words[end:]
    return " ".join(words[:end]), " ".join(units).replace(" per ", "/").replace("hz", "Hz")


def unit_on_screen(name: str) -> str:
    """Return a parameter's unit as it follows a number in text; empty for a pure number.

    Examples
    --------
    >>> unit_on_screen("dry_friction_deg_per_s2")
    ' °/s²'
    >>> unit_on_screen("half_width_deg")
    '°'
    """
    unit = split_unit(name)[1].replace("deg", "°").replace("s2", "s²")
    return unit if unit in ("", "°") else f" {unit}"
