"""The paper's filter that runs along, compared with the truth and with the filter over a whole recording."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.data.record import Record
from anglecam.identification.kalman import RunningFilter, filter_record
from anglecam.identification.running_ekf import RunningEkf
from support.motion import Plant, Recording
from support.series import record


@pytest.fixture
def swing() -> Record:
    return record(Plant(), Recording("random", "random", duration_s=20.0), np.random.default_rng(4), sigma_deg=0.01)


def _first(swing, n):
    return Record(swing.name, swing.time[:n], swing.angle[:n], swing.command, False, swing.sigma[:n])


def test_the_parameters_converge(swing):
    plant = Plant()
    true = np.array([plant.a, plant.b, plant.c])
    ekf = RunningEkf(_first(swing, 60))
    after = [ekf.add(t, y) for t, y in zip(swing.time[60:].tolist(), swing.angle[60:].tolist(), strict=True)]
    off = np.array([one.values for one in after]) - true
    sigmas = np.array([one.sigmas for one in after])
    assert (np.abs(off[-1]) < 2.0 * sigmas[-1]).all()
    assert (np.abs(off[-1]) < 0.02 * true).all()
    assert (sigmas[-1] < 0.5 * sigmas[0]).all()


def test_frames_without_an_angle_are_passed_over(swing):
    seen = np.ones(len(swing.time), bool)
    seen[100:130] = False
    ekf = RunningEkf(_first(swing, 60))
    for t, y in zip(swing.time[60:][seen[60:]].tolist(), swing.angle[60:][seen[60:]].tolist(), strict=True):
        last = ekf.add(t, y)
    plant = Plant()
    assert np.allclose(last.values, [plant.a, plant.b, plant.c], rtol=0.03)


def test_a_filter_that_diverges_shows_nothing(swing):
    ekf = RunningEkf(_first(swing, 60))
    ekf.add(float(swing.time[60]), np.inf)
    after = ekf.add(float(swing.time[61]), 0.0)
    assert np.isnan(after.values).all()
    assert np.isnan(after.sigmas).all()


def test_frame_by_frame_it_is_the_filter_over_a_recording(swing):
    mean, covariance = np.array([swing.angle[0], 0.0, 22.0, 500.0, 480.0]), np.diag([1e-4, 1e-2, 25.0, 2500.0, 2500.0])
    whole = filter_record(swing, mean, covariance, process_variance=1e-3, measurement_variance=1e-6)
    running = RunningFilter(mean, covariance, swing.command, swing.interval, 1e-3, 1e-6)
    for k, (time, angle) in enumerate(zip(swing.time.tolist(), swing.angle.tolist(), strict=True)):
        if k:
            running.predict(float(swing.time[k - 1]), time)
        running.update(angle)
        assert np.array_equal(running.ekf.x, whole.state[k])
        assert np.array_equal(running.ekf.P, whole.covariance[k])
