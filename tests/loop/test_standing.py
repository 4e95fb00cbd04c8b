"""Which effects stand where structure remains."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from anglecam.loop import close
from support.closing import close_without_rivals
from support.motion import Plant
from support.series import session


def test_an_effect_that_takes_away_nearly_all_of_its_error_stands_beside_an_unknown_one():
    # the encoder's disc has 17 marks that are unevenly spaced: an error of the measurement that no effect describes
    records = [
        replace(r, angle=r.angle + np.radians(0.08) * np.sin(17.0 * r.angle))
        for r in session(Plant(dead_time_s=0.06), 3, sigma_deg=0.02)[::2]
    ]
    verdict = close_without_rivals([replace(r, sigma=np.full(len(r.time), np.radians(0.02))) for r in records])
    assert verdict.verdict == "partly_explained"
    assert [accepted.effect.id for accepted in verdict.accepted] == ["dead_time"]
    assert verdict.after_held_out.rmse < 0.15 * verdict.before_held_out.rmse


def test_an_effect_that_only_resembles_the_cause_does_not_stand(closed):
    # two effects are added in the search, one of them is left out again, and the other does not stand either
    verdict = closed("magnet")
    assert verdict.verdict == "unexplained"
    assert not verdict.accepted


def test_a_base_model_that_was_fitted_in_windows_is_not_judged_by_whole_recordings(monkeypatch):
    # the search may go on without windows, and nothing of what it finds may stand
    first, last = SimpleNamespace(fit=()), SimpleNamespace(fit=(SimpleNamespace(id="gravity_geometry"),))
    monkeypatch.setattr(close, "effects_of", lambda fit: fit)
    monkeypatch.setattr(close, "model_that_stands", lambda task, first, last: first)
    monkeypatch.setattr(close, "smallest_structure", lambda task, first: 0.0)
    monkeypatch.setattr(close, "is_wrong", lambda *_: pytest.fail("its windows are no recordings of the task"))
    assert close._model_that_stands(None, first, last) is first
