"""A size with a sign is put in words with its sign."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.output_error import fit_output_error
from anglecam.models.plant import Plant
from anglecam.report.wording import free_form_sentence, summary_of
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


@pytest.mark.parametrize(
    ("cut", "held_out", "on"),
    [
        (False, False, "blocks of the recordings, each left out of the fit"),
        (False, True, "the error on the held-out recordings"),
        (True, False, "blocks of stretches of the recordings, each left out of the fit"),
        (True, True, "the error on stretches of the held-out recordings"),
    ],
)
def test_the_missing_torque_names_the_data_of_its_errors(cut, held_out, on):
    before, after = (SimpleNamespace(rmse=np.radians(error)) for error in (2.92, 1.82))
    found = SimpleNamespace(band=SimpleNamespace(over=("angle",)), before=before, after=after, resembles={})
    text = free_form_sentence(found, held_out, cut)
    assert on in text
    assert "falls from 2.92° to 1.82°." in text
    assert ("of all frames" in text) == cut
