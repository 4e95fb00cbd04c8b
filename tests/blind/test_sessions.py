"""Sessions without pictures: dependence on the seed, sizes of effects, and the parameters that the loop should find."""

import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.output_error import fit_output_error
from anglecam.models.plant import Plant
from benchmarks.blind.drawn import ALL, NUMBERED, OUTSIDE, draw, magnified
from benchmarks.blind.drawn_films import film_spec, write_case
from benchmarks.blind.films import read_case
from benchmarks.blind.judged import true_values
from benchmarks.blind.sessions import RECORDINGS, residual_deg, scaled, session, spec_of

SEED = 4


def test_a_seed_determines_everything_and_an_effect_changes_no_command():
    plain = {r.name: r for r in session({}, seed=SEED)}
    assert sorted(plain) == sorted(RECORDINGS)
    some = ("random", "triangle")
    again, late = (session(e, seed=SEED, names=some) for e in ({}, {"dead_time": {"tau_s": 0.02}}))
    assert [r.name for r in again] == [name for name in plain if name in some]  # the others make no difference
    for two, other in zip(again, late, strict=True):
        np.testing.assert_array_equal(plain[two.name].angle, two.angle)
        np.testing.assert_array_equal(plain[two.name].command.angle, other.command.angle)
    assert spec_of({}, seed=SEED).plant != spec_of({}, seed=SEED + 1).plant


def test_noise_has_the_specified_standard_deviation_and_ar1_coefficient():
    exact, noisy = (
        session({}, seed=SEED, sigma_deg=s, noise="coloured", names=("random", "triangle")) for s in (0.0, 0.05)
    )
    rest = [n.angle - e.angle for n, e in zip(noisy, exact, strict=True)]
    rest = [r - r.mean() for r in rest]
    assert np.degrees(np.concatenate(rest).std()) == pytest.approx(0.05, rel=0.1)
    assert np.mean([np.corrcoef(r[1:], r[:-1])[0, 1] for r in rest]) == pytest.approx(0.6, abs=0.1)


def test_the_base_model_fits_a_session_without_effects_exactly():
    assert residual_deg({}, SEED) < 1e-4


def test_an_effect_is_scaled_to_the_specified_residual():
    found = scaled(draw("clock_scale", SEED), SEED, 0.5)
    assert residual_deg(found, SEED) == pytest.approx(0.025, rel=0.02)


def test_every_effect_has_a_number_for_its_draws():
    assert sorted(NUMBERED) == sorted(ALL)


@pytest.mark.parametrize("name", ALL)
def test_magnifying_an_effect_and_back_restores_it(name):
    keys = draw(name, SEED)[name]
    larger, back = magnified(name, keys, 2.0), magnified(name, magnified(name, keys, 2.0), 0.5)
    assert larger != keys
    assert back == pytest.approx(keys)


@pytest.mark.parametrize(
    "name",
    [
        "torque_saturation",
        pytest.param("rolling_shutter", marks=pytest.mark.sweep),  # one over most of a frame is fitted below
        pytest.param("lens_distortion", marks=pytest.mark.sweep),
        pytest.param("clock_scale", marks=pytest.mark.sweep),
    ],
)
def test_a_fit_of_the_true_effect_recovers_the_reported_number(name):
    effects = draw(name, SEED)
    records = session(effects, seed=SEED, sigma_deg=0.0)
    spec, entry = spec_of(effects, seed=SEED), effect(name)
    first, value = entry.parameters[0], true_values(spec, effects)[name]
    start = [spec.plant.a, spec.plant.b, spec.plant.c, *entry.null]
    start[3] = first.to_file / value if first.inverse else value / first.to_file
    fit = fit_output_error(Plant((entry,)), records, [np.array(start)])
    assert np.degrees(fit.rmse) < 5e-4
    assert first.in_file_unit(fit.parameters[3])[0] == pytest.approx(value, rel=0.01)


@pytest.mark.parametrize("name", ["constant_torque", pytest.param("detent", marks=pytest.mark.sweep)])
def test_a_drawn_film_is_written_as_a_case_that_reads_back(name, tmp_path):
    write_case(name, SEED, tmp_path)
    case = read_case(tmp_path / f"{name}-{SEED}")
    assert set(case.true) == {name}
    assert case.verdict == ("unexplained" if name in OUTSIDE else "attributed")
    assert [p["value"] for p in case.parameters] == pytest.approx(
        list(true_values(case.spec, case.true).values()), rel=1e-5
    )
    assert ("neutral" in case.spec.declare) == (name == "constant_torque")
    assert np.hypot(*np.subtract(case.spec.declare["pivot"]["near"], case.spec.rig.pivot_px)) < 6
    assert case.spec == film_spec(name, SEED)


def test_a_rolling_shutter_over_most_of_a_frame_is_fitted_exactly():
    effects = {"rolling_shutter": {"row_time_s": 4.7e-5}}
    records = session(effects, seed=SEED, sigma_deg=0.0, fps=40)
    true = spec_of(effects, seed=SEED).plant
    start = np.array([true.a, true.b, true.c, 4.7e-5])
    assert np.degrees(fit_output_error(Plant((effect("rolling_shutter"),)), records, [start]).rmse) < 1e-3
