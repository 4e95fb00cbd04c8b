"""What is predicted was used neither to fit the model nor to choose it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from anglecam.identification.output_error import fit_output_error
from anglecam.loop.close import begin
from anglecam.loop.cross_validation import Prediction, chosen_without, fold_numbers, predict_held_out, predicts_better
from anglecam.loop.policy import DEFAULT
from anglecam.models.plant import Plant
from support.motion import Plant as TruePlant
from support.series import session

FOLDS = np.array([-1, 0, 0, 1, 1])


def prediction(size, training):
    record = session(TruePlant(), 0)[0]
    return Prediction(
        (record,), (np.full(5, size),), 1.0, folds=(FOLDS,), training=tuple((cost, 100) for cost in training)
    )


def test_each_fold_is_predicted_by_the_model_that_explains_the_other_folds_best():
    one, other = prediction(0.1, (1.0, 3.0)), prediction(0.2, (2.0, 2.0))
    found = chosen_without([one, other], [1.0, 1.0])
    assert found.residuals[0].tolist() == [0.1, 0.1, 0.1, 0.2, 0.2]
    # 100/2 · ln(3/2) = 20.3 nat
    assert chosen_without([one, other], [1.0, 21.2]).residuals[0].tolist() == [0.1, 0.1, 0.1, 0.2, 0.2]
    assert chosen_without([one, other], [1.0, 21.4]).residuals[0].tolist() == [0.1] * 5


def test_the_choice_for_a_fold_does_not_depend_on_its_frames():
    records = session(TruePlant(), 16)
    fit = fit_output_error(Plant(), records, [np.array([26.0, 524.0, 508.0])])
    first = fold_numbers(records[0], 0.0, DEFAULT) == 0
    nonsense = replace(records[0], angle=np.where(first, 1.0, records[0].angle))
    training = [predict_held_out(fit, [one, *records[1:]], (), DEFAULT)[0].training for one in (records[0], nonsense)]
    assert training[0][0] == pytest.approx(training[1][0], rel=1e-6)
    assert training[1][1][0] > 2.0 * training[0][1][0]


@pytest.mark.parametrize("rate", [0.1, 1.0, 10.0])
def test_blocks_are_a_share_of_the_natural_period(rate):
    """The same motion played slower or faster gives the same blocks."""
    records = [
        replace(r, time=r.time / rate, command=replace(r.command, time=r.command.time / rate))
        for r in session(TruePlant(), 3)
    ]
    task, base = begin(records, (), (), np.random.default_rng(0), lambda stage: None, DEFAULT)
    period = 2.0 * math.pi / math.sqrt(base.parameters[1])
    assert task.policy.cross_validation.left_out_s == pytest.approx(0.3 * period, rel=1e-6)
    slow = [replace(r, time=r.time * rate) for r in records]
    settings = task.policy.cross_validation
    usual = replace(DEFAULT, cross_validation=replace(settings, period_s=settings.period_s * rate))
    for record, one in zip(records, slow, strict=True):
        assert np.array_equal(fold_numbers(record, 0.6, task.policy), fold_numbers(one, 0.6, usual))


def test_no_period_is_longer_than_a_twentieth_of_the_longest_recording():
    """A slow plant in short recordings: every fold still has several blocks."""
    records = [
        replace(r, time=r.time[:60], angle=r.angle[:60], sigma=r.sigma[:60]) for r in session(TruePlant(b=4.0), 3)
    ]
    task, _ = begin(records, (), (), np.random.default_rng(0), lambda stage: None, DEFAULT)
    assert task.policy.cross_validation.period_s == pytest.approx(max(np.ptp(r.time) for r in records) / 20)


def test_a_block_that_is_predicted_wildly_does_not_hide_a_gain_in_all_other_frames():
    rng = np.random.default_rng(2)
    record = session(TruePlant(), 0)[0]
    noise = 1e-3 * rng.standard_normal(len(record.time))
    before = Prediction((record,), (noise + 1.4e-3 * np.sin(9.0 * record.time),), 1.0)
    wild = np.where((record.time > 2.0) & (record.time < 2.2), 0.1, 0.0)
    assert predicts_better(before, Prediction((record,), (noise,), 1.0), 0.0, rng)
    assert predicts_better(before, Prediction((record,), (noise + wild,), 1.0), 0.0, rng)
    assert not predicts_better(before, Prediction((record,), (noise + wild + before.residuals[0],), 1.0), 0.0, rng)
    diverging = Prediction((record,), (np.full(len(record.time), np.nan),), 1.0)
    assert predicts_better(diverging, before, 0.0, rng)
    assert not predicts_better(before, diverging, 0.0, rng)
