"""What `anglecam check` says of a clip."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from anglecam.check.advice import Advice
from anglecam.check.sigma_terms import SPREAD, SigmaTerms
from anglecam.check.smallest import SIZE_SPREAD, Played, Sizes


@dataclass(frozen=True)
class Prediction:
    """Prediction for a whole clip, and for a session of recordings like it, from a part."""

    name: str
    frames_read: int
    frames_measured: int
    seconds_read: float
    rate_hz: float
    mark: str
    """What is followed."""
    pivot: str
    """Source of the pivot."""
    lever_px: float
    noise_grey: float
    """Standard deviation of the pixels, grey levels."""
    contrast_grey: float | None
    """Of the mark against its surroundings, grey levels; ``None`` without a mark."""
    exposure_s: tuple[float, float] | None
    """Exposure time and its standard uncertainty, s, from the blur; ``None`` where no blur is seen."""
    part: SigmaTerms
    """Of the part that was read, as `measure` states it."""
    whole: SigmaTerms
    """Predicted for the whole clip."""
    lowest: float
    highest: float
    """Sigma of the part's surest and least sure frame, rad."""
    sizes: Sizes | None
    """``None`` where the part shows too little motion to predict sizes from."""
    why_no_sizes: str | None
    played: Played | None
    advice: tuple[Advice, ...]
    notes: tuple[str, ...]
    """Messages of the measurement."""

    def as_dict(self) -> dict[str, Any]:
        """Return the content of ``NAME.check.json``."""
        sigma = math.degrees(self.whole.sigma)
        return {
            "name": self.name,
            "read": {
                "frames": self.frames_read,
                "measured": self.frames_measured,
                "duration_s": self.seconds_read,
                "rate_hz": self.rate_hz,
            },
            "found": {"mark": self.mark, "pivot": self.pivot, "lever_px": self.lever_px},
            "picture": {
                "noise_grey": self.noise_grey,
                "contrast_grey": self.contrast_grey,
                "exposure_s": None
                if self.exposure_s is None
                else {"value": self.exposure_s[0], "sigma": self.exposure_s[1]},
            },
            "sigma_deg": {
                "part": math.degrees(self.part.sigma),
                "part_range": [math.degrees(self.lowest), math.degrees(self.highest)],
                "whole": sigma,
                "whole_interval_90": [sigma / SPREAD, sigma * SPREAD],
            },
            "terms_deg": {f.name: math.degrees(getattr(self.whole, f.name)) for f in fields(self.whole)},
            "session": None if self.sizes is None else self._session(self.sizes),
            "smallest": [] if self.sizes is None else self._smallest(self.sizes),
            "why_no_sizes": self.why_no_sizes,
            "command": None
            if self.played is None
            else {
                "description": self.played.description,
                "size_factor": self.played.factor,
                "time_s": self.played.command.time,
                "command_deg": np.degrees(self.played.command.angle),
            },
            "advice": [
                {"change": a.change, "text": a.text, "sigma_factor": a.sigma_factor, "size_factor": a.size_factor}
                for a in self.advice
            ],
            "notes": list(self.notes),
        }

    @staticmethod
    def _session(sizes: Sizes) -> dict[str, Any]:
        names = ("a_per_s", "b_per_s2", "c_per_s2")
        return {
            "recordings": sizes.recordings,
            "duration_s": sizes.duration,
            "motion": sizes.motion,
            "model": dict(zip(names, sizes.parameters.tolist(), strict=False)),
            "doubt": sizes.doubt,
        }

    @staticmethod
    def _smallest(sizes: Sizes) -> list[dict[str, Any]]:
        return [
            {
                "id": one.effect.id,
                "parameter": one.effect.parameters[0].name,
                "smallest": one.size,
                "unit": one.effect.parameters[0].unit,
                "interval_90": [one.size / SIZE_SPREAD, one.size * SIZE_SPREAD],
                "is_limit": one.effect.parameters[0].inverse,
            }
            for one in sizes.smallest
        ]
