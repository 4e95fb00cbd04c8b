"""No experiment is proposed in which a model runs away."""

from types import SimpleNamespace

import numpy as np
import pytest

from anglecam.loop.next_experiment import design
from anglecam.loop.policy import DEFAULT


@pytest.mark.parametrize(("angle", "slope"), [(1e150, 0.0), (0.0, 1e150), (np.nan, 0.0), (0.0, -np.inf)])
def test_a_release_in_which_a_model_runs_away_is_no_candidate(monkeypatch, angle, slope):
    far = SimpleNamespace(record=SimpleNamespace(angle=np.array([0.0, angle])), slopes=np.full((2, 3), slope))
    monkeypatch.setattr(design, "_foresee", lambda *_: far)
    assert design._foresee_all(SimpleNamespace(command=None), [None], [], DEFAULT) == []
