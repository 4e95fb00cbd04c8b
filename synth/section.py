"""Building blocks of a spec: bounded numbers, and sections that reject unknown keys."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Byte = Annotated[int, Field(ge=0, le=255)]
Rgb = tuple[Byte, Byte, Byte]
Pixel = tuple[Finite, Finite]
"""x and y; (0, 0) is the centre of the top left pixel."""


class Section(BaseModel):
    """A part of the spec. An unknown key is an error, and a section cannot change once it has been read."""

    model_config = ConfigDict(extra="forbid", frozen=True)
