"""A size with a sign is put in words with its sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.output_error import fit_output_error
from anglecam.models.plant import Plant
from anglecam.report.wording import summary_of
from support.motion import Plant as TruePlant
from support.series import session

RECORDS = session(TruePlant(), 0)[:1]


@pytest.mark.parametrize(
    ("name", "size", "word"),
    [
        ("dead_time", 0.05, "late"),
        ("dead_time", -0.05, "before its command"),
        ("rolling_shutter", 3e-5, "exposed later"),
        ("rolling_shutter", -3e-5, "exposed before the row above"),
        ("stiffening_spring", -100.0, "stiffer, or softer"),
    ],
)
def test_a_summary_has_the_sign_of_the_fitted_size(name, size, word):
    entry = effect(name)
    base = fit_output_error(Plant((entry,)), RECORDS, [np.array([26.0, 524.0, 508.0, size])], fixed=True)
    assert word in summary_of(entry, replace(base, parameters=np.array([26.0, 524.0, 508.0, size])))
