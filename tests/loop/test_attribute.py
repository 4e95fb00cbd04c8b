"""Each effect is fitted as well as one who knew the truth could."""

from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.estimate.output_error import fit_output_error
from anglecam.loop.attribute import Candidate, fit_beneath, fit_with
from anglecam.loop.holdout import split_records
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.simulate.plant import Plant
from benchmarks.blind.sessions import HELD_OUT, session


@pytest.mark.parametrize(("seed", "torque"), [(5, 0.896), (7, 0.798)])
def test_dry_friction_is_fitted_as_well_as_from_the_truth_and_with_nothing_beside_its_size(seed, torque):
    fitted, _ = split_records(session({"coulomb_friction": {"torque": torque}}, seed=seed), HELD_OUT)
    friction = effect("coulomb_friction")
    base = fit_output_error(Plant(), fitted, [np.array([26.0, 524.0, 508.0])])
    (forecast,) = forecasts(base, directions(base, fitted, changes(base, fitted, [friction])))
    found = fit_with(base, fitted, forecast)
    size = replace(friction, parameters=friction.parameters[:1])
    from_truth = fit_output_error(Plant((size,)), fitted, [np.append(base.parameters, torque)])
    assert found.cost < (1.0 + 1e-6) * from_truth.cost
    assert found.model.names[3:] == ("friction_deg_per_s2",)


def test_a_dead_zone_beside_nothing_else_is_fitted_as_well_as_from_the_truth():
    width = 0.11164477548077598
    fitted, _ = split_records(session({"dead_zone": {"half_width_deg": width}}, seed=1), HELD_OUT)
    base = fit_output_error(Plant(), fitted, [np.array([26.0, 608.0, 428.0])])
    now, found = base, []
    for name in ("dead_zone", "constant_torque"):
        (forecast,) = forecasts(now, directions(now, fitted, changes(now, fitted, [effect(name)])))
        found.append(Candidate(forecast, fit_with(now, fitted, forecast), 0.0, None, None, 0.0))
        now = found[-1].fit
    zone, beside = found
    deeper = fit_beneath(zone.fit, [beside], fitted)
    from_truth = fit_output_error(zone.fit.model, fitted, [np.append(base.parameters, np.radians(width))])
    assert deeper.model is zone.fit.model
    assert deeper.cost < (1.0 + 1e-6) * from_truth.cost
    assert fit_beneath(deeper, [], fitted) is deeper
