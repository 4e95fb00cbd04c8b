"""Which effects stand where structure remains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from support.closing import close_without_rivals
from support.motion import Plant
from support.series import session


def test_what_an_effect_explains_beside_an_unknown_one_is_stated():
    # the encoder's disc has 17 marks that are unevenly spaced: an error of the measurement that no effect describes
    records = [
        replace(r, angle=r.angle + np.radians(0.08) * np.sin(17.0 * r.angle))
        for r in session(Plant(dead_time_s=0.06), 3, sigma_deg=0.02)[::2]
    ]
    verdict = close_without_rivals([replace(r, sigma=np.full(len(r.time), np.radians(0.02))) for r in records])
    assert verdict.verdict == "partly_explained"
    first, *others = verdict.accepted
    assert first.effect.id == "dead_time"
    assert first.explains > 0.98
    assert sum(one.explains for one in others) < 0.02
    assert verdict.after_held_out.rmse < 0.15 * verdict.before_held_out.rmse
    assert verdict.stopped_by


def test_an_effect_that_only_resembles_the_cause_does_not_stand(closed):
    # two effects are added in the search, one of them is left out again, and the other does not stand either
    verdict = closed("magnet")
    assert verdict.verdict == "unexplained"
    assert not verdict.accepted
