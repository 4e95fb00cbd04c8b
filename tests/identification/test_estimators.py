"""The registry of estimators, and the calls that `identify_records` refuses with any of them."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from anglecam.cli.app import app
from anglecam.data.step_figures import NO_STEP
from anglecam.errors import RigError
from anglecam.identification.estimators import ESTIMATORS, Estimate, Estimator
from anglecam.identification.identify_records import identify_records
from anglecam.io.rig import Rig
from anglecam.neck.large_angle import LargeAngleNeck
from support.motion import Plant as TruePlant
from support.series import session

RECORDS = session(TruePlant(), 0, sigma_deg=0.2)[:2]


def test_the_registry_holds_the_estimators_of_the_contract_and_the_neck():
    assert tuple(ESTIMATORS) == ("ekf", "neck", "oe2", "oe3")
    for name, entry in ESTIMATORS.items():
        assert entry.id == name
        assert entry.summary
        assert entry.takes_neck == (name == "neck")


def test_a_new_entry_of_the_registry_is_an_estimator_everywhere(monkeypatch):
    def fit(second_order, records, start, neck):
        return Estimate(second_order, second_order.parameters + 1.0, np.eye(3), second_order)

    monkeypatch.setitem(ESTIMATORS, "plus1", Estimator("plus1", "adds one", fit, lambda run: NO_STEP))
    assert "plus1: adds one" in CliRunner().invoke(app, ["identify", "--help"]).output
    plain, shifted = (identify_records(RECORDS, Rig(), name) for name in ("oe2", "plus1"))
    assert shifted.values == pytest.approx(plain.values + 1.0)
    assert shifted.as_dict()["estimator"] == "plus1"
    assert np.isnan(shifted.step.rise_time)


@pytest.mark.parametrize(
    ("fitted", "estimator", "options", "message"),
    [
        ([], "oe2", {"held_out": RECORDS}, "every recording that can be used is held out; nothing is left to fit"),
        ([], "ekf", {}, "no recording that can be used; nothing to fit"),
        (RECORDS, "oe9", {}, "no estimator 'oe9'; choose one of ekf, neck, oe2, oe3"),
        (RECORDS, "oe2", {"neck": LargeAngleNeck()}, "estimator 'oe2' takes no neck"),
    ],
)
def test_what_cannot_be_fitted_is_refused_in_one_line(fitted, estimator, options, message):
    with pytest.raises(RigError) as refused:
        identify_records(fitted, Rig(), estimator, **options)
    assert str(refused.value) == message


def test_filterpy_is_loaded_by_the_filter_only():
    code = "import sys, anglecam.identification.identify_records; print('filterpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
