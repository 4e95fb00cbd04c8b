"""A hint never makes a film fail that is measured without it, where what is measured is what the hint means."""

from __future__ import annotations

import math

import numpy as np

from anglecam.engine.hints import Hints, agrees_with_click, agrees_with_pivot, obeys
from anglecam.io.rig import Rig
from anglecam.measurement.detections import Detections

UNUSED = "the hint did not help; what turns there is measured without it"


def without_hints(rig: Rig) -> Rig | None:
    """Return a rig without the place of a mark and of a pivot that are only hints; ``None`` if it has neither."""
    pointed = rig.pointed_mark is not None
    if not pointed and (rig.pivot.near is None or rig.pivot.at is not None):
        return None
    mouth = "auto" if pointed else rig.mouth
    return rig.model_copy(update={"mouth": mouth, "pivot": rig.pivot.model_copy(update={"near": None})})


def is_meant(found: Detections, hints: Hints) -> bool:
    """Return whether what turns, found without hints, is what they mean; false also where that cannot be seen.

    Parameters
    ----------
    found : Detections
        A mark or a body.
    hints : Hints
        Of the rig.
    """
    if not found.moves:
        return False  # of a mark that is declared and stands still nothing is measured
    if hints.mark_px is None:
        return agrees_with_pivot(found.pivot.centre_px, found.pivot.covariance_px2, hints)
    if found.learnt is not None:
        fit, sample = found.learnt.explanations[0].fit, found.learnt.sample
        seen = hints.mark_frame in sample.frames[fit.seen]
        return seen and obeys(fit, sample, hints)
    region = found.regions[hints.mark_frame]
    if region is None or not agrees_with_pivot(found.pivot.centre_px, found.pivot.covariance_px2, hints):
        return False
    place = found.in_picture(found.places_px)[hints.mark_frame]
    return agrees_with_click(np.asarray(place), math.sqrt(region.area_px2 / math.pi), hints)
