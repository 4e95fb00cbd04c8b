"""Whether recordings determine the size of an effect."""

from __future__ import annotations

import numpy as np

from anglecam.effects import effect
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.size import sizes_determined
from anglecam.models.plant import Plant
from support.motion import Plant as TruePlant
from support.series import session


def fit(name: str, start: list[float], truth: TruePlant):
    records = session(truth, 0)[:3]
    plant = Plant((effect(name),))
    return fit_output_error(plant, records, [np.array([26.0, 524.0, 508.0, *start])]), records


def test_the_size_of_what_acts_is_determined():
    drag, records = fit("quadratic_drag", [1.0], TruePlant(quadratic_drag=2.0))
    assert sizes_determined(drag, records)


def test_the_size_of_what_never_acts_is_not_determined():
    # a spring that acts below an angle which the motion does not reach
    spring, records = fit("one_sided_spring", [-50.0, -1.5], TruePlant())
    assert not sizes_determined(spring, records)
