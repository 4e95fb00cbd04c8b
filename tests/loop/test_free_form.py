"""A torque of free form against the true torque of causes that the ledger lacks."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.loop.cross_validation import Prediction
from anglecam.loop.free_form.penalised import smoothing
from anglecam.loop.free_form.result import find_free_form
from anglecam.loop.free_form.search import RATIOS
from anglecam.loop.verdict_json import free_form_as_dict
from anglecam.models.plant import Plant
from anglecam.report.free_form_figure import free_form_figures
from anglecam.report.wording import free_form_sentence
from support.motion import Plant as TruePlant
from support.outside import CAUSES, A, B, C, outside_session
from support.series import session


def _found(records):
    fitted, held = records[:-1], records[-1:]
    base = fit_output_error(Plant(), fitted, [np.array([A, B, C])])
    predicted = predict_output_error(base, held)
    before = Prediction(tuple(held), predicted.residuals, predicted.cost)
    return find_free_form(base, before, fitted, held, (), (), np.random.default_rng(0))


IN_THE_SWEEP = [
    pytest.param(name, marks=pytest.mark.sweep) for name in ("van_der_pol", "chatter", "amplifier_step", "touch")
]


@pytest.mark.parametrize("name", ["magnet", "cam", *IN_THE_SWEEP])
def test_a_cause_outside_the_ledger_is_found_over_what_it_depends_on(name):
    records, exact = (outside_session(name, 0, sigma_deg=s) for s in (0.05, 0.0))
    found = _found(records)
    assert found.band.over == CAUSES[name].over
    noise = records[-1].angle - exact[-1].angle
    before, after = (np.sqrt(np.mean((p.residuals[0] - noise) ** 2)) for p in (found.before, found.after))
    assert after < 0.3 * before
    written = free_form_as_dict(found)
    assert written["over"] == list(CAUSES[name].over)
    assert written["rmse_deg"]["after"] < written["rmse_deg"]["before"]
    assert all(row["sigma"] > 0.0 for row in written["curve"])
    assert [figure[:4] for figure in free_form_figures(found)] == ["<svg"] * len(CAUSES[name].over)
    assert "lacks a torque that depends on the " in free_form_sentence(found, held_out=True, stretches=False)


def test_a_curve_so_smooth_that_rounding_hides_the_data_is_not_tried():
    # a curve over two quantities, at one of whose 81 nodes alone there are data
    bending = np.diff(np.eye(9), 2, axis=0)
    along = bending.T @ bending
    response = np.zeros((100, 81))
    response[:, 40] = np.random.default_rng(0).normal(size=100)
    roughness = [np.kron(along, np.eye(9)), np.kron(np.eye(9), along)]
    smoothness = smoothing(response, response[:, 40], roughness, 100, RATIOS)
    assert all(np.isfinite(smoothness))
    assert min(smoothness) > 0.0


def test_nothing_is_found_where_nothing_is_missing():
    assert _found(session(TruePlant(), 3)) is None


def test_a_command_that_repeats_itself_has_its_period():
    records = outside_session("cam", 0)
    assert [r.command.cycle[0] for r in records] == pytest.approx([2.0] * 5, abs=0.02)
    assert all(r.command.cycle is None for r in session(TruePlant(), 3))
