"""Energy, sag and nods of made-up logs whose truth is known, and the paper's figures."""

import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.power_csv import read_power_log
from anglecam.neck.power import SERVOS, PowerLog, VoltageSource, find_nods, fit_source, nod_power, power_use

V0, R = 6.0, 2.5 / 0.6
NODS = ((1.0, 1.6), (2.5, 3.0), (4.0, 4.8))


def made(rate=200.0, noise_v=0.0, noise_a=0.0, seed=0, sway=0.0):
    """Draw a log of three nods of 0.6 A between rests of 0.02 A, each with a gap of 40 ms in its middle."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 6.0, 1.0 / rate)
    current = np.full(len(time), 0.02)
    for start, end in NODS:
        middle = (start + end) / 2.0
        current[(time >= start) & (time <= end) & (np.abs(time - middle) > 0.02)] = 0.6
    voltage = V0 - R * current
    slow = np.zeros(len(time))
    for i in range(1, len(time)):
        slow[i] = 0.95 * slow[i - 1] + rng.normal(0.0, sway)
    return PowerLog(
        "made",
        time,
        voltage + slow + rng.normal(0.0, noise_v, len(time)),
        current + rng.normal(0.0, noise_a, len(time)),
    )


def test_the_papers_two_states_are_a_source_of_4_17_ohm_and_2_1_watt():
    source = fit_source(PowerLog("two", np.arange(4.0), np.array([6.0, 3.5, 6.0, 3.5]), np.array([0.0, 0.6, 0.0, 0.6])))
    assert (source.open_voltage, source.resistance) == pytest.approx((6.0, 4.1667), abs=1e-4)
    assert float(source.voltage(0.6)) == pytest.approx(3.5)
    assert float(source.power(0.6)) == pytest.approx(2.1)
    assert SERVOS * float(source.power(0.6)) == pytest.approx(33.6)
    assert source.greatest_power == pytest.approx(2.16)


def test_energy_and_powers_of_a_ramp_are_its_integral():
    time = np.linspace(0.0, 2.0, 2001)
    log = PowerLog("ramp", time, np.full(2001, 5.0), time)
    nod = nod_power(log, 0.50025, 1.49975)
    assert nod.energy == pytest.approx(5.0 * (1.49975**2 - 0.50025**2) / 2.0, rel=1e-12)
    assert nod.charge == pytest.approx(nod.energy / 5.0)
    assert nod.mean_power == pytest.approx(5.0, rel=1e-12)
    assert nod.peak_power == pytest.approx(5.0 * 1.49975)
    assert nod.lowest_voltage == 5.0


def test_nods_are_found_in_noise_and_short_pauses_are_inside_one():
    for seed in range(20):
        found = find_nods(made(noise_a=0.01, seed=seed))
        np.testing.assert_allclose(found, NODS, atol=0.006)


def test_energy_and_power_of_a_made_log_are_the_true_ones():
    use = power_use(made(noise_v=0.02, noise_a=0.005), NODS)
    driven, idle = 3.5 * 0.6, 0.02 * (V0 - R * 0.02)
    for nod, (start, end) in zip(use.nods, NODS, strict=True):
        expected = driven * (end - start - 0.04) + 0.04 * idle
        assert nod.energy == pytest.approx(expected, rel=0.02)
        assert nod.mean_power == pytest.approx(expected / (end - start), rel=0.02)
    # straight between samples: half of the 5 ms beside each of the six edges is driven
    edges = 6 * (driven - idle) / 2.0 * 0.005 / (6.0 - 1.9)
    assert use.idle_power == pytest.approx(idle + edges, rel=0.02)
    assert use.all_servos == pytest.approx(16 * sum(n.energy for n in use.nods) / 1.9)
    assert len(power_use(made(noise_a=0.005)).nods) == 3


@pytest.mark.parametrize("sway", [0.0, 0.02])
def test_stated_uncertainty_of_the_source_is_its_scatter(sway):
    fits = [fit_source(made(noise_v=0.05, seed=s, sway=sway, rate=100.0)) for s in range(300)]
    for name, k in (("open_voltage", 0), ("resistance", 1)):
        values = np.array([getattr(f, name) for f in fits])
        stated = np.array([np.sqrt(f.covariance[k, k]) for f in fits])
        assert abs(values.mean() - (V0, R)[k]) < 4.0 * values.std() / np.sqrt(300)
        assert np.median(stated) / values.std() == pytest.approx(1.0, abs=0.15)
    at = np.array([0.0, 0.3, 0.6])
    spread = np.std([f.voltage(at) for f in fits], axis=0)
    np.testing.assert_allclose(fits[0].sigma(at), spread, rtol=0.5)


def test_a_source_that_does_not_sag_has_no_greatest_power():
    assert VoltageSource(6.0, 0.0, np.zeros((2, 2)), 0.0, (0.0, 1.0)).greatest_power == np.inf


def test_logs_are_read_and_their_faults_name_file_and_cause(tmp_path):
    path = tmp_path / "nod.csv"
    path.write_text("time_s,voltage_v,current_a,note\n0,6,0.0,a\n0.1,5,0.24,b\n0.2,3.5,0.6,c\n")
    log = read_power_log(path)
    np.testing.assert_allclose(log.voltage, [6.0, 5.0, 3.5])
    faults = {
        "time_s,voltage_v\n0,6\n": "no column current_a",
        "time_s,voltage_v,current_a\n0,6,x\n": "line 2: current_a is 'x'",
        "time_s,voltage_v,current_a\n0,6,1\n0,6,1\n": "times must increase",
        "time_s,voltage_v,current_a\n0,6,1\n1,6,1\n": "2 rows; at least 3",
    }
    for text, cause in faults.items():
        path.write_text(text)
        with pytest.raises(InputError, match=f"nod.csv: .*{cause}"):
            read_power_log(path)


def test_logs_without_a_nod_or_without_varying_current_are_refused():
    time = np.linspace(0.0, 1.0, 101)
    still = PowerLog("still.csv", time, np.full(101, 6.0), np.full(101, 0.1))
    with pytest.raises(InputError, match=r"still\.csv: the current stays at 0\.1 A"):
        fit_source(still)
    with pytest.raises(InputError, match=r"still\.csv: no nod found"):
        find_nods(still)
    with pytest.raises(InputError, match=r"still\.csv: no nod from 0\.5 s to 1\.5 s in a log from 0 s to 1 s"):
        nod_power(still, 0.5, 1.5)
    with pytest.raises(InputError, match=r"still\.csv: no nod found, so"):
        power_use(still, ())
    noise = PowerLog("noise.csv", time, np.full(101, 6.0), np.random.default_rng(0).normal(0.1, 0.01, 101))
    with pytest.raises(InputError, match="no nod found"):
        find_nods(noise)
